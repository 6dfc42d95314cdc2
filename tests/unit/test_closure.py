"""How far a gap shrinks: intervals that cover a known closure on either side, and parameters of other flights."""

from dataclasses import replace

import pytest
import torch
from gaussian_toys import FlightLaw
from scipy.stats import binom

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.diagnosis.correction.closure import GapMeasure
from descentflow.diagnosis.inference.example_sides import example_likelihood, example_sides
from descentflow.diagnosis.inference.held_out import held_out_shifts
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.search import fit_effects, parameters_of_part
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects import EFFECTS
from descentflow.measurements.quantities import Quantities


@pytest.fixture(scope="module")
def law(halves: tuple[Quantities, Quantities]) -> FlightLaw:
    whole = compare(*halves, open_aircraft("A320"))
    return FlightLaw.of(whole.only(torch.nonzero(whole.of("tas") | whole.of("rate"))[:, 0]))


def measure(sides: Compared) -> GapMeasure:
    """Nothing here needs a precision."""
    n, p = sides.y.shape
    alike, unit = torch.zeros(n, dtype=torch.long), torch.eye(p, dtype=torch.float64)
    weights = Whitening(alike, unit[None], unit, torch.ones(n), unit)
    return GapMeasure(EffectsLikelihood(sides, weights, {}, seed=0), torch.ones(p, dtype=torch.bool), seed=0)


def covers(law: FlightLaw, aircraft: list[int], gap: float, closed: float, count: int) -> tuple[int, int, int]:
    """How often the interval covers the closure that fleets of this size have, lies below it, and above.

    Real flights differ by ``gap`` spreads, of which the share ``closed`` is taken off. The closure of such fleets is
    that of the mean distances of all of them.
    """
    gaps, intervals = [], []
    for seed in range(count):
        null = law.draw(aircraft, aircraft, seed)
        apart = torch.where(null.real[:, None], gap * null.scale, 0.0)
        found = measure(replace(null, y=null.y + apart))
        gaps.append(found.gap(closed * apart))
        intervals.append(found.marginal(closed * apart))
    before, after, floor = (sum(getattr(one, name) for one in gaps) / count for name in ("before", "after", "floor"))
    truth = 1 - (after - floor) / (before - floor)
    below = sum(one.high < truth for one in intervals)
    above = sum(one.low > truth for one in intervals)
    return count - below - above, below, above


@pytest.mark.parametrize(
    ("aircraft", "gap", "closed"),
    [([1] * 100, 0.5, 1.0), ([1] * 100, 0.5, 0.5), ([5] * 30, 0.5, 0.8), ([1] * 60 + [5] * 10, 1.5, 0.95)],
)
def test_intervals_cover_a_known_closure(law: FlightLaw, aircraft: list[int], gap: float, closed: float) -> None:
    """If 90 % do, fewer of 40 than 29 would once in 1,000; with an end at the estimate little more than half did."""
    covered, below, above = covers(law, aircraft, gap, closed, 40)
    assert covered >= binom.ppf(0.001, 40, 0.9)
    # Nowhere do they all miss on one side.
    assert max(below, above) <= binom.isf(0.001, 40, 0.1)


@pytest.mark.parametrize("closed", [0.6, 1.0])
def test_an_interval_lies_on_both_sides(law: FlightLaw, closed: float) -> None:
    null = law.draw([1] * 100, [1] * 100, seed=5)
    apart = torch.where(null.real[:, None], 0.8 * null.scale, 0.0)
    found = measure(replace(null, y=null.y + apart)).marginal(closed * apart)
    assert found.low < found.estimate - 0.01 < found.estimate + 0.01 < found.high


def test_the_mean_gap_counts_aircraft_and_not_flights() -> None:
    """Five copies of every flight leave estimate and interval as they are."""
    sides = example_sides(EFFECTS["temperature"], [10.0], n=60)
    index = torch.arange(120).repeat_interleave(5)
    copied = replace(
        sides, y=sides.y[index], real=sides.real[index], airframe=sides.airframe[index], state=sides.state.rows(index)
    )
    found = []
    for one in (sides, copied):
        half = torch.where(one.real[:, None], 0.5 * one.y[one.real].mean(0), 0.0)
        found.append(measure(one).conditional(half))
    assert 0.5 < found[0].estimate < 1.0
    assert found[1].estimate == pytest.approx(found[0].estimate, rel=1e-9)
    assert (found[1].low, found[1].high) == (pytest.approx(found[0].low), pytest.approx(found[0].high))


def test_flights_are_corrected_by_what_other_aircraft_say() -> None:
    likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
    fit = fit_effects(likelihood, ["temperature"])
    shifts, _ = held_out_shifts(likelihood, fit)
    out = (likelihood.fold == 2) & likelihood.real
    theta = parameters_of_part(likelihood, fit, likelihood.fold != 2)
    # Without it, a wild flight would move its own correction.
    wild = likelihood.y.clone()
    wild[out] += 0.5
    other = replace(likelihood.compared, y=wild)
    again = EffectsLikelihood(other, likelihood.whitening, likelihood.catalogue, seed=0)
    torch.testing.assert_close(parameters_of_part(again, fit, again.fold != 2)["temperature"], theta["temperature"])
    expected = likelihood.shift(theta)[out]
    at = likelihood.compared.columns("tas")
    torch.testing.assert_close(shifts["temperature"][out][:, at], expected[:, at], rtol=1e-9, atol=0)
    assert not torch.equal(shifts["temperature"][out], fit.shift[out])
