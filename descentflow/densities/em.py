"""Expectation maximisation for mixtures, with or without a context: starts, restarts and convergence.

The likelihood, and one step towards its maximum, are those of :mod:`descentflow.densities.gaussian_steps` or, with a
context, of :mod:`descentflow.densities.regression_steps`; everything else is the same for both and stands here.
"""

import warnings
from typing import Protocol

import torch
from torch import Tensor

from descentflow.densities.gaussian_steps import GaussianSteps
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.regression_steps import RegressionSteps

SCREENING_ITERATIONS = 30
"""EM steps after which restarts are compared."""
FINALISTS = 4
"""Restarts that go on to convergence."""


class Steps(Protocol):
    """What EM needs of the training flights and of the kind of mixture component.

    Example:
        >>> steps: Steps = GaussianSteps(torch.randn(100, 2).double())
        >>> one = steps.maximise(torch.ones(100, 1).double())  # all flights in one mixture component
        >>> steps.log_joint(one).shape
        torch.Size([100, 1])
    """

    def points_to_group(self, seed: int) -> Tensor:
        """What k-means starts from, (n, d)."""

    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times density (n, k) of each flight and mixture component, in nats."""

    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """The M step, from the mixture before it where it is no closed form."""


def steps_of(weights: Tensor, context: Tensor | None = None) -> Steps:
    """The steps for weights (n, d) and, if there is one, context (n, c).

    Example:
        >>> type(steps_of(torch.randn(100, 2))).__name__
        'GaussianSteps'
    """
    return GaussianSteps(weights) if context is None else RegressionSteps(weights, context)


def expectation(steps: Steps, mixture: Mixture) -> tuple[Tensor, Tensor]:
    """The E step: responsibilities (n, k) and the mean log-likelihood (nats per flight).

    Example:
        >>> half, zero, one = (torch.full((2, 1, 1), value).double() for value in (0.5, 0.0, 1.0))
        >>> same = Mixture(half[:, 0, 0], zero[:, 0], one)
        >>> expectation(steps_of(torch.zeros(1, 1)), same)[0].tolist()
        [[0.5, 0.5]]
    """
    joint = steps.log_joint(mixture)
    total = joint.logsumexp(1)
    return (joint - total[:, None]).exp(), total.mean()


def start(steps: Steps, n_components: int, seed: int) -> Mixture:
    """A first mixture: even seeds assign flights to k-means++ centres, odd ones go on to k-means itself.

    Neither kind is always better; four of each reached the likelihood of scikit-learn's best of three seeds in every
    one of eight data sets, either kind alone did not (Arthur and Vassilvitskii 2007 for k-means++).

    Args:
        steps: The flights.
        n_components: Number of mixture components.
        seed: Of k-means.

    Example:
        >>> first = start(steps_of(torch.tensor([[0.0], [1.0], [10.0], [11.0]])), n_components=2, seed=0)
        >>> sorted(first.locs.flatten().tolist())
        [0.5, 10.5]
    """
    labels = _k_means_labels(steps.points_to_group(seed), n_components, seed)
    return steps.maximise(torch.nn.functional.one_hot(labels, n_components).to(torch.float64))


def _k_means_labels(points: Tensor, n_components: int, seed: int) -> Tensor:
    """Labels (n,) of k-means++ centres (even seeds) or of k-means from there (odd seeds), see :func:`start`."""
    # Imported here: sampling from a mixture needs no k-means.
    from sklearn.cluster import KMeans
    from sklearn.exceptions import ConvergenceWarning

    lloyd_steps = 20 if seed % 2 else 1
    with warnings.catch_warnings():
        # One step is all that an even seed asks for, and a user's flights may be duplicates.
        warnings.simplefilter("ignore", ConvergenceWarning)
        found = KMeans(n_components, n_init=1, max_iter=lloyd_steps, random_state=seed).fit_predict(
            points.cpu().numpy()
        )
    return torch.as_tensor(found, dtype=torch.long, device=points.device)


def best_start(
    weights: Tensor, n_components: int, *, context: Tensor | None = None, seed: int, n_restarts: int
) -> Mixture:
    """The first mixture with the highest likelihood among ``n_restarts``, each as :func:`start` makes it.

    Example:
        >>> best_start(torch.randn(50, 2), 3, seed=0, n_restarts=2).locs.shape
        torch.Size([3, 2])
    """
    steps = steps_of(weights, context)
    starts = [start(steps, n_components, seed + i) for i in range(n_restarts)]
    return max(starts, key=lambda mixture: float(expectation(steps, mixture)[1]))


def converge(steps: Steps, mixture: Mixture, *, iterations: int, tolerance: float) -> tuple[Mixture, float]:
    """EM steps until the mean log-likelihood gains less than ``tolerance`` (nats), and that log-likelihood.

    Example:
        >>> steps = steps_of(torch.randn(200, 2))
        >>> first = start(steps, n_components=2, seed=0)
        >>> converge(steps, first, iterations=50, tolerance=1e-6)[1] > float(expectation(steps, first)[1])
        True
    """
    previous = -float("inf")
    for _ in range(iterations):
        responsibilities, likelihood = expectation(steps, mixture)
        current = float(likelihood)
        if current - previous < tolerance:
            break
        previous = current
        mixture = steps.maximise(responsibilities, mixture)
    return mixture, float(expectation(steps, mixture)[1])


def fit_mixture(
    weights: Tensor,
    n_components: int,
    *,
    context: Tensor | None = None,
    seed: int,
    n_restarts: int = 8,
    iterations: int = 500,
    tolerance: float = 1e-6,
) -> tuple[Mixture, float]:
    """Maximum-likelihood mixture from several starts.

    Restarts matter more than the algorithm: seeds differ by 0.3 nats. All are screened by a few steps, and the
    best go on to convergence.

    Args:
        weights: (n, d) standardised weights.
        n_components: Number of mixture components k.
        context: (n, c) encoded context, on which means and proportions depend where there is one.
        seed: Of the starts.
        n_restarts: Number of starts.
        iterations: Maximum number of EM steps of a finalist.
        tolerance: Gain of the mean log-likelihood (nats) below which EM stops.

    Returns:
        The mixture and its mean log-likelihood (nats per flight).

    Example:
        >>> weights = torch.randn(300, 1)
        >>> weights[:100] += 8
        >>> fitted, log_likelihood = fit_mixture(weights, 2, seed=0)
        >>> sorted(round(float(p), 2) for p in fitted.probs)
        [0.33, 0.67]
    """
    steps = steps_of(weights, context)
    starts = [start(steps, n_components, seed + i) for i in range(n_restarts if n_components > 1 else 1)]
    screened = [converge(steps, m, iterations=SCREENING_ITERATIONS, tolerance=tolerance) for m in starts]
    screened.sort(key=lambda pair: -pair[1])
    finals = [converge(steps, m, iterations=iterations, tolerance=tolerance) for m, _ in screened[:FINALISTS]]
    return max(finals, key=lambda pair: pair[1])
