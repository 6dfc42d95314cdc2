"""Where the extremes of more flights would be expected, seen from those of few.

The paper bounds samples by the extremes of its training flights, of which it has thousands. The extremes of a few lie
close to their mean: a perfect density of twenty flights has most of its draws outside of them at one level or another.
"""

import torch
from torch import Tensor

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

    Example:
        >>> moved_outward(torch.tensor([150.0]), torch.tensor([140.0]), torch.tensor([20])).round(decimals=1)
        tensor([158.9000], dtype=torch.float64)
    """
    return mean + outward(n) * (extreme - mean)


def _expected_extreme(n: Tensor) -> Tensor:
    n = n.to(torch.float64)
    found: Tensor = torch.special.ndtri((n - 0.375) / (n + 0.25))
    return found
