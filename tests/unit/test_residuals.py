"""Residual of the components: neighbours by SciPy, the line by closed forms, numbers given gaps."""

import numpy as np
import torch
import toys
from scipy.spatial import cKDTree
from torch import Tensor
from toys import normal

from descentflow.densities.gaussian import GaussianDensity
from descentflow.generation.rejection import sample_descents
from descentflow.representation.fit_representation import fit_residuals
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
    found = held.draw(weights, torch.zeros(3000), uniform)
    _, near = cKDTree(held.weights.numpy()).query(weights.numpy(), NEIGHBOURS)
    rank = (near == found[:, :1].numpy()).argmax(1)
    np.testing.assert_array_equal(near[np.arange(3000), rank], found[:, 0].numpy())
    np.testing.assert_array_equal(rank, (uniform * NEIGHBOURS).long().numpy())
    assert torch.equal(held.draw(weights[7:8], torch.zeros(1), uniform[7:8]), found[7:8]), "alone as among others"


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
    found, held = sample_descents(model, parts, 500, 0), parts.decoder.residuals
    _, cas = parts.decoder.scaled_profiles(found.weights)
    left, speed = found.trajectories.cas_mps[:, 0] - cas[:, 0], held.curves(held.numbers)[1][:, 0]
    off = (left[:, None] - speed).abs()
    assert float(off.amin(1).max()) < 1e-9
    assert len(off.argmin(1).unique()) > 100


def test_components_that_leave_nothing_out_have_no_residual_of_their_profile() -> None:
    parts = toys.representation(300)
    drag = parts.decoder.drag_basis
    drag.loadings = drag.loadings @ torch.linalg.svd(drag.loadings, full_matrices=False)[2][: drag.n_components].T
    found = fit_residuals(parts.decoder, toys.flights(300))
    assert len(found.drag) == 0 < len(found.speed)
    assert found.draw(torch.zeros(4, parts.decoder.dimension), torch.zeros(4), torch.rand(4)).shape[1] == len(
        found.speed
    )
