"""Two gappy samples in one order at every level: what all distances between distribution functions need."""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from descentflow.core.errors import DataError

Values = tuple[Tensor, Tensor]
"""Values and mask, (n, K) each: n descents on K levels, or one time each."""

_ABSENT = torch.iinfo(torch.int64).max
_MAGNITUDE = torch.iinfo(torch.int64).max


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
    ordered, seconds = _sort_packed(values, mask, is_second)
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


def _sort_packed(values: Tensor, mask: Tensor, is_second: Tensor) -> tuple[Tensor, Tensor]:
    """Values (K, N) in ascending order, absent ones last and equal to the largest; and which are of the second sample.

    Sorting integers alone is many times faster than sorting doubles with their positions. So each double becomes an
    integer of the same order (its bits, those of negative numbers reversed), counted from the level's smallest,
    and the sample's label takes the lowest bit. Nothing is rounded: the integers of one level need fewer than 62
    bits unless values of both signs meet on it; such levels are sorted the slow way. The two zeros become
    neighbours, with a step of width zero between them.
    """
    keys = _to_key(values)
    low = torch.where(mask, keys, _ABSENT).amin(1, keepdim=True)
    high = torch.where(mask, keys, -_ABSENT).amax(1, keepdim=True)
    empty = low > high
    low, high = low.masked_fill(empty, 0), high.masked_fill(empty, 0)
    if bool(((high >> 2) - (low >> 2) >= 1 << 59).any()):
        return _sort_with_positions(values, mask, is_second)
    packed = _sort(torch.where(mask, (keys - low) << 1 | is_second, _ABSENT))
    return _to_value(((packed >> 1) + low).where(packed < _ABSENT, high)), packed & 1


def _sort_with_positions(values: Tensor, mask: Tensor, is_second: Tensor) -> tuple[Tensor, Tensor]:
    largest = torch.where(mask, values, -torch.inf).amax(1, keepdim=True)
    ordered, order = torch.where(mask, values, torch.inf).sort(1)
    return ordered.minimum(largest.nan_to_num(neginf=0.0)), is_second.long().expand_as(values).gather(1, order)


def _sort(packed: Tensor) -> Tensor:
    if packed.device.type == "cpu":
        # torch always sorts positions along; numpy sorts bare integers with vector instructions, in place.
        packed.numpy().sort(axis=1)
        return packed
    return packed.sort(1).values


def _to_key(values: Tensor) -> Tensor:
    bits = values.view(torch.int64)
    return bits ^ (bits >> 63 & _MAGNITUDE)


def _to_value(keys: Tensor) -> Tensor:
    return (keys ^ (keys >> 63 & _MAGNITUDE)).view(torch.float64)
