"""Test of values of flights for two groups, with the share in the upper one."""

import torch
from torch import Tensor

APART = 2.0
"""Two groups are told apart if their means are so many spreads within them apart; else all flights are one."""


def two_groups(values: Tensor) -> float:
    """Share of the upper of two groups, split where the spread within them is least; one if they are not apart.

    Example:
        >>> two_groups(torch.tensor([0.0, 0.1, -0.1, 1.0, 1.1]))
        0.4
    """
    ordered = values.sort().values
    n = len(ordered)
    count = torch.arange(1, n, dtype=ordered.dtype)
    total, square = ordered.cumsum(0), ordered.square().cumsum(0)
    low = square[:-1] - total[:-1] ** 2 / count
    high = (square[-1] - square[:-1]) - (total[-1] - total[:-1]) ** 2 / (n - count)
    # A group of a few stragglers is none.
    usable = (count >= 0.08 * n) & (count <= 0.92 * n)
    k = int(torch.where(usable, low + high, torch.inf).argmin())
    apart = (total[-1] - total[k]) / (n - k - 1) - total[k] / (k + 1)
    within = ((low + high)[k].clamp(min=0.0) / n).sqrt()
    return float(n - k - 1) / n if float(apart) > 2 * APART * float(within) else 1.0
