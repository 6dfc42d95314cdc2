"""Numbers of speed and drag clusters of a crossed mixture, by an information criterion.

From one of each, the search goes to one more cluster of speed or of drag, whichever the criterion prefers, and ends
where that has not helped some times in a row. Starts are by k-means of either block of weights, and from the clusters
of before: each of them in turn is split in two.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import log

import torch
from torch import Tensor

from descentflow.densities.component_search import MIN_FLIGHTS_PER_PARAMETER, Criterion
from descentflow.densities.crossed_clusters import CrossedClusters
from descentflow.densities.em import fit_from, steps_of
from descentflow.densities.em_steps import Steps
from descentflow.densities.k_means import k_means_labels, white_halves
from descentflow.densities.mixture_parameters import Mixture
from descentflow.representation.evidence import Evidence

MOST_FLIGHTS = 6_000
"""With more flights free components have enough of their own, and as many pairs as they have take too long: of 4,351
E190 flights pairs make a held-out one 0.2 nats more probable than free components, of 7,709 DH8D 0.05 less, and of
15,095 A319 0.13 less."""
FINALISTS, COMPARING_ITERATIONS = 2, 4
"""As in :mod:`descentflow.densities.em`: twice as many of both find nothing more probable of held-out flights."""
MOST_PAIRS = 48
"""End of the search for any criterion."""
PATIENCE = 3
"""Steps in a row that may be no better before it ends."""


@dataclass(frozen=True)
class CrossedSelection:
    """The mixture chosen, its clusters, and the criterion of all that were tried.

    Example:
        >>> chosen = select_crossed(torch.randn(60, 4), 2, seed=0, n_restarts=1)
        >>> chosen.values[chosen.clusters] == min(chosen.values.values())
        True
    """

    mixture: Mixture
    clusters: CrossedClusters
    values: dict[CrossedClusters, float]


def select_crossed(
    flights: Tensor | Evidence,
    n_drag_weights: int,
    *,
    seed: int,
    n_restarts: int = 8,
    tolerance: float = 1e-4,
    criterion: Criterion = "aic",
    prior_flights: float = 0.0,
    only: CrossedClusters | None = None,
    progress: Callable[[int], None] | None = None,
) -> CrossedSelection:
    """Choose the numbers of clusters of speed and of drag.

    Args:
        flights: Standardised weights (n, d) of the training flights, or their evidence.
        n_drag_weights: So many of the weights are of drag: the first.
        seed: Of the starts.
        n_restarts: Starts by k-means for each pair of numbers.
        tolerance: Gain of the mean log-likelihood (nats per flight) at which EM ends.
        criterion: ``aic`` or ``bic``.
        prior_flights: Flights by which covariances are shrunk.
        only: Numbers to which the search goes straight, whatever their criterion is.
        progress: Called after each pair of numbers with how many will be tried at least.

    Example:
        >>> drag, speed = torch.randn(400, 1), torch.randn(400, 1)
        >>> drag[::2] += 8
        >>> speed[:200] += 8  # two of each, and all four pairs
        >>> select_crossed(torch.cat([drag, speed], 1), 1, seed=0, criterion="bic", prior_flights=5.0).clusters
        CrossedClusters(n_speed=2, n_drag=2, n_drag_weights=1)
    """
    steps = steps_of(flights, None, prior_flights)
    points = steps.points_to_group(seed)
    n, dimension = points.shape
    price = log(n) if criterion == "bic" else 2.0
    tried: dict[CrossedClusters, Mixture] = {}
    values: dict[CrossedClusters, float] = {}

    def allowed(clusters: CrossedClusters) -> bool:
        if only is not None:
            return clusters.n_speed <= only.n_speed and clusters.n_drag <= only.n_drag
        few = clusters.n_components <= MOST_PAIRS
        return few and MIN_FLIGHTS_PER_PARAMETER * clusters.n_parameters(dimension) <= n

    at = CrossedClusters(1, 1, n_drag_weights)
    since_best, ahead = 0, [at]
    while ahead and (only is not None or since_best <= PATIENCE):
        for clusters in ahead:
            mine = steps.crossed(clusters)
            stand_in = mine.stand_in(seed)
            starts = _starts(stand_in, points, clusters, seed, n_restarts)
            for fewer, mixture in tried.items():
                starts += split_starts(stand_in, points, fewer, mixture, clusters, seed)
            tried[clusters], likelihood = fit_from(
                mine,
                mine,
                stand_in,
                starts,
                tolerance=tolerance,
                finalists=FINALISTS,
                comparing_iterations=COMPARING_ITERATIONS,
            )
            values[clusters] = clusters.n_parameters(dimension) * price - 2 * n * likelihood
            if progress is not None:
                progress(len(values) + PATIENCE - since_best)
        at = min(ahead, key=values.__getitem__)
        since_best = 0 if values[at] == min(values.values()) else since_best + 1
        more = (
            CrossedClusters(at.n_speed + 1, at.n_drag, n_drag_weights),
            CrossedClusters(at.n_speed, at.n_drag + 1, n_drag_weights),
        )
        ahead = [one for one in more if allowed(one)]
    best = min(values, key=values.__getitem__) if only is None else at
    return CrossedSelection(tried[best], best, values)


def _starts(steps: Steps, points: Tensor, clusters: CrossedClusters, seed: int, n_restarts: int) -> list[Mixture]:
    drag = clusters.n_drag_weights
    starts = []
    for one in range(seed, seed + (n_restarts if clusters.n_components > 1 else 1)):
        of_speed = k_means_labels(points[:, drag:], clusters.n_speed, one)
        of_drag = k_means_labels(points[:, :drag], clusters.n_drag, one)
        pairs = of_speed * clusters.n_drag + of_drag
        starts.append(steps.maximise(torch.nn.functional.one_hot(pairs, clusters.n_components).to(torch.float64)))
    return starts


def split_starts(
    steps: Steps, points: Tensor, fewer: CrossedClusters, mixture: Mixture, clusters: CrossedClusters, seed: int
) -> list[Mixture]:
    """First mixtures in which one cluster of a mixture is split in two; none unless it has one fewer of either kind.

    K-means of all flights seldom finds what distinguishes a few of them; within a cluster, whose flights it sees alone
    and in units of their own spread, it does (the split of Ueda and others 2000, doi:10.1162/089976600300015088).

    Args:
        steps: The flights, for the clusters that are wanted.
        points: (n, d) by which flights are grouped.
        fewer: Clusters of a mixture that was fitted.
        mixture: That one.
        clusters: Wanted.
        seed: Of k-means.

    Example:
        >>> from descentflow.densities.gaussian_steps import GaussianSteps
        >>> points = torch.tensor([[0.0, 0.0], [1.0, 1.0], [0.0, 10.0], [1.0, 11.0]])
        >>> one, two = CrossedClusters(1, 1, 1), CrossedClusters(2, 1, 1)
        >>> steps = GaussianSteps(points).crossed(two)
        >>> mixture = steps.crossed(one).maximise(torch.ones(4, 1).double())
        >>> [start] = split_starts(steps, points, one, mixture, two, seed=0)
        >>> sorted(start.locs[:, 1].tolist())
        [0.5, 10.5]
    """
    more = (clusters.n_speed - fewer.n_speed, clusters.n_drag - fewer.n_drag)
    if more not in ((1, 0), (0, 1)):
        return []
    kind = 1 if more == (1, 0) else 2
    drag = clusters.n_drag_weights
    block = points[:, drag:] if kind == 1 else points[:, :drag]
    pairs = steps.crossed(fewer).expectation(mixture)[0].reshape(-1, fewer.n_speed, fewer.n_drag)
    most = pairs.sum(3 - kind).argmax(1)
    starts = []
    for cluster in range(pairs.shape[kind]):
        own = most == cluster
        if int(own.sum()) <= block.shape[1]:
            continue
        second = pairs.new_zeros(len(points))
        second[own] = white_halves(block[own], seed + cluster).to(second)
        moved = pairs.select(kind, cluster).unsqueeze(kind) * second[:, None, None]
        parted = torch.cat([pairs, moved], kind)
        parted.select(kind, cluster).sub_(moved.squeeze(kind))
        starts.append(steps.maximise(parted.flatten(1)))
    return starts
