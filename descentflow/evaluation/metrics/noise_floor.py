"""Noise floors at one fixed size: samples against some flights, and as many other flights against the same ones.

A distance between finite sets grows as they become smaller, that of a wrong generator less than that of a right one:
their ratio depends on the size. So every comparison with a floor is of :data:`SIZE` against :data:`SIZE`, however many
flights were held out, and is averaged over many splits. Ratios then compare between types and with a goal.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import MIN_VALUES, Values, by_chunks, pool
from descentflow.evaluation.metrics.score_registry import statistics_of
from descentflow.evaluation.metrics.statistic_kinds import DescentStatistic, LevelStatistic, ProfileStatistic

Some = Values | DescentSet
"""Descents, or one quantity of them: values and mask."""
Distances = dict[str, Tensor]
"""Statistics by name, float64, and under `FEWEST` the observed values of the smaller set; (K,) or (splits, K)."""
FEWEST = "fewest"
SIZE = 200
"""Flights on each side. A type needs twice as many held-out flights; of one with fewer, half are on each side."""
BATCH_VALUES = 1 << 22
"""Values of one set that are held at once: 32 MB in float64."""


def level_distances(
    first: Tensor,
    first_mask: Tensor,
    second: Tensor,
    second_mask: Tensor,
    statistics: Sequence[LevelStatistic] = (),
) -> Distances:
    """Statistics of two sets at each level (paper, section 4.1); NaN where either set has no value.

    Args:
        first: (n, L) values, float32 or float64; masked values are not read.
        first_mask: (n, L) bool.
        second: (m, L) values.
        second_mask: (m, L) bool.
        statistics: Which; all that are registered if empty.

    Raises:
        DataError: If an observed value is not finite.

    Example:
        >>> one = torch.ones(1, 1)
        >>> level_distances(0 * one, one.bool(), 3 * one, one.bool())["wasserstein"]
        tensor([3.], dtype=torch.float64)
    """
    chosen = statistics or statistics_of(LevelStatistic)

    def compare(*chunk: Tensor) -> tuple[Tensor, ...]:
        pooled = pool(*chunk)
        return *(statistic.compute(pooled) for statistic in chosen), torch.minimum(pooled.n_first, pooled.n_second)[
            :, 0
        ]

    distances = by_chunks(compare, first, first_mask, second, second_mask)
    return dict(zip([*(statistic.name for statistic in chosen), FEWEST], distances, strict=True))


def split_distances(
    samples: Values,
    real: Values,
    *,
    seed: int = 0,
    n_splits: int = 20,
    size: int = SIZE,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[Distances, Distances]:
    """Distances of samples and of flights from the same random sets of flights, all of one size.

    Each split draws disjoint sets A and B of flights and as many samples S, and measures S against A and B
    against A. Where gaps leave B and S with different counts at a level, the larger is cut at random to the smaller,
    so that samples of the flights' own distribution and B are exchangeable: both distances then have one expectation,
    whatever the counts and the gaps.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits; they are the same on every device.
        n_splits: Number of random splits, at least one.
        size: Flights on each side, see :func:`matched_size`.
        progress: Progress callback: called with the number of splits that have been compared since it was last called.

    Returns:
        Distances of the samples, and the noise floor, of the statistics that have one; (n_splits, K) each.

    Example:
        >>> values = torch.randn(60, 5).double()
        >>> same, floor = split_distances((values[:30], values[:30] < 9), (values[30:], values[30:] < 9), n_splits=4)
        >>> floor["ks"].shape, int(floor[FEWEST][0, 0])
        (torch.Size([4, 5]), 15)
    """
    chosen = [statistic for statistic in statistics_of(LevelStatistic) if statistic.has_floor]
    drawn, first, second = splits(samples, real, seed, n_splits, size)
    step = max(BATCH_VALUES // max(first.shape[1] * real[0].shape[1], 1), 1)
    same: list[Distances] = []
    noise: list[Distances] = []
    for at in range(0, n_splits, step):
        batch = slice(at, at + step)
        targets, n = _beside(real, first[batch]), len(first[batch])
        both = _equally_many(_beside(samples, drawn[batch]), _beside(real, second[batch]))
        for parts, side in zip((same, noise), both, strict=True):
            distances = level_distances(*side, *targets, chosen)
            parts.append({name: values.reshape(n, -1) for name, values in distances.items()})
        progress(n)
    joined = [{name: torch.cat([part[name] for part in parts]) for name in parts[0]} for parts in (same, noise)]
    return joined[0], joined[1]


def matched_size(samples: Values, real: Values, size: int = SIZE) -> int:
    """Flights on each side: ``size``, or fewer where fewer than twice as many were observed or there are fewer samples.

    Example:
        >>> samples, real = torch.ones(1000, 3), torch.ones(431, 3)
        >>> matched_size((samples, samples > 0), (real, real > 0))
        200
        >>> matched_size((samples, samples > 0), (real[:31], real[:31] > 0))
        15
    """
    return min(size, len(_seen(real)) // 2, len(_seen(samples)))


def splits(samples: Values, real: Values, seed: int, n_splits: int, size: int) -> tuple[Tensor, Tensor, Tensor]:
    """Positions (n_splits, h) of samples, of flights, and of as many other flights; in random order within a split.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights.
        seed: Of the splits.
        n_splits: How many.
        size: Most flights on each side, see :func:`matched_size`.
    """
    generator = torch.Generator().manual_seed(seed)
    flights, drawn, h = _seen(real), _seen(samples), matched_size(samples, real, size)
    order, picked = (
        torch.rand(n_splits, len(side), generator=generator, dtype=torch.float64).argsort(1).to(side.device)
        for side in (flights, drawn)
    )
    return drawn[picked[:, :h]], flights[order[:, :h]], flights[order[:, h : 2 * h]]


def _means(
    compute: Callable[[Any, Any], Tensor], samples: Some, real: Some, dealt: tuple[Tensor, Tensor, Tensor]
) -> tuple[Tensor, Tensor]:
    """Means (n_splits,) over the flights that both samples and other flights can be scored against."""
    pairs = []
    for drawn, first, second in zip(*dealt, strict=True):
        scored = _take(real, first)
        same, floor = (compute(chosen, scored) for chosen in (_take(samples, drawn), _take(real, second)))
        both = ~(same.isnan() | floor.isnan())
        enough = int(both.sum()) >= MIN_VALUES
        pairs.append([values[both].mean() if enough else values.new_tensor(torch.nan) for values in (same, floor)])
    means = torch.stack([torch.stack(pair) for pair in pairs])
    return means[:, 0], means[:, 1]


def _seen(values: Values) -> Tensor:
    """Positions of descents observed anywhere: the others say nothing; for times, only those spanning the grid do."""
    return torch.nonzero(values[1].any(1))[:, 0]


def _take(some: Some, index: Tensor) -> Some:
    return some.subset(index) if isinstance(some, DescentSet) else (some[0][index], some[1][index])


def _beside(values: Values, index: Tensor) -> Values:
    """The sets that rows of ``index`` (n_splits, h) choose from (n, K), side by side: (h, n_splits K)."""
    drawn, mask = (whole[index].transpose(0, 1).flatten(1) for whole in values)
    return drawn, mask


def _equally_many(first: Values, second: Values) -> tuple[Values, Values]:
    """Hide values until both sets have the same count at each level; rows must be in random order."""
    limit = torch.minimum(first[1].sum(0), second[1].sum(0))
    cut = [(values, mask & (mask.cumsum(0) <= limit)) for values, mask in (first, second)]
    return cut[0], cut[1]


@dataclass(frozen=True)
class Comparison:
    """Statistics by name; NaN where there are too few values.

    Level statistics: ``whole`` (K,), all samples against all flights; ``same`` and ``floor`` (n_splits, K), samples
    and other flights against ``n_each`` flights, as many of each (:func:`split_distances`). A statistic of whole
    profiles has one value for each of the m flights in ``whole`` (m,), and means in ``same`` and ``floor``
    (n_splits, 1). Statistics without a noise floor are not in ``same`` and ``floor``.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> distances = compare(samples, real, seed=0, n_splits=5)
        >>> distances.whole["mae"], distances.floor["mae"].shape, distances.n_each
        (tensor([3.], dtype=torch.float64), torch.Size([5, 1]), 4)
    """

    whole: Mapping[str, Tensor]
    same: Mapping[str, Tensor]
    floor: Mapping[str, Tensor]
    n_each: int


def compare(
    samples: Values,
    real: Values,
    seed: int,
    n_splits: int,
    progress: Callable[[int], None] = lambda _: None,
) -> Comparison:
    """Compare samples with real flights level by level, and flights with each other.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits.
        n_splits: How many.
        progress: Progress callback: called with the number of splits that have been compared since it was last called.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> distances = compare(samples, real, seed=0, n_splits=5)
        >>> distances.whole["mae"], distances.same["mae"].shape  # the means are 9.5 and 6.5
        (tensor([3.], dtype=torch.float64), torch.Size([5, 1]))
    """
    splits = split_distances(samples, real, seed=seed, n_splits=n_splits, progress=progress)
    same, noise = (_enough(side) for side in splits)
    return Comparison(whole_distances(samples, real), same, noise, matched_size(samples, real))


def compare_flights(
    statistic: ProfileStatistic | DescentStatistic, samples: Some, real: Some, seed: int, n_splits: int
) -> Comparison:
    """As :func:`compare`, by a statistic of whole profiles or of whole descents, over no more splits than it wants.

    A flight that samples or other flights cannot be scored against is left out of both means; a split with fewer than
    ``MIN_VALUES`` others is NaN.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import STATISTICS
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> compare_flights(STATISTICS["joint_energy"], one, two, seed=0, n_splits=2).n_each
        30
    """
    compute: Callable[[Any, Any], Tensor] = statistic.compute
    drawn, seen = ((side.mask, side.mask) if isinstance(side, DescentSet) else side for side in (samples, real))
    whole, n_each = {statistic.name: _enough_flights(compute(samples, real))}, matched_size(drawn, seen)
    if not statistic.has_floor:
        return Comparison(whole, {}, {}, n_each)
    dealt = splits(drawn, seen, seed, min(n_splits, statistic.most_splits), SIZE)
    same, floor = ({statistic.name: side[:, None]} for side in _means(compute, samples, real, dealt))
    return Comparison(whole, same, floor, n_each)


def whole_distances(samples: Values, real: Values) -> dict[str, Tensor]:
    """Level statistics (K,) of all samples against all flights, NaN at levels with too few values of a set."""
    return _enough(level_distances(*samples, *real))


def _enough_flights(whole: Tensor) -> Tensor:
    """Scores by flight, all NaN where too few flights have one."""
    return whole if int((~whole.isnan()).sum()) >= MIN_VALUES else torch.full_like(whole, torch.nan)


def _enough(distances: Distances) -> dict[str, Tensor]:
    """Statistics where there are enough values of both sets.

    Within a split, both comparisons have the same counts, and so lack the same levels.
    """
    few = distances[FEWEST] < MIN_VALUES
    return {name: values.masked_fill(few, torch.nan) for name, values in distances.items() if name != FEWEST}
