"""Each flight's own air: taken off where flights measure it, left where they do not."""

from dataclasses import replace

import pytest
import torch
from flight_toys import BRAKES, steady_sides, with_own_windows
from torch import Tensor

from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.mean_air import in_mean_air
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening, whiten
from descentflow.effects import EFFECTS

WARM = EFFECTS["temperature"]
N = 200


def weights_of(sides: Compared) -> Whitening:
    learn = ~sides.real
    return whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight(), learn=learn)


def in_own_air(sides: Compared, deviation_k: Tensor) -> Compared:
    """Real flights each in air of its own (m,), by the effect's whole equation."""
    y, at = sides.y.clone(), torch.nonzero(sides.real)[:, 0]
    for flight, kelvin in zip(at.tolist(), deviation_k, strict=True):
        state = sides.state.rows(torch.tensor([flight]))
        y[flight] += sides.vector(WARM.shift(state, kelvin[None]))[0]
    return replace(sides, y=y)


def airs(mean: float, spread: float) -> Tensor:
    noise = torch.randn(N, generator=torch.Generator().manual_seed(7), dtype=torch.float64)
    return mean + spread * (noise - noise.mean())


def test_flights_are_brought_into_the_mean_air() -> None:
    """The rest of the rate and of the true airspeed is what it was in air alike for all, within the TAS's noise."""
    sides = steady_sides(N)
    alike, own = in_own_air(sides, airs(8.0, 0.0)), in_own_air(sides, airs(8.0, 4.0))
    found = in_mean_air(own, weights_of(own), EFFECTS)
    real = sides.real
    for quantity, noise in (("tas", 0.003), ("rate", 0.003)):
        at = sides.columns(quantity)
        before = (own.y - alike.y)[real][:, at].square().mean().sqrt()
        after = (found.y - alike.y)[real][:, at].square().mean().sqrt()
        # Own air is known as well as eleven reports of TAS with noise of 0.3 % that is alike for the most part say it.
        assert float(before) > 2 * noise
        assert float(after) < noise
    torch.testing.assert_close(found.y[~real], sides.y[~real])
    torch.testing.assert_close(found.y[:, sides.columns("cas")], sides.y[:, sides.columns("cas")])


@pytest.mark.parametrize("spread", [0.0, 0.2])
def test_air_that_differs_no_more_than_the_simulators_is_left(spread: float) -> None:
    """Reports of TAS that scatter by 0.3 % say nothing of 0.2 K, which are 0.04 % of the airspeed."""
    sides = in_own_air(steady_sides(N), airs(8.0, spread))
    assert in_mean_air(sides, weights_of(sides), EFFECTS) is sides


def test_what_flights_do_not_measure_is_left() -> None:
    """Without true airspeeds nothing says a flight's own air, however much it moves the rate."""
    sides = in_own_air(steady_sides(N), airs(8.0, 6.0))
    blind = sides.only(torch.nonzero(~sides.of("tas"))[:, 0])
    assert in_mean_air(blind, weights_of(blind), EFFECTS) is blind


def test_air_of_many_days_is_not_taken_for_brakes() -> None:
    """Half of the flights have brakes, all have air of their own: what is left of flights without brakes is chance."""
    sides, chosen, _ = with_own_windows(N, share=0.5, size=0.5)
    sides = in_own_air(sides, airs(8.0, 4.0))
    weights, scores = weights_of(sides), []
    for seen in (sides, in_mean_air(sides, weights, EFFECTS)):
        likelihood = EffectsLikelihood(seen, weights, EFFECTS, seed=0)
        fit = fit_effects(likelihood, ["speed_brake", "temperature"])
        scores.append(float(fit.log_score[sides.real][~chosen].mean()))
        # Four standard errors of a share of 200 flights are 0.14; those that have brakes are known nearly surely.
        assert BRAKES.size(fit.theta["speed_brake"])[0] == pytest.approx(float(chosen.double().mean()), abs=0.1)
        # The mean of TAS over 200 flights is known to 0.02 %, or 0.1 K.
        assert float(fit.theta["temperature"]) == pytest.approx(8.0, abs=0.4)
    assert scores[1] > scores[0] + 1.0
