"""Interface of expectation maximisation to the flights and to the kind of mixture component."""

from abc import ABC, abstractmethod
from math import log, pi

import torch
from torch import Tensor

from descentflow.densities.mixture_parameters import Mixture


class Steps(ABC):
    """The steps of EM for one set of flights.

    Example:
        >>> from descentflow.densities.em_steps import GaussianSteps
        >>> steps: Steps = GaussianSteps(torch.randn(100, 2).double())
        >>> one = steps.maximise(torch.ones(100, 1).double())  # all flights in one mixture component
        >>> steps.log_joint(one).shape, steps.improve(one)[0].locs.shape
        (torch.Size([100, 1]), torch.Size([1, 2]))
    """

    prior_flights: float
    """Flights by which covariances are shrunk."""

    @abstractmethod
    def points_to_group(self, seed: int) -> Tensor:
        """Points (n, d) for the start by k-means."""

    @abstractmethod
    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times density (n, k) of each flight and mixture component, in nats."""

    @abstractmethod
    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """The M step, from the mixture before it where it is no closed form."""

    @abstractmethod
    def some(self, most: int) -> "Steps":
        """The steps of at most so many of the flights, evenly chosen; these themselves if there are no more."""

    def expectation(self, mixture: Mixture) -> tuple[Tensor, Tensor]:
        """The E step: responsibilities (n, k) and the mean log-likelihood (nats per flight)."""
        joint = self.log_joint(mixture)
        total = joint.logsumexp(1)
        return (joint - total[:, None]).exp(), total.mean()

    def improve(self, mixture: Mixture) -> tuple[Mixture, float]:
        """One E and M step, and the mean log-likelihood before it (nats per flight)."""
        responsibilities, likelihood = self.expectation(mixture)
        return self.maximise(responsibilities, mixture), float(likelihood)


def evenly(n: int, most: int) -> Tensor:
    """Positions of at most ``most`` of n flights, as far apart as each other.

    Example:
        >>> evenly(10, 4), evenly(3, 4)
        (tensor([0, 3, 6, 9]), tensor([0, 1, 2]))
    """
    return torch.arange(0, n, -(-n // most))


def shrunk(covariances: Tensor, counts: Tensor, prior_flights: float) -> Tensor:
    r"""Covariances (k, d, d) to which so many flights of the covariance within all components were added.

    The mean over the flights, :math:`S = \sum_k n_k S_k / n`, is what a mixture with one covariance for all components
    would have (``tied`` in scikit-learn); each becomes :math:`(n_k S_k + \nu S) / (n_k + \nu)`, as with an
    inverse-Wishart prior about it (Fraley and Raftery 2007, doi:10.1007/s00357-007-0004-5). Without, a component of a
    dozen flights has some directions in which it hardly varies.

    Args:
        covariances: (k, d, d) of the flights of each component.
        counts: (k,) flights of each.
        prior_flights: The number added; zero for none.

    Example:
        >>> wide, narrow = 4.0 * torch.eye(2), torch.zeros(2, 2)
        >>> shrunk(torch.stack([wide, narrow]), torch.tensor([15.0, 5.0]), 5.0)[1]  # half of the mean, 3
        tensor([[1.5000, 0.0000],
                [0.0000, 1.5000]])
    """
    if prior_flights == 0 or len(covariances) == 1:
        return covariances
    own = counts[:, None, None]
    shared = (own * covariances).sum(0) / counts.sum()
    return (own * covariances + prior_flights * shared) / (own + prior_flights)


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
        return GaussianSteps(self.weights[evenly(n, most)], self.prior_flights)

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
        own = shrunk(second - locs[:, :, None] * locs[:, None, :], count, self.prior_flights)
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
