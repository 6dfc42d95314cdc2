"""A mixture of many flights that show only some levels: grown by splitting every component in two, again and again.

EM of many components from groups of k-means takes long where flights are many, for it begins far from where it ends: of
29,528 B738 flights the search through numbers of components took 225 s of processor time so. Grown from a mixture of
half the components, fitted to all flights, it begins near, takes half the time and ends higher.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.densities.em import STARTING_FLIGHTS, fit_steps, white_halves
from descentflow.densities.em_acceleration import converge_fast
from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture_parameters import Mixture

ITERATIONS = 200
"""EM steps at most for each number of components; some 50 are needed."""
TOLERANCE = 1e-4
"""Gain (nats per flight) at which they end: a component costs thirty times that (0.003 nats for 29,528 flights by AIC),
and the training that follows goes on from there."""
MOST_OF_STARTS = 8
"""Up to so many components starts by k-means are tried beside the one that has grown: they cost little there, and find
clusters that lie far from each other, which splits of both halves of all flights may miss."""
OWN_PER_WEIGHT = 2
"""Flights for each weight that a component needs, of those that start the splits, to be split."""


def grow_mixture(
    steps: Steps,
    most: int,
    criterion: Callable[[int, float], float],
    *,
    seed: int,
    n_restarts: int = 8,
    progress: Callable[[int], None] | None = None,
) -> tuple[Mixture, dict[int, float]]:
    """Double the number of components until the criterion is no better, or there are so many.

    Args:
        steps: The flights.
        most: Components at most.
        criterion: Number of components, mean log-likelihood (nats per flight) -> the less, the better.
        seed: Of the starts, and of how components are split.
        n_restarts: Starts by k-means for each of the first numbers, beside the one that has grown.
        progress: Progress callback: called after each number of components with how many will be tried at most.

    Returns:
        The best, and the criterion of every number tried.

    Example:
        >>> from descentflow.densities.em import steps_of
        >>> flights = torch.randn(400, 2)
        >>> flights[::4] += 9
        >>> flights[1::4] -= 9
        >>> bic = lambda k, likelihood: 6 * 6.0 * k - 2 * 400 * likelihood
        >>> grow_mixture(steps_of(flights), 16, bic, seed=0)[0].n_components
        4
    """
    stand_in = steps.some(STARTING_FLIGHTS).stand_in(seed)
    sizes = [*(2**i for i in range((most - 1).bit_length())), most]
    best, likelihood = fit_steps(steps, 1, seed=seed, tolerance=TOLERANCE)
    values = {1: criterion(1, likelihood)}
    for size in sizes[1:]:
        if progress is not None:
            progress(len(sizes))
        first = split_all(stand_in, best, size, seed)
        k = first.n_components
        if k == best.n_components:
            break
        found, likelihood = converge_fast(steps, first, iterations=ITERATIONS, tolerance=TOLERANCE)
        if k <= MOST_OF_STARTS:
            other = fit_steps(steps, k, seed=seed, n_restarts=n_restarts, iterations=ITERATIONS, tolerance=TOLERANCE)
            found, likelihood = max((found, likelihood), other, key=lambda pair: pair[1])
        values[k] = criterion(k, likelihood)
        if values[k] >= values[best.n_components]:
            break
        best = found
        if k < size:  # some have too few flights to be split
            break
    if progress is not None:
        progress(len(sizes))
    return best, values


def split_all(steps: Steps, mixture: Mixture, most: int, seed: int) -> Mixture:
    """A first mixture in which components are split in two, those of most flights first, until there are so many.

    Each is split by k-means of its own flights in units of their own spread (the split of Ueda and others 2000,
    doi:10.1162/089976600300015088). One of which too few flights are is left whole.

    Args:
        steps: Flights whose weights are known.
        mixture: Of these.
        most: Components at most.
        seed: Of k-means.

    Example:
        >>> from descentflow.densities.em import steps_of
        >>> steps = steps_of(torch.tensor([[0.0], [1.0], [2.0], [10.0], [11.0], [12.0]]))
        >>> split_all(steps, steps.maximise(torch.ones(6, 1).double()), 8, seed=0).locs.flatten().sort().values
        tensor([ 1., 11.], dtype=torch.float64)
    """
    points = steps.points_to_group(seed)
    shares = steps.expectation(mixture)[0].clone()
    likeliest = shares.argmax(1)
    counts = likeliest.bincount(minlength=mixture.n_components)
    parted: list[Tensor] = []
    for component in counts.argsort(descending=True).tolist()[: max(most - mixture.n_components, 0)]:
        own = likeliest == component
        if int(own.sum()) <= OWN_PER_WEIGHT * points.shape[1]:
            break  # and of all others fewer flights are
        second = torch.zeros_like(shares[:, component])
        second[own] = white_halves(points[own], seed + component).to(second)
        parted.append(shares[:, component] * second)
        shares[:, component] -= parted[-1]
    return steps.maximise(torch.cat([shares, *(one[:, None] for one in parted)], 1)) if parted else mixture
