"""How far apart the draws of a prediction should lie for its 90 % intervals to hold nine times in ten.

A density learnt from a thousand flights knows the rest of a flight too well: its means and covariances are nearest to
the flights that it was fitted to, and flights stray further than normals do. How far, flights say that it was not
fitted to: of each, how far outside of its interval the time lay that was flown, in widths of the interval (conformal
prediction: Romano, Patterson and Candes 2019, doi:10.48550/arXiv.1905.03222).
"""

from collections.abc import Sequence

import torch
from torch import Tensor

HELD = 0.9
"""Share of the times that intervals shall hold."""
LEAST, MOST = 0.5, 3.0
"""Ends of the factor: a density that is further off should be fitted again."""


def misses(drawn_s: Tensor, flown_s: Tensor) -> Tensor:
    """How far from the median times (k,) lay, in distances from the median to the end of the interval on their side.

    Args:
        drawn_s: (n, k) of n continuations, to each of k levels.
        flown_s: (k,) what was flown.

    Example:
        >>> drawn = torch.arange(101.0)[:, None]  # median 50, interval 5 to 95
        >>> misses(drawn, torch.tensor([95.0])), misses(drawn, torch.tensor([27.5]))
        (tensor([1.]), tensor([0.5000]))
    """
    ends = torch.tensor([0.5 - HELD / 2, 0.5, 0.5 + HELD / 2], dtype=drawn_s.dtype)
    low, middle, high = drawn_s.quantile(ends, dim=0)
    least = torch.finfo(drawn_s.dtype).tiny
    above, below = (high - middle).clamp(min=least), (middle - low).clamp(min=least)
    return torch.where(flown_s > middle, (flown_s - middle) / above, (middle - flown_s) / below)


def holding_spread(of_flights: Sequence[Tensor]) -> float:
    """Factor of the draws' distance from their mean with which 90 % intervals hold 90 % of the times.

    Args:
        of_flights: Misses (k,) of each flight, as many as it has. The share is raised as if one flight more had been
            missed: so it is held by flights that are still to come. Without any the factor is one.

    Example:
        >>> generator = torch.Generator().manual_seed(0)
        >>> drawn = torch.randn(4000, 1, generator=generator)
        >>> flown = 1.2 * torch.randn(4000, generator=generator)  # strays further than what is drawn
        >>> abs(holding_spread([misses(drawn, one[None]) for one in flown]) - 1.2) < 0.05
        True
    """
    if not of_flights:
        return 1.0
    share = min(HELD * (1 + 1 / len(of_flights)), 1.0)
    return float(torch.cat(list(of_flights)).quantile(share).clamp(min=LEAST, max=MOST))
