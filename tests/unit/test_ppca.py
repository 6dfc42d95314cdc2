"""Probabilistic PCA of many flights, and levels hidden from it by what they tell."""

import pytest
import torch
from torch import Tensor

from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.gappy import fit_components


def gappy_curves(n: int, n_levels: int, q: int) -> tuple[Tensor, Tensor]:
    """Curves of smooth components whose tops are missing, zero there."""
    generator = torch.Generator().manual_seed(0)
    place = torch.linspace(0, 1, n_levels, dtype=torch.float64)
    modes = torch.stack([torch.cos(torch.pi * k * place) / k for k in range(1, q + 1)])
    curves = torch.randn(n, q, generator=generator, dtype=torch.float64) @ modes
    curves += 0.05 * torch.randn(n, n_levels, generator=generator, dtype=torch.float64)
    seen = torch.arange(n_levels) <= torch.randint(n_levels // 2, n_levels, (n, 1), generator=generator)
    return torch.where(seen, curves, 0.0), seen


def test_some_of_many_flights_say_where_to_start(monkeypatch: pytest.MonkeyPatch) -> None:
    centred, mask = gappy_curves(900, 40, 4)
    plain = ppca.em(centred, mask, 4, max_iterations=100, tolerance=1e-5)
    monkeypatch.setattr(ppca, "FIRST_FLIGHTS", 200)
    started = ppca.em(centred, mask, 4, max_iterations=100, tolerance=1e-5)
    # Of what one component less would cost, some 0.1, a hundredth.
    assert started.log_likelihood[-1] == pytest.approx(plain.log_likelihood[-1], abs=1e-3)
    assert started.log_likelihood[0] > plain.log_likelihood[0]
    assert len(started.log_likelihood) < len(plain.log_likelihood)


def test_a_level_that_no_flight_shows_has_no_loadings_and_changes_no_other() -> None:
    """Of fifteen real flights a level was shown by one alone; dealt into three parts, one part did not have it."""
    generator = torch.Generator().manual_seed(5)
    values = torch.randn(12, 2, generator=generator).double() @ torch.randn(2, 20, generator=generator).double()
    values += 0.1 * torch.randn(12, 20, generator=generator).double()
    mask = torch.rand(12, 20, generator=generator) < 0.8
    mask[:, 7] = False
    centred = torch.where(mask, values, 0.0)
    others = torch.arange(20) != 7
    model = ppca.em(centred, mask, 2, max_iterations=3000, tolerance=1e-13)
    without = ppca.em(centred[:, others], mask[:, others], 2, max_iterations=3000, tolerance=1e-13)
    assert torch.equal(model.loadings[7], torch.zeros(2, dtype=torch.float64))
    product, same = model.loadings[others], without.loadings
    torch.testing.assert_close(product @ product.T, same @ same.T, rtol=1e-3, atol=1e-3)
    torch.testing.assert_close(model.noise_variance, without.noise_variance, rtol=1e-3, atol=0)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def smooth_and_noise(n: int, length: int) -> Tensor:
    """Two smooth components and noise that is alike over some levels."""
    x = torch.linspace(0, 1, 120, dtype=torch.float64)
    weights = torch.randn(n, 2, generator=generator(1), dtype=torch.float64)
    noise = torch.randn(n, 120 // length, generator=generator(2), dtype=torch.float64).repeat_interleave(length, 1)
    return weights[:, :1] * torch.cos(3 * x) + 0.5 * weights[:, 1:] * torch.sin(5 * x) + 0.3 * noise


def test_white_noise_counts_level_by_level_and_smooth_noise_does_not() -> None:
    """White noise of a model with as many components as there are: no length above 3 can help it."""
    mask = torch.ones(400, 120, dtype=torch.bool)
    white = fit_components(smooth_and_noise(400, 1), mask, 30.0, 0.5, latent_dimension=2)
    smooth = fit_components(smooth_and_noise(400, 20), mask, 30.0, 0.5, latent_dimension=2)
    assert float(white.noise_length) <= 3
    assert float(smooth.noise_length) >= 10
