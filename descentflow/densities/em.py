"""Expectation maximisation for mixtures, with or without a context: starts, restarts and convergence.

The likelihood, and one step towards its maximum, are those of :mod:`descentflow.densities.em_steps`. Where EM ends is
decided by :func:`converge` alone.
"""

import warnings
from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import Mixture

SCREENING_ITERATIONS = 30
"""EM steps after which restarts are compared."""
FINALISTS = 4
"""Restarts that go on to convergence."""
ITERATIONS = 500
"""EM steps of a finalist at most."""
STARTING_FLIGHTS = 4096
"""Flights, evenly of the training flights, with which starts are tried and compared; all of them take it from there."""
STARTING_ITERATIONS = 100
"""EM steps of a finalist where it is of some of the flights."""


def start(steps: Steps, n_components: int, seed: int) -> Mixture:
    """A first mixture, of groups by :func:`~descentflow.densities.em.k_means_labels`.

    Args:
        steps: The flights.
        n_components: Number of mixture components.
        seed: Of k-means.

    Example:
        >>> first = start(Steps(torch.tensor([[0.0], [1.0], [10.0], [11.0]])), n_components=2, seed=0)
        >>> sorted(first.locs.flatten().tolist())
        [0.5, 10.5]
    """
    labels = k_means_labels(steps.points_to_group(seed), n_components, seed)
    return steps.maximise(torch.nn.functional.one_hot(labels, n_components).to(torch.float64))


def best_start(steps: Steps, n_components: int, *, seed: int, n_restarts: int) -> Mixture:
    """The first mixture with the highest likelihood among ``n_restarts``, each as :func:`start` makes it.

    Example:
        >>> best_start(Steps(torch.randn(50, 2)), 3, seed=0, n_restarts=2).locs.shape
        torch.Size([3, 2])
    """
    starts = [start(steps, n_components, seed + i) for i in range(n_restarts)]
    return max(starts, key=lambda mixture: float(steps.expectation(mixture)[1]))


def converge(
    improve: Callable[[Mixture], tuple[Mixture, float]], mixture: Mixture, *, iterations: int, tolerance: float
) -> tuple[Mixture, float]:
    """EM steps until the mean log-likelihood changes by less than ``tolerance`` (nats), and that log-likelihood.

    It grows in every step but where covariances are shrunk, which may cost some of it.

    Args:
        improve: One EM step: the next mixture, and the mean log-likelihood (nats) of the one before.
        mixture: Start.
        iterations: Steps at most.
        tolerance: In nats per flight.

    Example:
        >>> steps = Steps(torch.randn(200, 2))
        >>> first = start(steps, n_components=2, seed=0)
        >>> converge(steps.improve, first, iterations=50, tolerance=1e-6)[1] > float(steps.expectation(first)[1])
        True
    """
    previous = -float("inf")
    for _ in range(iterations):
        improved, current = improve(mixture)
        if abs(current - previous) < tolerance:
            return mixture, current
        mixture, previous = improved, current
    return mixture, improve(mixture)[1]


def fit_mixture(
    flights: Tensor | Steps, n_components: int, *, seed: int, n_restarts: int = 8, tolerance: float = 1e-6
) -> tuple[Mixture, float]:
    """Maximum-likelihood mixture from several starts.

    Restarts matter more than the algorithm: seeds differ by 0.3 nats. All are screened by a few steps, and the
    best go on to convergence. Where flights are many, some of them do this, and the best mixture is converged by all.

    Args:
        flights: Standardised weights (n, d), or their steps, with a context and a prior if there are any.
        n_components: Number of mixture components k.
        seed: Of the starts.
        n_restarts: Number of starts.
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
    steps = flights if isinstance(flights, Steps) else Steps(flights)
    some = steps.some(STARTING_FLIGHTS)

    def best(starts: list[Mixture], most: int) -> list[Mixture]:
        """Starts converged by some flights, the most probable first."""
        converged = [converge(some.improve, mixture, iterations=most, tolerance=tolerance) for mixture in starts]
        return [mixture for mixture, _ in sorted(converged, key=lambda pair: -pair[1])]

    starts = [start(some, n_components, seed + i) for i in range(n_restarts if n_components > 1 else 1)]
    finals = best(starts, SCREENING_ITERATIONS)[:FINALISTS]
    finals = best(finals, ITERATIONS if some is steps else STARTING_ITERATIONS)
    return converge(steps.improve, finals[0], iterations=ITERATIONS, tolerance=tolerance)


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
        labels = KMeans(n_groups, n_init=1, max_iter=lloyd_steps, random_state=seed).fit_predict(points.cpu().numpy())
    return torch.as_tensor(labels, dtype=torch.long, device=points.device)
