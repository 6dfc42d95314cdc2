"""Interface of expectation maximisation to the flights and to the kind of mixture component."""

import copy
from abc import ABC, abstractmethod
from typing import Self

import torch
from torch import Tensor

from descentflow.densities.crossed_clusters import CrossedClusters
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.shrunk_covariances import shrunk


class Steps(ABC):
    """The steps of EM for one set of flights.

    Example:
        >>> from descentflow.densities.gaussian_steps import GaussianSteps
        >>> steps: Steps = GaussianSteps(torch.randn(100, 2).double())
        >>> one = steps.maximise(torch.ones(100, 1).double())  # all flights in one mixture component
        >>> steps.log_joint(one).shape, steps.improve(one)[0].locs.shape
        (torch.Size([100, 1]), torch.Size([1, 2]))
    """

    clusters: CrossedClusters | None = None
    """Ties between components, where they are pairs of clusters."""
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

    def stand_in(self, seed: int) -> "Steps":
        """Flights of which the starts are tried: these themselves, unless a step of these costs much."""
        return self

    def crossed(self, clusters: CrossedClusters | None) -> Self:
        """The steps of the same flights for mixtures whose components are pairs of clusters; free ones of None."""
        same = copy.copy(self)
        same.clusters = clusters
        return same

    def tied(self, counts: Tensor, means: Tensor, covariances: Tensor) -> tuple[Tensor, Tensor]:
        """Means (k, d) and covariances (k, d, d) of components, of what the flights of each are like."""
        if self.clusters is not None:
            return self.clusters.tied(counts, means, covariances, self.prior_flights)
        return means, shrunk(covariances, counts, self.prior_flights)

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
