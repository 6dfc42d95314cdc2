"""One step of expectation maximisation for Gaussian components.

The log density of a Gaussian is linear in the quadratic features ``(x x', x, 1)``, so the E step and the M step are one
matrix product each. All of it runs in float64: in float32 the covariances stop being positive definite.
"""

from math import log, pi

import torch
from torch import Tensor

from descentflow.densities.em_steps import Steps, evenly
from descentflow.densities.mixture_parameters import Mixture

JITTER = 1e-6
"""Added to the variances, as scikit-learn's ``reg_covar``."""


class GaussianSteps(Steps):
    """The steps of a mixture without a context (paper, appendix C), of flights whose weights are known.

    Example:
        >>> steps = GaussianSteps(torch.tensor([[0.0], [1.0], [10.0], [11.0]]))
        >>> steps.maximise(torch.tensor([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]).double()).locs.tolist()
        [[0.5], [10.5]]
    """

    def __init__(self, weights: Tensor, prior_flights: float = 0.0) -> None:
        """Take the training flights' weights (n, d), and how many flights covariances are shrunk by."""
        self.weights, self.prior_flights = weights.to(torch.float64), prior_flights
        self.features = quadratic_features(self.weights)

    def some(self, most: int) -> Steps:
        """The steps of at most so many of the flights, evenly chosen."""
        n = len(self.weights)
        if n <= most:
            return self
        return GaussianSteps(self.weights[evenly(n, most)], self.prior_flights).crossed(self.clusters)

    def points_to_group(self, seed: int) -> Tensor:
        """Points (n, d) for the start by k-means: the weights."""
        return self.weights

    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times density (n, k) of each flight and mixture component, in nats."""
        d = mixture.locs.shape[1]
        precision = torch.cholesky_inverse(mixture.scale_trils)
        linear = (precision @ mixture.locs[:, :, None])[:, :, 0]
        constant = (
            mixture.probs.log()
            - 0.5 * (linear * mixture.locs).sum(1)
            - mixture.scale_trils.diagonal(dim1=1, dim2=2).log().sum(1)
            - 0.5 * d * log(2 * pi)
        )
        return self.features @ torch.cat([-0.5 * precision.flatten(1), linear, constant[:, None]], 1).T

    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """The mixture that maximises the expected log-likelihood under responsibilities (n, k)."""
        d = self.weights.shape[1]
        moments = responsibilities.T @ self.features
        count = moments[:, -1].clamp(min=1e-9)
        locs = moments[:, -1 - d : -1] / count[:, None]
        second = moments[:, : d * d].reshape(-1, d, d) / count[:, None, None]
        locs, own = self.tied(count, locs, second - locs[:, :, None] * locs[:, None, :])
        return Mixture(count / count.sum(), locs, cholesky_or_small(own, JITTER))


def quadratic_features(weights: Tensor) -> Tensor:
    """(n, d d + d + 1) features ``x x'``, ``x`` and 1 of weights (n, d).

    Example:
        >>> quadratic_features(torch.tensor([[2.0, 3.0]])).tolist()
        [[4.0, 6.0, 6.0, 9.0, 2.0, 3.0, 1.0]]
    """
    outer = (weights[:, :, None] * weights[:, None, :]).flatten(1)
    return torch.cat([outer, weights, torch.ones_like(weights[:, :1])], 1)


def cholesky_or_small(covariance: Tensor, jitter: float) -> Tensor:
    """Lower Cholesky factors (..., d, d) of covariances whose variances are raised by ``jitter``.

    A mixture component that has lost its flights becomes round and small instead of stopping the fit.

    Example:
        >>> cholesky_or_small(torch.full((1, 1), -4.0), jitter=0.25)
        tensor([[0.5000]])
    """
    eye = torch.eye(covariance.shape[-1], dtype=covariance.dtype, device=covariance.device)
    factor, failed = torch.linalg.cholesky_ex(covariance + jitter * eye)
    return torch.where(failed[..., None, None] > 0, jitter**0.5 * eye, factor)
