r"""Spread of the continuations of a prediction at which its 90 % intervals hold nine times in ten.

A density learnt from a thousand flights knows the rest of a flight too well: its means and covariances are nearest to
the flights that it was fitted to, and flights stray further than normals do. Of the level just below the last observed
one, seconds away, it knows nothing of what reports are off by. How far intervals are off, flights say that the density
was not fitted to: of each, how far from the median the time lay that was flown, in distances to the end of the interval
(conformal prediction: Romano, Patterson and Candes 2019, doi:10.48550/arXiv.1905.03222). So times are moved,

.. math:: t'_{il} = m_l + \varphi(k_l)\,(t_{il} - m_l),

about the median :math:`m_l` of all continuations at level l, by a factor that depends on how many levels :math:`k_l` it
lies below the last observed one. Rates follow, so that every continuation is flown in the times that it has; speeds and
drag stay as they were drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.representation.decoder.trajectories import Trajectories

HELD = 0.9
"""Share of the times that intervals shall hold."""
LEAST, MOST = 0.5, 4.0
"""Ends of the factor: a density that is further off should be fitted again."""
FEWEST_BY_LEVEL = 50
"""Flights from which on each depth has a factor of its own: of so many a share of 90 % is known to 4 %."""
LEAST_STEP = 0.2
"""Of the time from one level to the next, which is left at least: a descent does not turn back."""


@dataclass(frozen=True)
class TimeSpread:
    """Factors (K,) of the distance of times from their median at numbers (K,) of levels below the last observed one.

    Example:
        >>> spread = TimeSpread(torch.tensor([1.0, 4.0, 16.0]), torch.tensor([2.0, 1.0, 1.2]))
        >>> spread.at(torch.tensor([1.0, 2.0, 8.0, 99.0]))  # between them on a logarithmic scale
        tensor([2.0000, 1.5000, 1.1000, 1.2000])
    """

    ahead: Tensor
    factor: Tensor

    def at(self, ahead: Tensor) -> Tensor:
        """Factors at numbers of levels, one and more."""
        if len(self.ahead) == 1:
            return self.factor.expand_as(ahead)
        place, known = ahead.clamp(min=1).log(), self.ahead.log()
        upper = torch.searchsorted(known, place).clamp(1, len(known) - 1)
        low, high = known[upper - 1], known[upper]
        share = ((place - low) / (high - low)).clamp(0.0, 1.0)
        return self.factor[upper - 1] + share * (self.factor[upper] - self.factor[upper - 1])

    def applied(self, flown: Trajectories) -> Trajectories:
        """Continuations, all from one level, with their times moved and rates that go with them.

        Example:
            >>> from descentflow.generation.prediction.predict import predict
            >>> one = predict("best.ckpt", "descents.parquet", from_fl=290, n=50).flights[0].trajectories
            >>> wide = TimeSpread(torch.ones(1), 2 * torch.ones(1)).applied(one)
            >>> round(float((wide.time_s.std(0) / one.time_s.std(0))[0]), 1)
            2.0
        """
        last = int(flown.entry[0])
        if last == 0 or self is AS_DRAWN:
            return flown
        # From the last observed level downwards; there the time is zero.
        time_s = flown.time_s[:, : last + 1].flip(1)
        factor = self.at(torch.arange(1, last + 1, dtype=time_s.dtype).to(self.ahead)).to(time_s)
        middle = time_s[:, 1:].quantile(0.5, dim=0)
        moved = torch.nn.functional.pad(middle + factor * (time_s[:, 1:] - middle), (1, 0))
        before = time_s.diff(dim=1)
        steps = torch.maximum(moved.diff(dim=1), LEAST_STEP * before)
        found, slower = flown.time_s.clone(), (steps / before).flip(1)
        found[:, :last] = steps.cumsum(1).flip(1)
        beside = torch.nn.functional.pad(slower[:, None], (1, 1), mode="replicate")[:, 0]
        rate_mps = flown.rate_mps.clone()
        rate_mps[:, : last + 1] /= 0.5 * (beside[:, 1:] + beside[:, :-1])
        return replace(flown, time_s=found, rate_mps=rate_mps)


AS_DRAWN = TimeSpread(torch.ones(1, dtype=torch.float64), torch.ones(1, dtype=torch.float64))
"""Times as they are."""


def depths(n_levels: int) -> Tensor:
    """Numbers of levels below the last observed one at which intervals are compared with flights: 1, 2, 4, ..., all.

    Example:
        >>> depths(70)
        tensor([ 1,  2,  4,  8, 16, 32, 70])
    """
    powers = [1 << k for k in range(n_levels.bit_length()) if 1 << k <= max(n_levels // 2, 1)]
    return torch.tensor([*powers, n_levels] if n_levels > 1 else [1])


def misses(drawn_s: Tensor, flown_s: Tensor) -> Tensor:
    """Distance of times (k,) from the median, in distances from the median to the end of the interval on their side.

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


def holding_spread(ahead: Tensor, of_flights: Sequence[Tensor]) -> TimeSpread:
    """Factors with which 90 % intervals hold 90 % of the times, at each depth; of few flights one for all.

    Args:
        ahead: (k,) levels below the last observed one.
        of_flights: Misses (k,) of each flight, NaN where it has none. The share is raised as if one flight more had
            been missed: so it is held by flights that are still to come. Without any the factor is one.

    Example:
        >>> generator = torch.Generator().manual_seed(0)
        >>> drawn = torch.randn(4000, 1, generator=generator)
        >>> flown = 1.2 * torch.randn(4000, generator=generator)  # strays further than what is drawn
        >>> found = holding_spread(torch.tensor([1]), [misses(drawn, one[None]) for one in flown])
        >>> abs(float(found.factor) - 1.2) < 0.05
        True
    """
    if not of_flights:
        return AS_DRAWN
    missed = torch.stack(list(of_flights)).double()
    share = min(HELD * (1 + 1 / len(missed)), 1.0)
    if len(missed) < FEWEST_BY_LEVEL:
        factor = missed.flatten().nanquantile(share).expand(len(ahead))
    else:
        factor = missed.nanquantile(share, dim=0)
    return TimeSpread(ahead.double(), factor.nan_to_num(1.0).clamp(min=LEAST, max=MOST))
