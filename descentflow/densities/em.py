"""Expectation maximisation for Gaussian mixtures, with restarts and the choice of their number by BIC.

The log density of a Gaussian is linear in the quadratic features ``(x x', x, 1)``, so the E and the M step are
one matrix product each. All of it runs in float64: in float32 the covariances stop being positive definite.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi
from typing import TypeVar

import torch
from torch import Tensor

JITTER = 1e-6
"""Added to the variances, as scikit-learn's ``reg_covar``."""
SCREENING_ITERATIONS = 30
"""EM steps after which restarts are compared."""
FINALISTS = 4
"""Restarts that go on to convergence."""
FLIGHTS_PER_PARAMETER = 15
"""The paper's cap: 15 n_p <= n_train (appendix C)."""
FEWEST_PER_PARAMETER = 4
"""Where the search ends that goes on beyond that cap."""


@dataclass(frozen=True)
class Mixture:
    """Weights (k,), means (k, d) and lower Cholesky factors (k, d, d) of the clusters."""

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor


@dataclass(frozen=True)
class Selection:
    """The mixture chosen by BIC, the BIC of every number of clusters tried, and whether the cap decided."""

    mixture: Mixture
    bic: dict[int, float]
    cap_binds: bool


def n_parameters(n_clusters: int, dimension: int) -> int:
    """Free parameters of a mixture of full Gaussians (paper, appendix C)."""
    return n_clusters * dimension * (dimension + 3) // 2 + n_clusters - 1


def most_clusters(n_train: int, dimension: int, flights_per_parameter: float = FLIGHTS_PER_PARAMETER) -> int:
    """Largest number of clusters with 15 training flights a parameter; one at the least (paper, appendix C)."""
    k = 1
    while flights_per_parameter * n_parameters(k + 1, dimension) <= n_train:
        k += 1
    return k


def quadratic_features(weights: Tensor) -> Tensor:
    """(n, d d + d + 1) float64 features ``x x'``, ``x`` and 1 of weights (n, d)."""
    x = weights.to(torch.float64)
    outer = (x[:, :, None] * x[:, None, :]).flatten(1)
    return torch.cat([outer, x, torch.ones_like(x[:, :1])], 1)


def expectation(features: Tensor, mixture: Mixture) -> tuple[Tensor, Tensor]:
    """Responsibilities (n, k) and the mean log-likelihood (nats a flight)."""
    d = mixture.locs.shape[1]
    precision = torch.cholesky_inverse(mixture.scale_trils)
    linear = (precision @ mixture.locs[:, :, None])[:, :, 0]
    constant = (
        mixture.probs.log()
        - 0.5 * (linear * mixture.locs).sum(1)
        - mixture.scale_trils.diagonal(dim1=1, dim2=2).log().sum(1)
        - 0.5 * d * log(2 * pi)
    )
    joint = features @ torch.cat([-0.5 * precision.flatten(1), linear, constant[:, None]], 1).T
    total = joint.logsumexp(1)
    return (joint - total[:, None]).exp(), total.mean()


def maximisation(features: Tensor, responsibilities: Tensor) -> Mixture:
    """The mixture that maximises the expected log-likelihood."""
    d = int((features.shape[1] - 1 + 0.25) ** 0.5 - 0.5 + 1e-9)
    moments = responsibilities.T @ features
    count = moments[:, -1].clamp(min=1e-9)
    locs = moments[:, -1 - d : -1] / count[:, None]
    second = moments[:, : d * d].reshape(-1, d, d) / count[:, None, None]
    covariance = second - locs[:, :, None] * locs[:, None, :]
    covariance = covariance + JITTER * torch.eye(d, dtype=covariance.dtype, device=covariance.device)
    factor, failed = torch.linalg.cholesky_ex(covariance)
    # A cluster that has lost its flights becomes round and small instead of stopping the fit.
    factor = torch.where(failed[:, None, None] > 0, JITTER**0.5 * torch.eye(d).to(factor), factor)
    return Mixture(count / count.sum(), locs, factor)


def start(weights: Tensor, features: Tensor, n_clusters: int, seed: int) -> Mixture:
    """A first mixture: even seeds give flights to k-means++ centres, odd ones go on to k-means itself.

    Neither kind wins always; four of each reached the likelihood of scikit-learn's best of three seeds in every
    of eight data sets, either kind alone did not (Arthur and Vassilvitskii 2007 for k-means++).
    """
    labels = k_means_labels(weights, n_clusters, seed)
    return maximisation(features, torch.nn.functional.one_hot(labels, n_clusters).to(torch.float64))


def k_means_labels(weights: Tensor, n_clusters: int, seed: int) -> Tensor:
    """Labels (n,) of k-means++ centres (even seeds) or of k-means from there (odd seeds), see :func:`start`."""
    # Imported here: sampling from a mixture needs no k-means.
    from sklearn.cluster import KMeans
    from sklearn.exceptions import ConvergenceWarning

    lloyd_steps = 20 if seed % 2 else 1
    with warnings.catch_warnings():
        # One step is what is wanted of an even seed, and duplicate flights are what a user may have.
        warnings.simplefilter("ignore", ConvergenceWarning)
        labels = KMeans(n_clusters, n_init=1, max_iter=lloyd_steps, random_state=seed).fit_predict(
            weights.cpu().numpy()
        )
    return torch.as_tensor(labels, dtype=torch.long, device=weights.device)


def best_start(weights: Tensor, n_clusters: int, *, seed: int, n_restarts: int) -> Mixture:
    """The likeliest of several first mixtures."""
    weights = weights.to(torch.float64)
    features = quadratic_features(weights)
    starts = [start(weights, features, n_clusters, seed + i) for i in range(n_restarts)]
    return max(starts, key=lambda mixture: float(expectation(features, mixture)[1]))


def converge(features: Tensor, mixture: Mixture, *, iterations: int, tolerance: float) -> tuple[Mixture, float]:
    """EM steps until the mean log-likelihood gains less than ``tolerance`` (nats), and that log-likelihood."""
    previous = -float("inf")
    for _ in range(iterations):
        responsibilities, likelihood = expectation(features, mixture)
        current = float(likelihood)
        if current - previous < tolerance:
            break
        previous = current
        mixture = maximisation(features, responsibilities)
    return mixture, float(expectation(features, mixture)[1])


def fit_mixture(
    weights: Tensor,
    n_clusters: int,
    *,
    seed: int,
    n_restarts: int = 8,
    iterations: int = 500,
    tolerance: float = 1e-6,
) -> tuple[Mixture, float]:
    """Maximum-likelihood mixture of full Gaussians from several starts.

    Restarts matter more than the algorithm: seeds differ by 0.3 nats. All are screened by a few steps, and the
    best go on to convergence.

    Args:
        weights: (n, d) standardised weights.
        n_clusters: Number of clusters k.
        seed: Of the starts.
        n_restarts: Number of starts.
        iterations: Most EM steps of a finalist.
        tolerance: Gain of the mean log-likelihood (nats) below which EM stops.

    Returns:
        The mixture and its mean log-likelihood (nats a flight).
    """
    weights = weights.to(torch.float64)
    features = quadratic_features(weights)
    starts = [start(weights, features, n_clusters, seed + i) for i in range(n_restarts if n_clusters > 1 else 1)]
    screened = [converge(features, m, iterations=SCREENING_ITERATIONS, tolerance=tolerance) for m in starts]
    screened.sort(key=lambda pair: -pair[1])
    finals = [converge(features, m, iterations=iterations, tolerance=tolerance) for m, _ in screened[:FINALISTS]]
    return max(finals, key=lambda pair: pair[1])


def select_mixture(
    weights: Tensor,
    *,
    seed: int,
    n_restarts: int = 8,
    tolerance: float = 1e-6,
    cap: int | None = None,
    extend: bool = True,
    progress: Callable[[int], None] | None = None,
) -> Selection:
    """Choose the number of clusters by the Bayesian information criterion (paper, appendix C).

    Args:
        weights: (n, d) standardised weights of the training flights.
        seed: Of the starts.
        n_restarts: Starts for each number of clusters.
        tolerance: As in :func:`fit_mixture`.
        cap: Most clusters, if fewer than 15 flights a parameter allow.
        extend: Go on beyond 15 flights a parameter where BIC decides for the cap, see :func:`by_bic`.
        progress: Called after each number of clusters with how many will be tried.

    Returns:
        The best mixture; ``cap_binds`` says that the largest number allowed won, so that more might win yet.
    """
    n, dimension = weights.shape
    most, furthest = (most_clusters(n, dimension, share) for share in (FLIGHTS_PER_PARAMETER, FEWEST_PER_PARAMETER))
    if cap is not None:
        most, furthest = min(cap, most), min(cap, furthest)

    def fit(k: int) -> tuple[Mixture, float]:
        return fit_mixture(weights, k, seed=seed, n_restarts=n_restarts, tolerance=tolerance)

    found, bic = by_bic(fit, lambda k: n_parameters(k, dimension), n, most, furthest if extend else most, progress)
    return Selection(found, bic, cap_binds=min(bic, key=bic.__getitem__) == max(bic))


M = TypeVar("M")
EACH_TO = 16
"""Up to here every number of clusters is tried."""
PATIENCE = 4
"""Beyond it, numbers in a row that may be no better before the search ends."""


def by_bic(
    fit: Callable[[int], tuple[M, float]],
    n_parameters: Callable[[int], int],
    n: int,
    most: int,
    furthest: int,
    progress: Callable[[int], None] | None = None,
) -> tuple[M, dict[int, float]]:
    """Try numbers of clusters and keep the one of the smallest BIC.

    Tried are :func:`numbers_tried` up to ``most``; beyond 16 clusters, where each costs much, until four in a row were
    no better. While the largest or the last but one is the best, larger ones are tried, up to ``furthest``: BIC has its
    own price for parameters, so the cap should not be what decides.

    Args:
        fit: Number of clusters -> mixture and mean log-likelihood (nats a flight).
        n_parameters: Number of clusters -> free parameters.
        n: Number of flights.
        most: The paper's cap.
        furthest: Where even a better BIC is not followed.
        progress: Called after each with how many will be tried at least.

    Returns:
        The best, and the BIC of every number tried; the best is the largest only if ``furthest`` decided.
    """
    tried: dict[int, M] = {}
    bic: dict[int, float] = {}
    sizes = numbers_tried(most, max(most, furthest))
    planned = sum(k <= most for k in sizes)
    for i, k in enumerate(sizes):
        since_best = i - sizes.index(min(bic, key=bic.__getitem__)) if bic else 0
        if since_best > (2 if k > most else PATIENCE if k > EACH_TO else i):
            break
        tried[k], likelihood = fit(k)
        bic[k] = n_parameters(k) * log(n) - 2 * n * likelihood
        if progress is not None:
            progress(max(planned, i + 1))
    return tried[min(bic, key=bic.__getitem__)], bic


def numbers_tried(most: int, furthest: int) -> list[int]:
    """Numbers of clusters in the order in which they are tried: all up to 16, then a tenth more each time.

    Example:
        >>> numbers_tried(20, 26)
        [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20, 22, 24, 26]
    """
    found = [1]
    while found[-1] < furthest:
        k = found[-1]
        further = k + 1 if k < EACH_TO else round(1.1 * k)
        found.append(min(further, most if k < most else furthest))
    return found
