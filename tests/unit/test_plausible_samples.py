"""Bounds, rejection with its account and budget, and samples that change no faster than flights do."""

from dataclasses import replace

import pytest
import torch
import toys
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.errors import SamplingError
from descentflow.core.units import FL_M
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.one_gaussian import one_gaussian
from descentflow.generation.rejection import sample_descents
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.representation.fit_representation import fit_representation
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.gappy import fit_components
from descentflow.representation.fpca.roughness import smoother
from descentflow.representation.linear_curves import evidence_of
from descentflow.representation.plausibility import (
    MANY,
    RULES,
    Plausibility,
    acceleration_mps2,
    expected_bounds,
    level_bounds,
    outward,
)
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Split


def acceleration_g(flights: Profiles) -> Tensor:
    """Magnitudes between neighbouring observed levels, in g."""
    tas_mps = cas_to_tas_mps(flights.cas_mps, flights.altitude_m)
    both = flights.mask[:, 1:] & flights.mask[:, :-1]
    return acceleration_mps2(tas_mps, flights.rate_mps, flights.altitude_m)[both].abs() / G0_MPS2


def rough(curves: Tensor) -> float:
    """Sum of squared second differences (n, L)."""
    return float(curves.diff(dim=1).diff(dim=1).square().sum())


@pytest.mark.parametrize("n", [5, 20, 100])
def test_extremes_are_moved_to_where_those_of_many_are_expected(n: int) -> None:
    """Means of 10,000 extremes have a standard error below 0.7 %; Blom's formula is off by 1 % for five values."""
    generator = torch.Generator().manual_seed(0)
    few, many = (
        torch.cat([torch.randn(500, size, generator=generator).amax(1) for _ in range(20)]).mean() for size in (n, MANY)
    )
    assert float(outward(torch.tensor(n))) == pytest.approx(float(many / few), rel=0.025)


def test_bounds_of_many_flights_are_the_papers() -> None:
    values, mask = torch.randn(MANY, 3, dtype=torch.float64), torch.ones(MANY, 3, dtype=torch.bool)
    for ours, theirs in zip(expected_bounds(values, mask), level_bounds(values, mask), strict=True):
        torch.testing.assert_close(ours, theirs)
    low, high = expected_bounds(values[:20], mask[:20])
    narrow, wide = level_bounds(values[:20], mask[:20])
    assert bool((low < narrow).all())
    assert bool((high > wide).all())


@pytest.mark.parametrize("n", [14, 36])
def test_a_perfect_density_of_few_flights_is_mostly_inside(n: int) -> None:
    """Bounds of each level for itself have a fifth of the draws outside, of flights that vary every twenty levels."""
    generator = torch.Generator().manual_seed(0)
    place = torch.arange(200, dtype=torch.float64)
    modes = torch.exp(-0.5 * ((place - torch.arange(0, 201, 10)[:, None]) / 10) ** 2)
    modes /= modes.square().sum(0).sqrt()

    def flights(number: int) -> torch.Tensor:
        return torch.randn(number, len(modes), generator=generator, dtype=torch.float64) @ modes

    outside = []
    for _ in range(20):
        low, high = expected_bounds(flights(n), torch.ones(n, 200, dtype=torch.bool), margin=0.0)
        draws = flights(1000)
        outside.append(float(((draws < low) | (draws > high)).any(1).double().mean()))
    assert sum(outside) / 20 < 0.1


def test_a_smooth_curve_is_the_least_of_misfit_and_roughness() -> None:
    """The gradient of the penalised sum of squares vanishes, by autograd."""
    generator = torch.Generator().manual_seed(0)
    counts = torch.randint(1, 9, (30,), generator=generator).double()
    curve = torch.randn(30, generator=generator, dtype=torch.float64)
    smooth = (smoother(counts, 50.0) @ curve).requires_grad_()
    loss = (counts * (smooth - curve).square()).sum() + 50.0 * smooth.diff().diff().square().sum()
    (gradient,) = torch.autograd.grad(loss, smooth)
    assert float(gradient.abs().max()) < 1e-9


def test_few_gappy_flights_have_smooth_components_and_many_keep_theirs() -> None:
    for n, least, most in ((24, 0.0, 0.01), (1500, 0.8, 1.0)):
        flights = toys.flights(n)
        observed = ppca.observed_mean(flights.cas_mps, flights.mask)
        centred = torch.where(flights.mask, flights.cas_mps - observed, 0.0)
        plain = ppca.em(centred, flights.mask, min(16, n - 1), max_iterations=100, tolerance=1e-5)
        ours = fit_components(flights.cas_mps, flights.mask, FL_M)
        # Where Mach hands over to CAS the mean bends: that of many flights still does.
        assert least <= rough(ours.mean[None]) / rough((observed + plain.shift)[None]) <= most


@pytest.mark.parametrize(
    ("name", "rule"), [("tas_mps", "speed_changes_too_fast"), ("rate_mps", "rate_changes_too_fast")]
)
def test_a_step_between_two_levels_breaks_its_rule(name: str, rule: str) -> None:
    """At the entry no level above is judged; one below it, the step is seen from both sides."""
    flights = toys.flights(400)
    parts = fit_representation(flights, toys.AIRCRAFT, Split(flights.flight_ids, (), ()))
    flown = parts.decoder(torch.zeros(1, parts.decoder.dimension, dtype=torch.float64), torch.tensor([50]))
    at = RULES.index(rule)
    assert not bool(parts.plausibility.broken_rules(flown)[0, at])
    for level, broken in ((51, False), (50, True), (20, True)):
        values = getattr(flown, name).clone()
        values[0, level] *= 1.5
        assert bool(parts.plausibility.broken_rules(replace(flown, **{name: values}))[0, at]) is broken


@pytest.mark.parametrize(("n", "seed"), [(20, 3), (50, 0)])
def test_samples_of_few_flights_can_be_flown(n: int, seed: int) -> None:
    """None beyond one and a half times what all but one in a thousand changes of 600 flights stay below."""
    limit = 1.5 * float(acceleration_g(toys.flights(600, seed=1)).quantile(0.999))
    train = toys.flights(n, seed)
    parts = fit_representation(train, toys.AIRCRAFT, Split(train.flight_ids, (), ()))
    density = GaussianMixtureDensity(parts.decoder.dimension, 1)
    density.mixture = one_gaussian(evidence_of(parts.decoder, train))
    samples = sample_descents(density, parts, 1000, seed=0)
    flown = samples.trajectories
    change = acceleration_mps2(flown.tas_mps, flown.rate_mps, flown.levels_fl * FL_M).abs() / G0_MPS2
    assert float(change[flown.mask[:, 1:]].max()) < limit
    # The goal is a tenth rejected. Toy flights bend sharply where they hand over from Mach to CAS, and deviations of
    # CAS that follow such bends are often too fast.
    assert samples.report.acceptance > 0.75


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
