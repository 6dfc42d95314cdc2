"""Bounds, rejection, its accounting and its budget."""

import pytest
import torch
import toys
from torch import Tensor

from descentflow.core.errors import SamplingError
from descentflow.generation.rejection import sample_descents
from descentflow.representation.plausibility import RULES, Plausibility, level_bounds


class Normal:
    """Standard normal weights: what a perfect whitening would leave; ``spread`` makes many of them implausible."""

    def __init__(self, dimension: int, spread: float = 1.0, poison: float = 0.0) -> None:
        self.dimension, self.spread, self.poison = dimension, spread, poison

    def sample(self, n: int, seed: int, context: Tensor) -> Tensor:
        generator = torch.Generator().manual_seed(seed)
        weights = self.spread * torch.randn(n, self.dimension, generator=generator, dtype=torch.float64)
        weights[torch.rand(n, generator=generator) < self.poison] = torch.nan
        return weights


PARTS = toys.representation(400)


def draw(n: int = 500, seed: int = 0, spread: float = 1.0, poison: float = 0.0, **settings: object) -> object:
    sampler = Normal(PARTS.decoder.dimension, spread, poison)
    return sample_descents(sampler, PARTS, n, seed, **settings)


def test_bounds_move_outward_even_at_negative_extremes() -> None:
    values = torch.tensor([[-10.0, 4.0, -8.0], [20.0, 2.0, -2.0], [99.0, 99.0, 99.0]])
    mask = torch.tensor([[True] * 3, [True] * 3, [False] * 3])
    low, high = level_bounds(values, mask)
    torch.testing.assert_close(low, torch.tensor([-10.5, 1.9, -8.4]))
    torch.testing.assert_close(high, torch.tensor([21.0, 4.2, -1.9]))


@pytest.mark.parametrize("spread", [1.0, 2.5])
def test_samples_keep_the_bounds_and_descend(spread: float) -> None:
    flown = draw(spread=spread).trajectories
    mask, bounds = flown.mask, PARTS.plausibility
    for values, low, high in (
        (flown.drag_n, bounds.drag_low, bounds.drag_high),
        (flown.cas_mps, bounds.cas_low, bounds.cas_high),
    ):
        assert bool(((values >= low) & (values <= high))[mask].all())
    assert bool((flown.rate_mps[mask] < 0).all())
    later = flown.time_s[:, :-1] - flown.time_s[:, 1:]
    assert bool((later[mask[:, 1:]] > 0).all()), "time grows downwards"


def test_every_draw_is_accounted_for() -> None:
    report = draw(spread=2.0, poison=0.1).report
    assert report.drawn == report.accepted + report.surplus + report.rejected
    assert report.accepted == 500
    assert set(report.broken) == set(RULES)
    assert report.broken["not_finite"] > 0
    assert sum(report.broken.values()) >= report.rejected > 0
    assert 0 < report.acceptance < 1
    assert "not_finite" in str(report)


def test_a_spent_budget_names_the_rules() -> None:
    with pytest.raises(SamplingError, match=r"drag_(below|above)_bound.*raise the draw budget"):
        draw(n=1000, spread=30.0, draw_budget=2000)


def test_each_rule_finds_its_own_violation() -> None:
    base = toys.flights(40, gappy=False)
    bounds = Plausibility.from_profiles(base)
    flown = PARTS.decoder(torch.zeros(1, PARTS.decoder.dimension, dtype=torch.float64))
    cases = {
        "not_finite": {"drag_n": torch.nan},
        "drag_below_bound": {"drag_n": -1e9},
        "drag_above_bound": {"drag_n": 1e9},
        "cas_below_bound": {"cas_mps": 1.0},
        "cas_above_bound": {"cas_mps": 900.0},
        "descends_too_slowly": {"rate_mps": 0.0},
    }
    from dataclasses import replace

    for rule, change in cases.items():
        (name, value), low_level = next(iter(change.items())), 5
        values = getattr(flown, name).clone()
        values[0, low_level] = value
        broken = bounds.broken_rules(replace(flown, **{name: values}))[0]
        assert bool(broken[RULES.index(rule)]), rule


def test_levels_above_the_entry_are_not_judged() -> None:
    bounds = Plausibility.from_profiles(toys.flights(40, gappy=False))
    flown = PARTS.decoder(torch.zeros(1, PARTS.decoder.dimension, dtype=torch.float64), entry=torch.tensor([50]))
    before = bounds.broken_rules(flown)
    flown.drag_n[0, 60] = 1e9
    assert torch.equal(bounds.broken_rules(flown), before)


def test_rare_samples_cost_what_their_acceptance_says() -> None:
    """Of two samples one draw in 500 is plausible: some thousand draws, in a dozen rounds and not in hundreds."""
    sampler, rounds = Normal(PARTS.decoder.dimension, poison=0.998), []
    sample = sampler.sample
    sampler.sample = lambda n, *others: (rounds.append(n), sample(n, *others))[1]
    report = sample_descents(sampler, PARTS, 2, 0, draw_budget=100_000).report
    assert len(rounds) < 20
    assert report.drawn == sum(rounds) < 20_000  # of right samplers one in a million needs more
