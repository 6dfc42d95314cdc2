"""Residual of the components: numbers given gaps, lines in closed form, and samples that have it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import toys
from scipy.spatial import cKDTree
from scipy.stats import chisquare
from torch import Tensor
from toys import normal

from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.generation.rejection import sample_descents
from descentflow.representation.fit_representation import RepresentationSettings, fit_representation, fit_residuals
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation, Split
from descentflow.representation.residuals import NEIGHBOURS, ResidualLine, Residuals

D, R, M = 3, 4, 200


def residuals(entry: Tensor) -> Residuals:
    """M flights, each with numbers of its own: its position in the first."""
    numbers = normal(M, R, seed=1)
    numbers[:, 0] = torch.arange(M)
    return Residuals(normal(2, 10), normal(2, 10), normal(M, D), numbers, entry)


def test_numbers_are_those_of_the_nearest_flights_as_scipy_finds_them() -> None:
    held, weights = residuals(torch.zeros(M)), normal(3000, D, seed=2)
    uniform = torch.rand(3000, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    numbers = held.draw(weights, torch.zeros(3000), uniform)
    _, near = cKDTree(held.weights.numpy()).query(weights.numpy(), NEIGHBOURS)
    rank = (near == numbers[:, :1].numpy()).argmax(1)
    np.testing.assert_array_equal(near[np.arange(3000), rank], numbers[:, 0].numpy())
    np.testing.assert_array_equal(rank, (uniform * NEIGHBOURS).long().numpy())
    assert torch.equal(held.draw(weights[7:8], torch.zeros(1), uniform[7:8]), numbers[7:8]), "alone as among others"


def test_a_known_line_is_found_again() -> None:
    """Of 20,000 flights a slope is known to 0.7 % of the spread; five standard errors, of R (D + 2) numbers."""
    line, weights = (
        ResidualLine(normal(R), normal(R, D), torch.tensor([0.3, 0.5, 1.0, 2.0]).double()),
        normal(20_000, D),
    )
    numbers = line.offset + weights @ line.slope.T + line.spread * normal(20_000, R, seed=1)
    found = ResidualLine.fitted(weights, numbers)
    for mine, known in zip(vars(found).values(), vars(line).values(), strict=True):
        assert float((mine - known).abs().max()) < 5 * 2.0 / 20_000**0.5


def test_a_sample_has_the_residual_of_a_training_flight() -> None:
    parts = toys.representation(300)
    model = GaussianDensity(parts.decoder.dimension)
    model.attach(parts)
    samples, held = sample_descents(model, parts, 500, 0), parts.decoder.residuals
    _, cas = parts.decoder.scaled_profiles(samples.weights)
    left = samples.trajectories.cas_mps[:, 0] - cas[:, 0]
    speed = held.numbers[:, len(held.drag) :] @ held.speed[:, 0]
    off = (left[:, None] - speed).abs()
    assert float(off.amin(1).max()) < 1e-9
    assert len(off.argmin(1).unique()) > 100


def test_components_that_leave_nothing_out_have_no_residual_of_their_profile() -> None:
    parts = toys.representation(300)
    drag = parts.decoder.drag_basis
    drag.loadings = drag.loadings @ torch.linalg.svd(drag.loadings, full_matrices=False)[2][: drag.n_components].T
    residuals_left = fit_residuals(parts.decoder, toys.flights(300))
    assert len(residuals_left.drag) == 0 < len(residuals_left.speed)
    assert residuals_left.draw(torch.zeros(4, parts.decoder.dimension), torch.zeros(4), torch.rand(4)).shape[1] == len(
        residuals_left.speed
    )


PARTS = toys.representation(400)
DIMENSION = PARTS.decoder.dimension


def mixture(far: float, scale: float = 0.1) -> GaussianMixtureDensity:
    """Two components on both sides of the mean flight, ``far`` from it in the first weight."""
    density = GaussianMixtureDensity(DIMENSION, 2)
    locs = torch.zeros(2, DIMENSION, dtype=torch.float64)
    locs[:, 0] = torch.tensor([-1.0, far])
    trils = scale * torch.eye(DIMENSION, dtype=torch.float64).expand(2, DIMENSION, DIMENSION)
    density.mixture = Mixture(torch.tensor([0.5, 0.5]).double(), locs, trils)
    return density


def test_entry_levels_are_as_frequent_as_among_the_flights_whatever_is_rejected() -> None:
    """Chi-square over four bins; p < 1e-4 fails one right sampler in 10,000."""
    samples = sample_descents(mixture(4.0, 1.0), PARTS, 4000, 0)
    counts = PARTS.plausibility.entry_counts.double()
    edges = torch.tensor([130, 160, 200])
    bins = torch.bucketize(torch.arange(len(counts)), edges)
    expected = torch.zeros(4, dtype=torch.float64).index_add(0, bins, counts) / counts.sum() * 4000
    drawn = torch.bincount(torch.bucketize(samples.trajectories.entry, edges), minlength=4).double()
    seen = expected > 0
    assert chisquare(drawn[seen].numpy(), expected[seen].numpy()).pvalue > 1e-4


def with_residual() -> tuple[Representation, Profiles]:
    """A representation of flights with drag and CAS beyond the kept components, and the flights."""
    flights = toys.flights(600, gappy=False)
    generator = torch.Generator().manual_seed(0)
    x = torch.linspace(0, 1, len(flights.levels_fl), dtype=torch.float64)
    extra = 600 * torch.randn(600, 1, generator=generator).double() * torch.sin(40 * x)
    faster = 4 * torch.randn(600, 1, generator=generator).double() * torch.sin(15 * x)
    flights = replace(flights, drag_n=flights.drag_n + extra, cas_mps=flights.cas_mps + faster)
    parts = fit_representation(flights, toys.AIRCRAFT, Split(flights.flight_ids, (), ()))
    return parts, flights


@pytest.mark.parametrize("name", ["drag", "CAS"])
def test_samples_have_the_spread_that_components_leave_out(name: str) -> None:
    """Standard deviations of 600 flights are known to 3 %."""
    parts, flights = with_residual()
    decoder = parts.decoder
    of_drag, of_cas = decoder.weight_scale.split([basis.n_components for basis in decoder.bases.values()])
    residual, scale = (decoder.residuals.drag, of_drag) if name == "drag" else (decoder.residuals.speed, of_cas)
    drag, cas = decoder.drag_scale.observed(flights).values
    spread = (drag if name == "drag" else cas).std(0)
    assert len(residual) >= 1
    kept = decoder.bases[name].components.T @ torch.diag(scale)
    total = (kept.square().sum(1) + residual.square().sum(0)).sqrt()
    assert float((total / spread - 1).abs().mean()) < 0.03
    assert float((kept.square().sum(1).sqrt() / spread).mean()) < 0.95
    n, generator = decoder.residuals.n_numbers, torch.Generator().manual_seed(1)
    white = torch.randn(4000, n, generator=generator, dtype=torch.float64)
    flown = decoder(torch.zeros(4000, decoder.dimension, dtype=torch.float64), residual=white)
    sd = (decoder.drag_scale.scaled(flown.drag_n, flown.cas_mps) if name == "drag" else flown.cas_mps).std(0)
    torch.testing.assert_close(sd, residual.square().sum(0).sqrt(), rtol=0.06, atol=1.0 if name == "drag" else 0.01)


def test_the_residual_is_an_option() -> None:
    flights = toys.flights(200)
    split = Split(flights.flight_ids, (), ())
    bare = fit_representation(flights, toys.AIRCRAFT, split, RepresentationSettings(residual=False)).decoder
    assert bare.residuals.n_numbers == 0
    assert bare.residuals.draw(torch.zeros(3, bare.dimension), torch.zeros(3), torch.zeros(3)).shape == (3, 0)
    whole = fit_representation(flights, toys.AIRCRAFT, split).decoder
    assert torch.equal(fit_residuals(bare, flights).drag, whole.residuals.drag)


def test_the_residual_is_no_wider_than_what_flights_show() -> None:
    """A model of ten times the spread, as it may where few flights show a level."""
    parts, _ = with_residual()
    flights = toys.flights(600, gappy=False)
    before = fit_residuals(parts.decoder, flights).drag.square().sum(0).sqrt()
    parts.decoder.drag_basis.loadings.mul_(10)
    after = fit_residuals(parts.decoder, flights).drag.square().sum(0).sqrt()
    assert float((after / before.clamp(min=1.0)).max()) < 2
