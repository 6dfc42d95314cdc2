"""Levels hidden from gappy functional PCA: how they are chosen, what they tell, and which method fills them best."""

import torch
from torch import Tensor

from descentflow.representation.fpca.gappy import fit_components


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
