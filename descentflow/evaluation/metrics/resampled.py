"""Statistics by level of the same samples beside flights resampled many times, from one ordering of all values."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import by_chunks
from descentflow.evaluation.metrics.level_distances import Distances
from descentflow.evaluation.metrics.pooled import Pooled, Values
from descentflow.evaluation.metrics.score_registry import level_statistics


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
        """Both samples, where each descent of the second counts as often as ``counts`` (m,) says."""
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
