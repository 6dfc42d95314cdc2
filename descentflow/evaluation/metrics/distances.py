"""Two-sample distances level by level, for sets of descents that do not all span the grid (paper, section 4.1)."""

from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from descentflow.evaluation.metrics.pooled import Pooled, Values

CHUNK_VALUES = 1 << 18
"""Values ordered at once on a CPU: 2 MB in float64, so that the passes over them stay in the cache."""
CHUNK_VALUES_DEVICE = 1 << 25
"""The same on an accelerator, which needs many levels at once to be busy: 256 MB."""


def ks_distance(pooled: Pooled) -> Tensor:
    """Kolmogorov-Smirnov distance (K,): the largest difference of the empirical distribution functions.

    NaN where either sample is empty. Equal to ``scipy.stats.ks_2samp``, ties included.

    Example:
        >>> from descentflow.evaluation.metrics.pooled import pool
        >>> one, two = torch.tensor([[0.0], [2.0]]), torch.tensor([[1.0], [5.0]])
        >>> pooled = pool(one, one > -1, two, two > -1)
        >>> ks_distance(pooled)
        tensor([0.5000], dtype=torch.float64)
    """
    # Within a run of equal values the distribution functions are not yet complete.
    return torch.where(pooled.widths > 0, pooled.height, 0).amax(1) / pooled.scale


def wasserstein_distance(pooled: Pooled) -> Tensor:
    """Wasserstein-1 distance (K,): the area between the distribution functions, in the unit of the values.

    NaN where either sample is empty. Equal to ``scipy.stats.wasserstein_distance``.

    Example:
        >>> from descentflow.evaluation.metrics.pooled import pool
        >>> one, two = torch.tensor([[0.0], [2.0]]), torch.tensor([[1.0], [5.0]])
        >>> pooled = pool(one, one > -1, two, two > -1)
        >>> wasserstein_distance(pooled)
        tensor([2.], dtype=torch.float64)
    """
    return (pooled.height * pooled.widths).sum(1) / pooled.scale


def error_of_the_mean(pooled: Pooled) -> Tensor:
    """Absolute difference (K,) of the means, in the unit of the values (what the paper calls MAE).

    Example:
        >>> from descentflow.evaluation.metrics.pooled import pool
        >>> one, two = torch.tensor([[0.0], [2.0]]), torch.tensor([[1.0], [5.0]])
        >>> pooled = pool(one, one > -1, two, two > -1)
        >>> error_of_the_mean(pooled)
        tensor([2.], dtype=torch.float64)
    """
    return (pooled.mean_first - pooled.mean_second).abs()[:, 0]


def error_of_one(one: Values, real: Values) -> Tensor:
    """Absolute difference (K,) of one descent and the mean of the real ones; NaN where the one is masked.

    Example:
        >>> one, real = torch.tensor([[2.0]]), torch.tensor([[1.0], [5.0]])
        >>> error_of_one((one, one > 0), (real, real > 0))
        tensor([1.], dtype=torch.float64)
    """
    error = (observed_mean(*real) - one[0][0]).abs()
    return error.where(one[1][0], torch.nan)


def observed_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean (L,) of the observed values at each level, in float64; NaN where there is none.

    Example:
        >>> observed_mean(torch.tensor([[1.0, 7.0], [3.0, torch.nan]]), torch.tensor([[True, True], [True, False]]))
        tensor([2., 7.], dtype=torch.float64)
    """
    return torch.where(mask, values, 0.0).sum(0, dtype=torch.float64) / mask.sum(0)


@torch.no_grad()
def by_chunks(
    compare: Callable[..., tuple[Tensor, ...]], first: Tensor, first_mask: Tensor, second: Tensor, second_mask: Tensor
) -> Iterator[Tensor]:
    """Apply ``compare`` to few levels at a time and join its results, each (K,) for K levels.

    Example:
        >>> def means(first, first_mask, second, second_mask):
        ...     return first.mean(0), second.mean(0)
        >>> one, two = torch.zeros(3, 5), torch.ones(4, 5)
        >>> [result.tolist() for result in by_chunks(means, one, one == 0, two, two == 1)]
        [[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0]]
    """
    budget = CHUNK_VALUES if first.device.type == "cpu" else CHUNK_VALUES_DEVICE
    n, n_levels = len(first) + len(second), first.shape[1]
    if n == 0 or n_levels == 0:
        # One absent value a level, or one level that is cut off again, spares every function an empty case.
        pad = first.new_zeros(1, max(n_levels, 1)), first_mask.new_zeros(1, max(n_levels, 1))
        return (result[:n_levels] for result in compare(*pad, *pad))
    step = max(budget // n, 1)
    parts = [
        compare(*(values[:, start : start + step] for values in (first, first_mask, second, second_mask)))
        for start in range(0, n_levels, step)
    ]
    return (torch.cat(columns) for columns in zip(*parts, strict=True))
