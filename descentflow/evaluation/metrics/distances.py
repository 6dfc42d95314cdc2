"""Two-sample distances level by level, for sets of descents that do not all span the grid (paper, section 4.1)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from descentflow.core.errors import DataError

Values = tuple[Tensor, Tensor]
"""Values and mask, (n, K) each: n descents on K levels, or one time each."""


@dataclass(frozen=True)
class Pooled:
    """Both samples of K levels in ascending order, N = n + m values a level.

    At position i of a level, ``below_first`` and ``below_second`` count the values of each sample among the first
    i + 1, and ``widths`` is the step from value i to the next. Both counts are complete only where the width is
    above zero, that is at the end of each run of equal values; absent values come last, with width zero.

    Shapes: ``widths, below_first, below_second`` (K, N); ``n_first, n_second`` (K, 1) observed values and
    ``mean_first, mean_second`` (K, 1) their means, NaN where there is none.

    Example:
        >>> one, two = torch.tensor([[1.0], [3.0]]), torch.tensor([[2.0]])
        >>> pooled = pool(one, one > 0, two, two > 0)
        >>> pooled.below_first, pooled.below_second, pooled.widths
        (tensor([[1, 1, 2]]), tensor([[0, 1, 1]]), tensor([[1., 1., 0.]], dtype=torch.float64))
    """

    widths: Tensor
    below_first: Tensor
    below_second: Tensor
    n_first: Tensor
    n_second: Tensor
    mean_first: Tensor
    mean_second: Tensor

    @cached_property
    def height(self) -> Tensor:
        """Difference (K, N) of the distribution functions times n m: an integer, not rounded before a division."""
        return (self.below_first * self.n_second - self.below_second * self.n_first).abs_()

    @property
    def scale(self) -> Tensor:
        """``n m`` (K,), by which :attr:`height` is to be divided."""
        return (self.n_first * self.n_second)[:, 0].double()


def pool(first: Tensor, first_mask: Tensor, second: Tensor, second_mask: Tensor) -> Pooled:
    """Order two samples together at every level.

    Args:
        first: (n, K) values; masked values are not read.
        first_mask: (n, K) bool.
        second: (m, K) values.
        second_mask: (m, K) bool.

    Raises:
        DataError: If an observed value is not finite.

    Example:
        >>> one, two = torch.tensor([[1.0, 1.0], [3.0, torch.nan]]), torch.tensor([[2.0, 2.0]])
        >>> pool(one, one > 0, two, two > 0).mean_first  # the masked value is ignored
        tensor([[2.],
                [1.]], dtype=torch.float64)
    """
    # Values in single precision are doubles too, so that one path serves both without rounding.
    values = torch.cat([first.T.double(), second.T.double()], 1)
    mask = torch.cat([first_mask.T, second_mask.T], 1)
    # Masked values may be NaN and must not disturb the arithmetic.
    values = torch.where(mask, values, 0.0)
    _refuse_non_finite(values)
    is_second = torch.arange(values.shape[1], device=values.device) >= first.shape[0]
    ordered, seconds = _sort(values, mask, is_second)
    below_second = seconds.cumsum(1)
    positions = torch.arange(1, values.shape[1] + 1, device=values.device)
    # Along contiguous rows, sums are several times faster than down the columns of the arguments.
    (n, m), sums = (
        [part.sum(1, keepdim=True) for part in both.tensor_split([len(first)], 1)] for both in (mask, values)
    )
    widths = ordered.diff(dim=1, append=ordered[:, -1:])
    return Pooled(widths, positions - below_second, below_second, n, m, sums[0] / n, sums[1] / m)


def _refuse_non_finite(values: Tensor) -> None:
    if bool(values.sum().isfinite()):
        return
    bad = int((~values.isfinite()).sum())
    if bad:
        raise DataError(
            f"{bad} observed values that are not finite",
            expected="a finite number wherever the mask is true",
            mend="mask these levels out, or reject the descents that hold them",
        )


def _sort(values: Tensor, mask: Tensor, is_second: Tensor) -> tuple[Tensor, Tensor]:
    """Values (K, N) in ascending order, absent ones last as the largest; and which are of the second sample."""
    largest = torch.where(mask, values, -torch.inf).amax(1, keepdim=True)
    present = torch.where(mask, values, torch.inf)
    # NumPy sorts by vector instructions, several times faster than torch.
    order = torch.from_numpy(np.argsort(present.cpu().numpy(), axis=1)).to(values.device)
    return present.gather(1, order).minimum(largest.nan_to_num(neginf=0.0)), is_second.expand_as(mask).gather(1, order)


CHUNK_VALUES = 1 << 18
"""Values ordered at once on a CPU: 2 MB in float64, so that the passes over them stay in the cache."""
CHUNK_VALUES_DEVICE = 1 << 25
"""The same on an accelerator, which needs many levels at once to be busy: 256 MB."""


def ks_distance(pooled: Pooled) -> Tensor:
    """Kolmogorov-Smirnov distance (K,): the largest difference of the empirical distribution functions.

    NaN where either sample is empty. Equal to ``scipy.stats.ks_2samp``, ties included.

    Example:
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
        >>> one, two = torch.tensor([[0.0], [2.0]]), torch.tensor([[1.0], [5.0]])
        >>> pooled = pool(one, one > -1, two, two > -1)
        >>> wasserstein_distance(pooled)
        tensor([2.], dtype=torch.float64)
    """
    return (pooled.height * pooled.widths).sum(1) / pooled.scale


def error_of_the_mean(pooled: Pooled) -> Tensor:
    """Absolute difference (K,) of the means, in the unit of the values (what the paper calls MAE).

    Example:
        >>> one, two = torch.tensor([[0.0], [2.0]]), torch.tensor([[1.0], [5.0]])
        >>> pooled = pool(one, one > -1, two, two > -1)
        >>> error_of_the_mean(pooled)
        tensor([2.], dtype=torch.float64)
    """
    return (pooled.mean_first - pooled.mean_second).abs()[:, 0]


def error_of_one(forecast: Values, real: Values) -> Tensor:
    """Absolute difference (K,) of one descent and the mean of the real ones; NaN where the one is masked.

    Example:
        >>> one, real = torch.tensor([[2.0]]), torch.tensor([[1.0], [5.0]])
        >>> error_of_one((one, one > 0), (real, real > 0))
        tensor([1.], dtype=torch.float64)
    """
    error = (observed_mean(*real) - forecast[0][0]).abs()
    return error.where(forecast[1][0], torch.nan)


def observed_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean (L,) of the observed values at each level, in float64; NaN where there is none.

    Example:
        >>> observed_mean(torch.tensor([[1.0, 7.0], [3.0, torch.nan]]), torch.tensor([[True, True], [True, False]]))
        tensor([2., 7.], dtype=torch.float64)
    """
    return torch.where(mask, values, 0.0).sum(0, dtype=torch.float64) / mask.sum(0)


MIN_VALUES = 4
"""Fewest values of each set at a level, or of times, from which a distance or a spread is taken: below that, it depends
on the count more than on the flights. By the 25 % rule for the top of the grid, 32 flights leave about 4 on
each side at the highest level."""


def level_spreads(values: Tensor, mask: Tensor) -> Tensor:
    """Standard deviation (L,) of the observed values at each level that has enough of them, else NaN.

    Example:
        >>> level_spreads(torch.tensor([[1.0], [3.0], [1.0], [3.0]]), torch.ones(4, 1) > 0)
        tensor([1.1547], dtype=torch.float64)
    """
    n = mask.sum(0)
    from_mean = torch.where(mask, values - observed_mean(values, mask), 0.0).double()
    return (from_mean.square().sum(0) / (n - 1)).sqrt().where(n >= MIN_VALUES, torch.nan)


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
