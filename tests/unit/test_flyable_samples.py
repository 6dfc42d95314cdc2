"""Samples change speed and drag from level to level no faster than flights do, with few training flights too."""

from dataclasses import replace

import pytest
import torch
import toys
from torch import Tensor

from descentflow.core.constants import G0_MPS2
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
