"""Two-sample distances level by level, for sets of descents that do not all span the grid (paper, section 4.1)."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.evaluation.metrics.pooled import Pooled, pool

CHUNK_VALUES = 1 << 18
"""Values ordered at once on a CPU: 2 MB in float64, so that the passes over them stay in the cache."""
CHUNK_VALUES_DEVICE = 1 << 25
"""The same on an accelerator, which needs many levels at once to be busy: 256 MB."""


class Distances(NamedTuple):
    """Distances (L,) per level in float64; NaN where either set has no value."""

    ks: Tensor
    """Kolmogorov-Smirnov: the largest difference of the empirical distribution functions."""
    wasserstein: Tensor
    """Wasserstein-1: the area between them, in the unit of the values."""
    mae: Tensor
    """Absolute difference of the means, in the unit of the values (what the paper calls MAE)."""
    n_first: Tensor
    """Observed values of the first set (int64)."""
    n_second: Tensor
    """Observed values of the second set (int64)."""


def level_distances(first: Tensor, first_mask: Tensor, second: Tensor, second_mask: Tensor) -> Distances:
    """Distances between two sets at each level.

    Args:
        first: (n, L) values, float32 or float64; what stands where the mask is false is not read.
        first_mask: (n, L) bool.
        second: (m, L) values.
        second_mask: (m, L) bool.

    Returns:
        Distances, equal to ``scipy.stats.ks_2samp`` and ``wasserstein_distance`` of the values at each level, equal
        values included.

    Raises:
        DataError: If an observed value is not finite.

    Example:
        >>> one = torch.ones(1, 1)
        >>> level_distances(0 * one, one.bool(), 3 * one, one.bool()).wasserstein
        tensor([3.], dtype=torch.float64)
    """

    def compare(*chunk: Tensor) -> tuple[Tensor, ...]:
        pooled = pool(*chunk)
        mae = (pooled.mean_first - pooled.mean_second).abs()[:, 0]
        return *_ks_and_wasserstein(pooled), mae, pooled.n_first[:, 0], pooled.n_second[:, 0]

    return Distances(*by_chunks(compare, first, first_mask, second, second_mask))


def observed_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean (L,) of the observed values at each level, in float64; NaN where there is none."""
    return torch.where(mask, values, 0.0).sum(0, dtype=torch.float64) / mask.sum(0)


@torch.no_grad()
def by_chunks(
    compare: Callable[..., tuple[Tensor, ...]], first: Tensor, first_mask: Tensor, second: Tensor, second_mask: Tensor
) -> Iterator[Tensor]:
    """Apply ``compare`` to few levels at a time and join its results, each (K,) for K levels."""
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


def _ks_and_wasserstein(pooled: Pooled) -> tuple[Tensor, Tensor]:
    """Both distances (K,) of K levels; 0 / 0 = NaN where either sample is empty."""
    # The difference of the distribution functions times n m is an integer: no rounding before the division.
    height = (pooled.below_first * pooled.n_second - pooled.below_second * pooled.n_first).abs_()
    scale = (pooled.n_first * pooled.n_second)[:, 0].double()
    area = (height * pooled.widths).sum(1)
    # Within a run of equal values the distribution functions are not yet complete.
    return height.mul_(pooled.widths > 0).amax(1) / scale, area / scale
