"""One quantity of sampled and real descents compared: whole, and at one fixed size beside its noise floor."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import by_chunks
from descentflow.evaluation.metrics.level_distances import Distances, level_distances
from descentflow.evaluation.metrics.noise_floor import (
    MIN_VALUES,
    matched_size,
    split_descent_scores,
    split_distances,
    split_profile_scores,
)
from descentflow.evaluation.metrics.pooled import Pooled, Values
from descentflow.evaluation.metrics.score_registry import level_statistics
from descentflow.evaluation.metrics.statistic_kinds import DescentStatistic, ProfileStatistic


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
        >>> found = compare(samples, real, seed=0, n_splits=5)
        >>> found.whole["mae"], found.floor["mae"].shape, found.n_each
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
    progress: Callable[[int], None] | None = None,
    *,
    floor: bool = True,
) -> Comparison:
    """Compare samples with real flights level by level, and flights with each other.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits.
        n_splits: How many.
        progress: Progress callback: called with the number of splits that have been compared since it was last called.
        floor: Whether the noise floor is wanted; NaN if not.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> found = compare(samples, real, seed=0, n_splits=5)
        >>> found.whole["mae"], found.same["mae"].shape  # the means are 9.5 and 6.5
        (tensor([3.], dtype=torch.float64), torch.Size([5, 1]))
    """
    splits = split_distances(samples, real, seed=seed, n_splits=n_splits, floor=floor, progress=progress)
    same, noise = (_enough(side) for side in splits)
    return Comparison(whole_distances(samples, real), same, noise, matched_size(samples, real))


def compare_profiles(
    statistic: ProfileStatistic, samples: Values, real: Values, seed: int, n_splits: int
) -> Comparison:
    """As :func:`compare`, by a statistic of whole profiles.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import profile_statistics
        >>> (energy,) = profile_statistics()
        >>> values = torch.arange(24.0)[:, None].expand(24, 3)
        >>> samples, real = (values, values > -1), (values[:10], values[:10] > -1)
        >>> found = compare_profiles(energy, samples, real, seed=0, n_splits=2)
        >>> found.whole["energy"].shape, found.floor["energy"].shape
        (torch.Size([10]), torch.Size([2, 1]))
    """
    name, whole = statistic.name, _enough_flights(statistic.compute(samples, real))
    if not statistic.has_floor:
        return Comparison({name: whole}, {}, {}, matched_size(samples, real))
    same, floor = split_profile_scores(statistic, samples, real, seed=seed, n_splits=n_splits)
    return Comparison({name: whole}, {name: same[:, None]}, {name: floor[:, None]}, matched_size(samples, real))


def compare_descents(
    statistic: DescentStatistic, samples: DescentSet, real: DescentSet, seed: int, n_splits: int
) -> Comparison:
    """As :func:`compare`, by a statistic of whole descents.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import STATISTICS
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> compare_descents(STATISTICS["joint_energy"], one, two, seed=0, n_splits=2).n_each
        30
    """
    name, whole = statistic.name, _enough_flights(statistic.compute(samples, real))
    same, floor = split_descent_scores(statistic, samples, real, seed=seed, n_splits=n_splits)
    n_each = matched_size((samples.mask, samples.mask), (real.mask, real.mask))
    return Comparison({name: whole}, {name: same[:, None]}, {name: floor[:, None]}, n_each)


def whole_distances(samples: Values, real: Values) -> dict[str, Tensor]:
    """Level statistics (K,) of all samples against all flights, NaN at levels with too few values of a set.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> whole_distances(samples, real)["mae"]
        tensor([3.], dtype=torch.float64)
        >>> three = real[0][:3], real[1][:3]
        >>> whole_distances(samples, three)["mae"]  # too few
        tensor([nan], dtype=torch.float64)
    """
    return _enough(level_distances(*samples, *real))


def resampled_levels(samples: Values, real: Values, counts: Tensor) -> dict[str, Tensor]:
    """Level statistics (n_resamples, K) of all samples against flights drawn as often as ``counts`` (n_resamples, m).

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(4.0)[:, None]
        >>> counts = torch.tensor([[1, 1, 1, 1], [0, 0, 0, 4], [0, 0, 0, 3]])
        >>> resampled_levels((samples, samples > -1), (real, real > -1), counts)["mae"][:, 0]  # too few in the last
        tensor([8.0000, 6.5000,    nan], dtype=torch.float64)
    """
    return _enough(resampled_distances(samples, real, counts))


def _enough_flights(whole: Tensor) -> Tensor:
    """Scores by flight, all NaN where too few flights have one."""
    return whole if int((~whole.isnan()).sum()) >= MIN_VALUES else torch.full_like(whole, torch.nan)


def _enough(distances: Distances) -> dict[str, Tensor]:
    """Statistics where there are enough values of both sets.

    Within a split, both comparisons have the same counts, and so lack the same levels.
    """
    enough = torch.minimum(distances.n_first, distances.n_second) >= MIN_VALUES
    return {name: values.where(enough, torch.nan) for name, values in distances.by_name.items()}


def resampled_distances(first: Values, second: Values, counts: Tensor) -> Distances:
    """Level statistics of two sets, the second of which is resampled: each of its descents counts any number of times.

    Equal to :func:`~descentflow.evaluation.metrics.level_distances.level_distances` with the second set's descents
    repeated. Resampling changes how often a value counts, not where it lies: all resamples share one ordering, which
    is most of the work.

    Args:
        first: Values and mask (n, L), the same ones every time.
        second: Values and mask (m, L).
        counts: (n_resamples, m) int64, how often each descent of the second set is drawn.

    Returns:
        Statistics and numbers of observed values, (n_resamples, L) each.

    Example:
        >>> one = torch.ones(1, 1)
        >>> two = torch.tensor([[1.0], [4.0]])
        >>> counts = torch.tensor([[2, 0], [0, 2]])
        >>> resampled_distances((one, one > 0), (two, two > 0), counts)["wasserstein"].tolist()
        [[0.0], [3.0]]
    """
    chosen = level_statistics()

    def compare(*chunk: Tensor) -> tuple[Tensor, ...]:
        ordered = order_once(*chunk)
        resamples = [ordered.counted(one) for one in counts]
        found = [torch.stack([one.compute(pooled) for pooled in resamples], 1) for one in chosen]
        n_second = torch.cat([pooled.n_second for pooled in resamples], 1)
        return *found, ordered.n_first.expand_as(n_second), n_second

    *found, n_first, n_second = (one.T for one in by_chunks(compare, *first, *second))
    return Distances({one.name: values for one, values in zip(chosen, found, strict=True)}, n_first, n_second)


@dataclass(frozen=True)
class OrderedOnce:
    """Both samples of K levels in ascending order, N = n + m values a level, before it is said how often each counts.

    Shapes: ``widths, below_first`` (K, N), ``n_first, mean_first`` (K, 1), as in
    :class:`~descentflow.evaluation.metrics.pooled.Pooled`; ``owner`` (K, N) is the position in the second sample of
    the value there, m for values of the first and absent ones; ``second`` and ``mask`` (K, m) are the second sample.

    Example:
        >>> one, two = torch.tensor([[1.0], [3.0]]), torch.tensor([[2.0]])
        >>> ordered = order_once(one, one > 0, two, two > 0)
        >>> ordered.owner, ordered.counted(torch.tensor([3])).below_second
        (tensor([[1, 0, 1]]), tensor([[0, 3, 3]]))
    """

    widths: Tensor
    below_first: Tensor
    n_first: Tensor
    mean_first: Tensor
    owner: Tensor
    second: Tensor
    mask: Tensor

    def counted(self, counts: Tensor) -> Pooled:
        """Both samples, where each descent of the second counts ``counts`` (m,) times."""
        padded = torch.cat([counts, counts.new_zeros(1)])
        # Counts are small integers: their sums are exact in double precision, whose products are the fast ones.
        weights = counts.double()
        n_second = self.mask.double() @ weights
        return Pooled(
            self.widths,
            self.below_first,
            padded[self.owner].cumsum(1),
            self.n_first,
            n_second.long()[:, None],
            self.mean_first,
            (self.second @ weights / n_second)[:, None],
        )


def order_once(first: Tensor, first_mask: Tensor, second: Tensor, second_mask: Tensor) -> OrderedOnce:
    """Order two samples, (n, K) and (m, K), together at every level.

    Example:
        >>> one, two = torch.tensor([[1.0], [3.0]]), torch.tensor([[2.0]])
        >>> order_once(one, one > 0, two, two > 0).widths
        tensor([[1., 1., 0.]], dtype=torch.float64)
    """
    n, m = len(first), len(second)
    values = torch.cat([first.T, second.T], 1).double()
    mask = torch.cat([first_mask.T, second_mask.T], 1)
    ordered, order = torch.where(mask, values, torch.inf).sort(1)
    there = mask.gather(1, order)
    # Absent values come last; as copies of the largest they leave no step behind it.
    largest = torch.where(mask, values, -torch.inf).amax(1, keepdim=True)
    ordered = ordered.minimum(largest).nan_to_num_(neginf=0.0)
    of_first = (order < n) & there
    n_first = first_mask.T.sum(1, keepdim=True)
    return OrderedOnce(
        widths=ordered.diff(dim=1, append=ordered[:, -1:]),
        below_first=of_first.cumsum(1),
        n_first=n_first,
        mean_first=torch.where(first_mask.T, first.T, 0.0).sum(1, keepdim=True, dtype=torch.float64) / n_first,
        owner=torch.where(there & ~of_first, order - n, m),
        second=torch.where(second_mask.T, second.T, 0.0).double(),
        mask=second_mask.T,
    )
