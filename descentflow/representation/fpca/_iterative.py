"""The paper's own algorithm for gappy functional PCA (appendix A), its inner optimisation in closed form.

The paper finds the weights of a flight mode by mode with sequential quadratic programming; each of those
problems is a least-squares problem in one unknown, whose minimum is ``(phi . M y) / (phi . M phi)`` with M the
flight's mask and y the residual of the earlier modes.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.representation.fpca.basis import explained_share, modewise_weights, number_of_components
from descentflow.representation.fpca.ppca import observed_mean, pairwise_covariance

QUIET_CHANGE = 0.01
QUIET_ITERATIONS = 10
"""The paper stops after 10 iterations in which the mean reconstruction changes by less than 1 %. Here the covariance
must have settled as well: the mean does so while the weights of flights with large gaps, which few levels determine,
make the covariance of the completed profiles grow with every iteration."""
MAX_ITERATIONS = 50
"""The paper's bound."""
MAX_GROWTH = 1.2
"""Growth from which on the user is warned: without gaps it is 1, of simulated CAS 0.99, of simulated drag, of which one
component is then left instead of five, 1.4 (E190) and 2.8 (B738)."""


@dataclass(frozen=True)
class IterativeFit:
    """Eigenvectors (L, L) as columns and eigenvalues (L,), largest first, of the completed data; its mean (L,).

    ``growth``: total variance of the completed data over that of the observed values. :func:`iterate` returns it.

    Example:
        >>> curves = torch.randn(30, 1).double() * torch.linspace(0, 1, 50).double()
        >>> fitted = iterate(curves, torch.ones(30, 50, dtype=torch.bool), 0.9)
        >>> float(fitted.eigenvalues[0] / fitted.eigenvalues.sum()) > 0.999  # one mode explains all
        True
    """

    mean: Tensor
    eigenvalues: Tensor
    eigenvectors: Tensor
    n_iterations: int
    converged: bool
    growth: float


def iterate(values: Tensor, mask: Tensor, explained_variance: float) -> IterativeFit:
    """Fill the gaps by reconstruction until its mean and covariance settle (appendix A, steps 1-5).

    Args:
        values: (n, L) float64.
        mask: (n, L) observed.
        explained_variance: Share of variance whose modes rebuild the missing levels.

    Example:
        >>> shape = torch.linspace(0, 1, 50).double()
        >>> curves = torch.randn(30, 1).double() * shape + torch.randn(30, 1).double() * shape**2
        >>> mask = torch.ones(30, 50, dtype=torch.bool)
        >>> mask[:10, 40:] = False  # ten flights lack the upper levels
        >>> fitted = iterate(curves, mask, 0.9)
        >>> fitted.converged, fitted.eigenvectors.shape, fitted.growth < 1.1
        (True, torch.Size([50, 50]), True)
    """
    mean = observed_mean(values, mask)
    centred = torch.where(mask, values - mean, 0.0)
    covariance = pairwise_covariance(centred, mask)
    previous, quiet, n_iterations, observed = mean, 0, 0, covariance.trace()
    while n_iterations < MAX_ITERATIONS and quiet < QUIET_ITERATIONS:
        n_iterations += 1
        eigenvalues, eigenvectors = _eigen(covariance)
        k = number_of_components(explained_share(eigenvalues), explained_variance)
        rebuilt = mean + modewise_weights(values - mean, mask, eigenvectors[:, :k]) @ eigenvectors[:, :k].T
        filled = torch.where(mask, values, rebuilt)
        mean, before, covariance = filled.mean(0), covariance, torch.cov(filled.T)
        average = rebuilt.mean(0)
        changes = [_change(average, previous), _change(covariance, before)]
        previous, quiet = average, quiet + 1 if max(changes) < QUIET_CHANGE else 0
    eigenvalues, eigenvectors = _eigen(covariance)
    growth = float(covariance.trace() / observed)
    return IterativeFit(mean, eigenvalues, eigenvectors, n_iterations, quiet == QUIET_ITERATIONS, growth)


def _change(now: Tensor, before: Tensor) -> float:
    """Relative change of a vector or a matrix."""
    return float((now - before).norm() / now.norm().clamp(min=1e-300))


def _eigen(covariance: Tensor) -> tuple[Tensor, Tensor]:
    eigenvalues, eigenvectors = torch.linalg.eigh(covariance)
    return eigenvalues.flip(0), eigenvectors.flip(1)
