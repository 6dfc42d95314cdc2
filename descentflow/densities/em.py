"""Expectation maximisation for mixtures, with or without a context: starts, restarts and convergence.

The likelihood, and one step towards its maximum, are those of :mod:`descentflow.densities.em_steps`, with a context
those of :mod:`descentflow.densities.regression_steps`; everything else is the same for both.
"""

import warnings

import torch
from torch import Tensor

from descentflow.densities.em_steps import GaussianSteps, Steps
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.regression_steps import RegressionSteps

SCREENING_ITERATIONS = 30
"""EM steps after which restarts are compared."""
FINALISTS = 4
"""Restarts that go on to convergence."""
STARTING_FLIGHTS = 4096
"""Flights, evenly of the training flights, with which starts are tried and compared; all of them take it from there."""
STARTING_ITERATIONS = 100
"""EM steps of a finalist where it is of some of the flights."""


def steps_of(weights: Tensor, context: Tensor | None = None, prior_flights: float = 0.0) -> Steps:
    """The steps for weights (n, d) of flights and, if there is one, context (n, c).

    Args:
        weights: Of the flights.
        context: (n, c) encoded context.
        prior_flights: Flights by which covariances are shrunk, see :mod:`descentflow.densities.em_steps`.

    Example:
        >>> type(steps_of(torch.randn(100, 2))).__name__
        'GaussianSteps'
    """
    return (
        GaussianSteps(weights, prior_flights) if context is None else RegressionSteps(weights, context, prior_flights)
    )


def start(steps: Steps, n_components: int, seed: int) -> Mixture:
    """A first mixture, of groups by :func:`~descentflow.densities.em.k_means_labels`.

    Args:
        steps: The flights.
        n_components: Number of mixture components.
        seed: Of k-means.

    Example:
        >>> first = start(steps_of(torch.tensor([[0.0], [1.0], [10.0], [11.0]])), n_components=2, seed=0)
        >>> sorted(first.locs.flatten().tolist())
        [0.5, 10.5]
    """
    labels = k_means_labels(steps.points_to_group(seed), n_components, seed)
    return steps.maximise(torch.nn.functional.one_hot(labels, n_components).to(torch.float64))


def best_start(
    weights: Tensor,
    n_components: int,
    *,
    context: Tensor | None = None,
    seed: int,
    n_restarts: int,
    prior_flights: float = 0.0,
) -> Mixture:
    """The first mixture with the highest likelihood among ``n_restarts``, each as :func:`start` makes it.

    Example:
        >>> best_start(torch.randn(50, 2), 3, seed=0, n_restarts=2).locs.shape
        torch.Size([3, 2])
    """
    steps = steps_of(weights, context, prior_flights)
    starts = [start(steps, n_components, seed + i) for i in range(n_restarts)]
    return max(starts, key=lambda mixture: float(steps.expectation(mixture)[1]))


def converge(steps: Steps, mixture: Mixture, *, iterations: int, tolerance: float) -> tuple[Mixture, float]:
    """EM steps until the mean log-likelihood changes by less than ``tolerance`` (nats), and that log-likelihood.

    It grows in every step but where covariances are shrunk, which may cost some of it.

    Example:
        >>> steps = steps_of(torch.randn(200, 2))
        >>> first = start(steps, n_components=2, seed=0)
        >>> converge(steps, first, iterations=50, tolerance=1e-6)[1] > float(steps.expectation(first)[1])
        True
    """
    previous = -float("inf")
    for _ in range(iterations):
        improved, current = steps.improve(mixture)
        if abs(current - previous) < tolerance:
            return mixture, current
        mixture, previous = improved, current
    return mixture, float(steps.expectation(mixture)[1])


def fit_mixture(
    weights: Tensor,
    n_components: int,
    *,
    context: Tensor | None = None,
    seed: int,
    n_restarts: int = 8,
    iterations: int = 500,
    tolerance: float = 1e-6,
    prior_flights: float = 0.0,
) -> tuple[Mixture, float]:
    """Maximum-likelihood mixture from several starts.

    Restarts matter more than the algorithm: seeds differ by 0.3 nats. All are screened by a few steps, and the
    best go on to convergence. Where flights are many, some of them do this, and the best mixture is converged by all.

    Args:
        weights: Standardised weights (n, d).
        n_components: Number of mixture components k.
        context: (n, c) encoded context, on which means and proportions depend where there is one.
        seed: Of the starts.
        n_restarts: Number of starts.
        iterations: Maximum number of EM steps of a finalist.
        tolerance: Gain of the mean log-likelihood (nats) below which EM stops.
        prior_flights: Flights by which covariances are shrunk, see :mod:`descentflow.densities.em_steps`.

    Returns:
        The mixture and its mean log-likelihood (nats per flight).

    Example:
        >>> weights = torch.randn(300, 1)
        >>> weights[:100] += 8
        >>> fitted, log_likelihood = fit_mixture(weights, 2, seed=0)
        >>> sorted(round(float(p), 2) for p in fitted.probs)
        [0.33, 0.67]
    """
    return fit_steps(
        steps_of(weights, context, prior_flights),
        n_components,
        seed=seed,
        n_restarts=n_restarts,
        iterations=iterations,
        tolerance=tolerance,
    )


def fit_steps(
    steps: Steps, n_components: int, *, seed: int, n_restarts: int = 8, iterations: int = 500, tolerance: float = 1e-6
) -> tuple[Mixture, float]:
    """:func:`fit_mixture` for steps that are used again, for instance with another number of components.

    Example:
        >>> steps = steps_of(torch.randn(100, 2))
        >>> [fit_steps(steps, k, seed=0, n_restarts=1)[0].n_components for k in (1, 2)]
        [1, 2]
    """
    some = steps.some(STARTING_FLIGHTS)

    def best(starts: list[Mixture], most: int) -> list[Mixture]:
        """Starts converged by some flights, the most probable first."""
        found = [converge(some, one, iterations=most, tolerance=tolerance) for one in starts]
        return [mixture for mixture, _ in sorted(found, key=lambda pair: -pair[1])]

    starts = [start(some, n_components, seed + i) for i in range(n_restarts if n_components > 1 else 1)]
    finals = best(starts, SCREENING_ITERATIONS)[:FINALISTS]
    finals = best(finals, iterations if some is steps else min(iterations, STARTING_ITERATIONS))
    return converge(steps, finals[0], iterations=iterations, tolerance=tolerance)


def k_means_labels(points: Tensor, n_groups: int, seed: int) -> Tensor:
    """Labels (n,) of k-means++ centres where the seed is even, of k-means from there where it is odd.

    Neither kind is always better for a mixture: four starts of each reached the likelihood of scikit-learn's best of
    three seeds in every one of eight data sets, either kind alone did not (Arthur and Vassilvitskii 2007 for the
    centres).

    Args:
        points: (n, d).
        n_groups: How many are wanted.
        seed: Of the first centres.

    Example:
        >>> points = torch.tensor([[0.0], [1.0], [10.0], [11.0]])
        >>> labels = k_means_labels(points, 2, seed=0)
        >>> bool(labels[0] == labels[1] != labels[2] == labels[3])
        True
    """
    # Imported here: sampling from a mixture needs no k-means.
    from sklearn.cluster import KMeans
    from sklearn.exceptions import ConvergenceWarning

    lloyd_steps = 20 if seed % 2 else 1
    with warnings.catch_warnings():
        # One step is all that an even seed asks for, and a user's flights may be duplicates.
        warnings.simplefilter("ignore", ConvergenceWarning)
        found = KMeans(n_groups, n_init=1, max_iter=lloyd_steps, random_state=seed).fit_predict(points.cpu().numpy())
    return torch.as_tensor(found, dtype=torch.long, device=points.device)
