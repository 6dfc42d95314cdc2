"""Speed brakes that flights seem to have out, and rates that they held: told apart flight by flight."""

import flight_toys
import pytest

from descentflow.diagnosis.inference.credible import LEAST_ITS_OWN, is_credible
from descentflow.diagnosis.inference.mistaken import share_its_own
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.effects import EFFECTS
from descentflow.effects.example_flights import example_flights

BRAKES = "speed_brake"


def of_brakes(sides: Compared) -> tuple[float, bool]:
    """Share of the flights with brakes by a fit in which they are likelier than a held rate; if they are credible."""
    likelihood = flight_toys.likelihood(sides)
    fit = fit_effects(likelihood, [BRAKES])
    assert fit.per_flight[BRAKES].share[likelihood.real].sum() > 0.03 * 300, "the fit has no brakes to judge"
    return share_its_own(likelihood, fit, BRAKES), is_credible(likelihood, fit, BRAKES)


@pytest.mark.parametrize("seed", [1, 2])
def test_brakes_that_were_out_are_not_taken_for_held_rates(seed: int) -> None:
    """In windows of each flight's own."""
    share, credible = of_brakes(flight_toys.with_own_windows(300, share=0.4, size=0.5, seed=seed)[0])
    assert share > 0.8
    assert credible


@pytest.mark.parametrize("seed", [1, 2])
def test_held_rates_that_pass_for_brakes_are_not_credible_as_such(seed: int) -> None:
    """Flights slower at some levels are, by their own mean, faster at the others."""
    share, credible = of_brakes(flight_toys.with_held_rates(300, share=0.15, slower=0.25, seed=seed))
    assert share < LEAST_ITS_OWN
    assert not credible


def test_what_is_left_behind_is_slower_in_windows_of_the_grid() -> None:
    """Ends in order, as many ways as pairs of them that are as far apart, weights of bands between zero and one."""
    ways = EFFECTS["vertical_speed_mode"].left_behind(example_flights()).ways
    weights = ways.table[ways.upper] - ways.table[ways.lower]
    assert bool((weights >= 0).all())
    assert bool((weights <= 1).all())
    # Eleven bands of 2,000 ft: windows of one to six of them, at every place.
    heights = [float(n) for n in range(1, 7) for _ in range(12 - n)]
    assert weights.sum(1).sort().values.tolist() == pytest.approx(heights)
