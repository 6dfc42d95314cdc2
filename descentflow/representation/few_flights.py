"""Where the extremes of more flights would be expected, seen from those of few.

The paper bounds samples by the extremes of its training flights, of which it has thousands. The extremes of a few lie
close to their mean: a perfect density of twenty flights has most of its draws outside of them at one level or another.
And the extremes of each level are of a few flights, which may be alike there and not at the next: of 14 flights that
vary every twenty levels, a perfect density has a fifth of its draws outside of extremes that were moved level by level.
"""

import torch
from torch import Tensor

from descentflow.representation.fpca.roughness import SPREAD_WEIGHT, smoother

MANY = 3000
"""Flights from which on extremes are taken as they are: what a type has in the paper, of 41,011 flights of 13 types."""


def outward(n: Tensor) -> Tensor:
    """Factor (...) by which extremes of n flights are moved away from the mean: to where those of 3,000 are expected.

    For a normal distribution, whose expected extremes are Blom's (1958); 1 from 3,000 flights on.

    Args:
        n: (...) flights, at least one.

    Example:
        >>> outward(torch.tensor([2, 20, 100, 3000, 4000])).round(decimals=2)
        tensor([5.9900, 1.8900, 1.4100, 1.0000, 1.0000], dtype=torch.float64)
    """
    # One flight alone says nothing of a spread: it counts as two.
    return _expected_extreme(torch.tensor(MANY)) / _expected_extreme(n.clamp(min=2, max=MANY))


def moved_outward(extreme: Tensor, mean: Tensor, n: Tensor) -> Tensor:
    """Extremes (L,) of n (L,) flights with a mean (L,), where those of at least 3,000 would be expected.

    Of fewer flights they lie as far from the mean as those of the levels about them, at the least.

    Args:
        extreme: (L,) all of them below the mean, or all above.
        mean: (L,).
        n: (L,) flights that show each level.

    Example:
        >>> mean, n = torch.full((3,), 140.0), torch.tensor([20, 20, 20])
        >>> moved_outward(torch.tensor([150.0, 150.0, 150.0]), mean, n).round(decimals=1)
        tensor([158.9000, 158.9000, 158.9000], dtype=torch.float64)
        >>> moved_outward(torch.tensor([150.0, 141.0, 150.0]), mean, n).round(decimals=1)  # neighbours tell
        tensor([158.9000, 153.2000, 158.9000], dtype=torch.float64)
    """
    far = outward(n) * (extreme - mean)
    about = smoother(n.to(far), SPREAD_WEIGHT) @ far
    further = (about * far.sign() > far.abs()) & (n < MANY)
    return mean + torch.where(further, about, far)


def _expected_extreme(n: Tensor) -> Tensor:
    n = n.to(torch.float64)
    found: Tensor = torch.special.ndtri((n - 0.375) / (n + 0.25))
    return found
