"""Noise floors: samples against half of the flights, beside the other half against that half, at matched size."""

from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from descentflow.evaluation.metrics.level_distances import Distances, level_distances, stacked
from descentflow.evaluation.metrics.pooled import Values
from descentflow.evaluation.metrics.score_registry import ProfileStatistic, level_statistics


def split_distances(
    samples: Values,
    real: Values,
    *,
    seed: int = 0,
    n_splits: int = 20,
    progress: Callable[[int], None] | None = None,
) -> tuple[Distances, Distances]:
    """Distances of samples and of flights from the same random halves of the flights.

    Each split draws disjoint halves A and B of the flights and as many samples S, and measures S against A and B
    against A. Where gaps leave B and S with different counts at a level, the larger is cut at random to the smaller,
    so that samples of the flights' own distribution and B are exchangeable: both distances then have one expectation,
    whatever the counts and the gaps.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits; they are the same on every device.
        n_splits: Number of random halvings, at least one.
        progress: Progress callback: called with 1 after each split.

    Returns:
        Distances of the samples, and the noise floor, of the statistics that have one; (n_splits, K) each.

    Example:
        >>> values = torch.randn(60, 5).double()
        >>> same, floor = split_distances((values[:30], values[:30] < 9), (values[30:], values[30:] < 9), n_splits=4)
        >>> floor["ks"].shape, int(floor.n_first[0, 0])
        (torch.Size([4, 5]), 15)
    """
    chosen = [one for one in level_statistics() if one.has_floor]
    same, floor = [], []
    for drawn, first, second in _halves(samples, real, seed, n_splits):
        stand_in, other = _equally_many(drawn, second)
        same.append(level_distances(*stand_in, *first, chosen))
        floor.append(level_distances(*other, *first, chosen))
        if progress is not None:
            progress(1)
    return stacked(same), stacked(floor)


def split_profile_scores(
    statistic: ProfileStatistic, samples: Values, real: Values, *, seed: int = 0, n_splits: int = 20
) -> tuple[Tensor, Tensor]:
    """Means (n_splits,) of a statistic of whole profiles: of the samples and of the other half, over the same flights.

    The splits are those of :func:`split_distances`. A flight that one of the two cannot be scored against is left out
    of both means; a split with fewer than ``MIN_VALUES`` others is NaN. Large halves are cut to
    :data:`MAX_SCORED` flights, scored against :data:`MAX_MEMBERS` samples or flights.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import profile_statistics
        >>> values = torch.randn(60, 5).double()
        >>> samples, real = (values[:30], values[:30] < 9), (values[30:], values[30:] < 9)
        >>> same, floor = split_profile_scores(profile_statistics()[0], samples, real, n_splits=4)
        >>> same.shape, floor.shape
        (torch.Size([4]), torch.Size([4]))
    """
    found = []
    for drawn, first, second in _halves(samples, real, seed, n_splits):
        scored = _first(first, MAX_SCORED)
        same, floor = (statistic.compute(_first(one, MAX_MEMBERS), scored) for one in (drawn, second))
        both = ~(same.isnan() | floor.isnan())
        enough = int(both.sum()) >= MIN_VALUES
        found.append([values[both].mean() if enough else values.new_tensor(torch.nan) for values in (same, floor)])
    means = torch.stack([torch.stack(pair) for pair in found])
    return means[:, 0], means[:, 1]


def _halves(samples: Values, real: Values, seed: int, n_splits: int) -> Iterator[tuple[Values, Values, Values]]:
    """For each split, as many samples as half of the flights, one half and the other half."""
    generator = torch.Generator().manual_seed(seed)
    flights, drawn = _seen(real), _seen(samples)
    half = half_size(samples, real)
    for _ in range(n_splits):
        order = torch.randperm(len(flights), generator=generator).to(flights.device)
        picked = torch.randperm(len(drawn), generator=generator)[:half].to(drawn.device)
        yield (
            _take(samples, drawn[picked]),
            _take(real, flights[order[:half]]),
            _take(real, flights[order[half : 2 * half]]),
        )


def half_size(samples: Values, real: Values) -> int:
    """Flights in each half: half of those observed anywhere, or as many as there are samples if these are fewer.

    Example:
        >>> samples, real = torch.ones(100, 3), torch.ones(31, 3)
        >>> half_size((samples, samples > 0), (real, real > 0))
        15
    """
    return min(len(_seen(real)) // 2, len(_seen(samples)))


MAX_SCORED, MAX_MEMBERS = 500, 500
"""Flights of a half that are scored by their whole profiles, and samples or other flights that they are scored against:
the work of a split grows with the product."""
MIN_VALUES = 4
"""Fewest values of each set at a level, or of times, from which a distance is taken: below that, a distance says
more about the count than about the flights. By the 25 % rule for the top of the grid, 32 flights leave about 4 in
each half at the highest level."""


def _seen(values: Values) -> Tensor:
    """Positions of descents observed anywhere: the others say nothing; for times, only those spanning the grid do."""
    return torch.nonzero(values[1].any(1))[:, 0]


def _take(values: Values, index: Tensor) -> Values:
    return values[0][index], values[1][index]


def _first(values: Values, n: int) -> Values:
    """The first n; rows are in random order."""
    return values[0][:n], values[1][:n]


def _equally_many(first: Values, second: Values) -> tuple[Values, Values]:
    """Hide values until both sets have the same count at each level; rows must be in random order."""
    limit = torch.minimum(first[1].sum(0), second[1].sum(0))
    cut = [(values, mask & (mask.cumsum(0) <= limit)) for values, mask in (first, second)]
    return cut[0], cut[1]
