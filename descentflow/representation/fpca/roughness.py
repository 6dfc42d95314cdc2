r"""A prior against rough mean and components, for flights that are few.

Probabilistic PCA takes every level for itself. Where few flights show a level, its mean and loadings are those of other
flights than one level below, and what is flown with them changes speed faster than any flight does. The prior of a
curve f over the levels is that of a smoothing spline, $p(f) \propto \exp(-\lambda \sum_l (\Delta^2 f_l)^2 / 2)$, and
each level counts as many times as flights show it (Whittaker 1923; Green and Silverman 1994, chapter 2). The weight
$\lambda$ is learnt, see :mod:`~descentflow.representation.fpca.judged_by_others`.
"""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.representation.fpca.ppca import PPCA, noise_given_loadings

SPREAD_WEIGHT = 1e5
"""Of the prior for how far flights spread at each level, in flights: some 20 levels for 2,000 of them."""
NO_FLIGHT = 1e-3
"""Weight of a level without a flight: its neighbours interpolate it."""


def smoother(counts: Tensor, weight: float) -> Tensor:
    """Matrix (L, L) that takes a curve to its most probable smooth one.

    Args:
        counts: (L,) flights that show each level.
        weight: Of the prior, in flights.

    Example:
        >>> line = torch.arange(5).double()
        >>> torch.allclose(smoother(torch.ones(5).double(), 1e6) @ line, line)  # straight lines are not rough
        True
    """
    bend = torch.eye(len(counts), dtype=counts.dtype, device=counts.device).diff(dim=0).diff(dim=0)
    shown = torch.diag(counts.clamp(min=NO_FLIGHT))
    matrix: Tensor = torch.linalg.solve(shown + weight * bend.T @ bend, shown)
    return matrix


def smoothed(fitted: PPCA, weight: float, centred: Tensor, mask: Tensor, mean: Tensor) -> PPCA:
    """A model with mean and loadings smoothed, and the noise that is then left.

    Args:
        fitted: To flights from which ``mean`` was taken.
        weight: Of the prior, in flights; zero leaves the model as it is.
        centred: (n, L) those flights, zero where missing.
        mask: (n, L) observed.
        mean: (L,) in the units of the model.

    Example:
        >>> curves = torch.randn(50, 1).double() * torch.tensor([0.0, 1.0, 0.0, 1.0]).double()
        >>> rough = PPCA(torch.tensor([[0.0], [1.0], [0.0], [1.0]]).double(), torch.tensor(1e-6).double(),
        ...              torch.zeros(4).double(), [], converged=True)
        >>> smooth = smoothed(rough, 1e9, curves, torch.ones(50, 4, dtype=torch.bool), torch.zeros(4).double())
        >>> smooth.loadings.flatten().diff().round(decimals=3)  # a line
        tensor([0.2000, 0.2000, 0.2000], dtype=torch.float64)
        >>> bool(smooth.noise_variance > 0.1)
        True
    """
    if weight == 0:
        return fitted
    matrix = smoother(mask.sum(0).to(centred.dtype), weight)
    loadings, shift = matrix @ fitted.loadings, matrix @ (mean + fitted.shift) - mean
    shown = torch.where(mask, centred - shift, 0.0)
    noise = noise_given_loadings(shown, mask, loadings, fitted.noise_variance)
    return replace(fitted, loadings=loadings, shift=shift, noise_variance=noise)
