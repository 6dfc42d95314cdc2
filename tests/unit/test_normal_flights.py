"""Which flights say how widely flights differ: real ones, where those of a simulator hardly do."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch

from descentflow.diagnosis.inference import spread_learnt
from descentflow.diagnosis.inference.example_sides import example_sides
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.normal_flights import is_narrow, left_between_means, normal_flights
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.spread_learnt import SpreadLearnt
from descentflow.diagnosis.inference.two_sides import Compared, Entry
from descentflow.diagnosis.inference.whitening import whiten
from descentflow.effects import EFFECTS

SLOW = -0.3
"""ln of the rate by which the table of a simulator is off at every level: no effect of the air."""


def table(n: int = 120) -> Compared:
    """A simulator whose flights scatter by a seventh of what real ones do, in air 9 K too cold, and slow."""
    sides = example_sides(EFFECTS["temperature"], [9.0], n)
    return replace(sides, y=torch.where(sides.real[:, None], sides.y + SLOW * sides.of("rate"), 0.15 * sides.y))


def kelvin(sides: Compared, learn: torch.Tensor | None) -> float:
    weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight(), learn)
    only = {"temperature": EFFECTS["temperature"]}
    return float(fit_effects(EffectsLikelihood(sides, weights, only, 0), ("temperature",)).theta["temperature"])


def test_a_table_of_rates_does_not_outweigh_the_airspeeds() -> None:
    """Rates that are 26 % slower pull the temperature by a tenth and not by half, whoever says how flights differ."""
    sides = table()
    for learn in (~sides.real, normal_flights(sides, narrow=is_narrow(sides))):
        assert kelvin(sides, learn) == pytest.approx(9.0, abs=1.2)


def test_of_few_real_flights_both_sides_say_it() -> None:
    sides = table(60)
    assert normal_flights(sides, narrow=is_narrow(sides)) is None


@pytest.mark.parametrize("effect", ["temperature", "drag_polar", "speed_schedule"])
def test_an_effect_in_the_real_flights_makes_no_simulator_narrow(effect: str) -> None:
    theta = EFFECTS[effect].start() + torch.tensor([p.scale for p in EFFECTS[effect].parameters])
    sides = example_sides(EFFECTS[effect], theta.tolist(), 120)
    wider = torch.where(sides.real[:, None] & sides.of("rate"), 3.0 * sides.y, sides.y)
    for one in (sides, replace(sides, y=wider)):
        assert not is_narrow(one)
        assert torch.equal(normal_flights(one, narrow=is_narrow(one)), ~one.real)


def test_air_and_reports_that_scatter_less_make_no_simulator_narrow() -> None:
    """A simulator in one air, whose reports have one noise, still says how crews and aircraft differ."""
    sides = example_sides(n=120)
    entries = (*sides.entries, *(Entry(f"noise_{name}", -1) for name in ("cas", "mach", "tas", "groundspeed")))
    noise = 0.1 * torch.randn(len(sides.y), 4, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    y = torch.cat([sides.y, noise], 1)
    still = torch.tensor([entry.quantity == "tas" or entry.band < 0 for entry in entries])
    one = replace(sides, entries=entries, y=torch.where(~sides.real[:, None] & still, 0.0, y))
    assert not is_narrow(one)


def test_simulators_that_scatter_alike_are_rarely_called_narrow() -> None:
    """One in 1,000 at most: more than two of 300 come once in 280 times, and these seeds are fixed."""
    called = 0
    sides = example_sides(n=40)
    for seed in range(300):
        y = torch.randn(sides.y.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
        called += is_narrow(replace(sides, y=y))
    assert called <= 2


def of_one_rate(n: int = 120) -> Compared:
    """A simulator at the speeds of the real flights, whose rates hardly differ, in air that is 9 K too cold."""
    sides = example_sides(EFFECTS["temperature"], [9.0], n)
    return replace(sides, y=torch.where(~sides.real[:, None] & sides.of("rate"), 0.2 * sides.y, sides.y))


def test_a_rate_that_no_effect_scatters_makes_a_simulator_narrow() -> None:
    """Before the fit it might be an effect that takes some flights; after it, what the fit gave each is taken off."""
    sides = of_one_rate()
    assert not is_narrow(sides)
    assert is_narrow(sides, torch.zeros_like(sides.y))
    own = torch.where(sides.real[:, None] & sides.of("rate"), 0.85 * sides.y, 0.0)
    assert not is_narrow(sides, own)


def test_means_that_agree_are_left_at_their_standard_errors() -> None:
    """The mean square of a normal number is one; of some 30 entries, which go together, within a factor of three."""
    y = torch.randn(example_sides(n=120).y.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    sides = replace(example_sides(n=120), y=y)
    assert left_between_means(sides, torch.zeros_like(y)) == pytest.approx(1.0, rel=0.6)
    apart = torch.where(sides.real[:, None], torch.full_like(y, 1.0), 0.0)
    assert left_between_means(sides, apart) > 20.0
    noise = torch.where(sides.real, 9.0, 0.0).double()[:, None]
    noisy = replace(sides, entries=(*sides.entries, Entry("noise_cas", -1)), y=torch.cat([y, noise], 1))
    zero = torch.zeros_like(noisy.y)
    assert left_between_means(noisy, zero) == pytest.approx(left_between_means(sides, zero[:, 1:]))


@pytest.mark.parametrize(("second", "taken"), [(0.9, "again"), (0.0, "first")])
def test_the_spread_that_leaves_less_between_the_means_is_taken(
    second: float, taken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fits that undo half of the difference of the means, and then more or nothing."""
    sides = of_one_rate()
    gap = torch.where(sides.real[:, None], sides.y[sides.real].nanmean(0) - sides.y[~sides.real].nanmean(0), 0.0)
    undone = iter([0.5, second])

    def ended(*_: object) -> SimpleNamespace:
        share = next(undone)
        fit, name = SimpleNamespace(shift=share * gap), "first" if share == 0.5 else "again"
        return SimpleNamespace(fit=fit, name=name, chosen=SimpleNamespace(fit=fit, name=name))

    monkeypatch.setattr(spread_learnt, "searched", ended)
    monkeypatch.setattr(spread_learnt, "select", ended)
    learnt = SpreadLearnt.of(sides, EFFECTS, seed=0)
    used, chosen = spread_learnt.select_by_either(learnt, torch.zeros(0), 0, lambda stage: None)
    assert chosen.name == taken
    assert next(undone, None) is None
    assert used.narrow is (taken == "again")
    assert (used is learnt) is (taken == "first")


def test_what_a_likelihood_forgets_it_makes_again() -> None:
    likelihood = SpreadLearnt.of(example_sides(EFFECTS["mass"], [0.2]), EFFECTS, seed=0).likelihood
    before = fit_effects(likelihood, ["mass"])
    likelihood.forget()
    assert not any(name in vars(likelihood) for name in ("sums", "single"))
    again = fit_effects(likelihood, ["mass"])
    torch.testing.assert_close(again.log_score, before.log_score, rtol=0, atol=0)
    torch.testing.assert_close(again.design.columns, before.design.columns, rtol=0, atol=0)
