r"""Crossover of each flight from a Mach number to a CAS, and its uncertainty by the speeds.

A descent is flown at a Mach number above its crossover and at a CAS below it, so that the CAS is
$v(h) = \min(C, v(M, h))$ with $v(M, h)$ the CAS of the Mach number. Every level of the grid is tried as the lowest at
the Mach number. Given the level, $C$ and $M$ are least squares, joined where they meet (the two estimates miss each
other by $\Delta$, whose variance is known), so that with $S$ the sum of all squares

$$\log p(k) = \log p_0(k) - S_k / (2 \sigma^2 \ell), \qquad
S_k = S_C + S_M + \Delta^2 / (1 / n_C + s^2 / W_M).$$

$\sigma$ is the spread about the best of them and $\ell$ the levels over which it stays alike: speeds wander smoothly,
so that as many levels tell as much as one. The prior $p_0$ is a wide normal about the type's nominal crossover. All of
it is a matter of one flight: no other is looked at.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.units import FT_M
from descentflow.physics.airspeed import cas_to_mach, mach_to_cas_mps

PRIOR_SPREAD_M = 5000 * FT_M
"""Spread of the prior about the nominal crossover: crews' own Mach numbers and CAS lie within some 5,000 ft of it."""
LEAST_SPREAD_MPS = 0.15
"""Least spread of a CAS about the schedule: that of reported speeds, which are whole knots (1 kt / sqrt(12))."""
SURE = 0.95
"""Probability from which a level's regime counts as known."""
SMOOTHER = 2.0
"""By how much more the spread counts than what is left shows: the schedule is fitted to the same wander, and so hides
some of it. With 1, 90 % intervals hold 79 % of 466 known crossovers of simulated B738; with 2, 92 %; with 3, 97 %."""
WINDOW = 30
"""Levels over which the wander is looked at: 3,000 ft, some two minutes. With 15 and with 60, 87 % are held."""
BLOCK = 1024
"""Flights whose candidates are held at once."""
_STEP_MACH = 1e-4


@dataclass(frozen=True)
class Crossovers:
    """Of n flights on L levels.

    Attributes:
        mach_share: (n, L) probability that a level is flown at the Mach number; it grows upwards.
        altitude_m: (L,) of the levels.

    Example:
        >>> altitude_m = torch.arange(150.0, 351.0).double() * 30.48
        >>> cas = mach_to_cas_mps(0.76, altitude_m).clamp(max=144.0)[None]
        >>> found = find_crossovers(cas, torch.ones_like(cas, dtype=torch.bool), altitude_m, nominal_m=9500.0)
        >>> found.quantile_m(0.5) / 30.48  # flight level
        tensor([311...], dtype=torch.float64)
    """

    mach_share: Tensor
    altitude_m: Tensor

    @property
    def holds_mach(self) -> Tensor:
        """(n, L) whether a level is more probably flown at the Mach number than at the CAS."""
        return self.mach_share > 0.5

    @property
    def sure(self) -> Tensor:
        """(n, L) whether the regime of a level is known, see :data:`SURE`."""
        return (self.mach_share >= SURE) | (self.mach_share <= 1 - SURE)

    def rows(self, index: Tensor) -> "Crossovers":
        """Those of the flights at these positions."""
        return Crossovers(self.mach_share[index], self.altitude_m)

    def levels(self, low: int, high: int) -> "Crossovers":
        """The same on the levels from an index up to another."""
        return Crossovers(self.mach_share[:, low:high], self.altitude_m[low:high])

    def quantile_m(self, share: float) -> Tensor:
        """Altitude (n,) below which the crossover lies with this probability; infinite where that is off the grid."""
        share_of = self.mach_share
        place = (share_of < share).sum(1)  # the lowest level with as much
        inner = place.clamp(1, len(self.altitude_m) - 1)
        upper, lower = share_of.gather(1, inner[:, None])[:, 0], share_of.gather(1, inner[:, None] - 1)[:, 0]
        part = ((share - lower) / (upper - lower).clamp(min=1e-12)).clamp(0.0, 1.0)
        found = torch.lerp(self.altitude_m[inner - 1], self.altitude_m[inner], part)
        found = torch.where(place == 0, -torch.inf, found)
        return torch.where(place == len(self.altitude_m), torch.inf, found)


def find_crossovers(cas_mps: Tensor, mask: Tensor, altitude_m: Tensor, nominal_m: float) -> Crossovers:
    """Find the crossover of each flight.

    Args:
        cas_mps: (n, L) calibrated airspeed; any positive value where masked.
        mask: (n, L) observed.
        altitude_m: (L,) ascending pressure altitudes.
        nominal_m: Crossover of the type's standard speeds, in metres; infinite for a type without a Mach number, whose
            flights hold CAS on every level.

    Example:
        >>> altitude_m = torch.arange(150.0, 351.0).double() * 30.48
        >>> cas = torch.full((1, 201), 140.0).double()  # held all the way down
        >>> seen = torch.ones_like(cas, dtype=torch.bool)
        >>> bool(find_crossovers(cas, seen, altitude_m, nominal_m=9500.0).holds_mach[0, :190].any())
        False
    """
    if nominal_m == torch.inf:
        return Crossovers(torch.zeros_like(cas_mps, dtype=torch.float64), altitude_m)
    prior = _log_prior(altitude_m, nominal_m)
    blocks = zip(torch.split(cas_mps.double(), BLOCK), torch.split(mask, BLOCK), strict=True)
    return Crossovers(torch.cat([_mach_share(cas, seen, altitude_m, prior) for cas, seen in blocks]), altitude_m)


def _log_prior(altitude_m: Tensor, nominal_m: float) -> Tensor:
    """Log probability (L + 1,) that a level, by its place, is the lowest at the Mach number; last, that none is."""
    below = torch.special.ndtr((altitude_m - nominal_m) / PRIOR_SPREAD_M)
    zero, one = below.new_zeros(1), below.new_ones(1)
    return torch.cat([zero, below, one]).diff().clamp(min=1e-300).log()


def _mach_share(cas: Tensor, mask: Tensor, altitude_m: Tensor, prior: Tensor) -> Tensor:
    mach = cas_to_mach(cas, altitude_m)
    steep = (mach_to_cas_mps(mach + _STEP_MACH, altitude_m) - mach_to_cas_mps(mach - _STEP_MACH, altitude_m)) / (
        2 * _STEP_MACH
    )
    seen = mask.to(cas)
    below = _sums(seen, cas)
    above = tuple(total[:, -1:] - total for total in _sums(seen * steep.square(), mach))
    (n_c, mean_c, square_c), (weight_m, mean_m, square_m) = _moments(*below), _moments(*above)
    squares = square_c + square_m + _apart(n_c, mean_c, weight_m, mean_m, altitude_m)
    best = squares.argmin(1, keepdim=True)
    at_mach = torch.arange(cas.shape[1]) >= best
    flown = torch.where(
        at_mach, mach_to_cas_mps(mean_m.gather(1, best).clamp(min=0.05), altitude_m), mean_c.gather(1, best)
    )
    spread = _noise(torch.where(mask, cas - flown, 0.0), seen)
    log_share = prior - squares / (2 * spread)
    return log_share.softmax(1).cumsum(1)[:, :-1]


def _sums(weight: Tensor, values: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Sums (n, L + 1) over the levels below each place: of weights, of values and of their squares."""
    sums = (weight, weight * values, weight * values.square())
    zero, one, two = (torch.nn.functional.pad(each.cumsum(1), (1, 0)) for each in sums)
    return zero, one, two


def _moments(zero: Tensor, one: Tensor, two: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Weight, mean and sum of squares about the mean."""
    mean = one / zero.clamp(min=1e-9)
    return zero, mean, (two - one * mean).clamp(min=0.0)


def _apart(n_c: Tensor, mean_c: Tensor, weight_m: Tensor, mean_m: Tensor, altitude_m: Tensor) -> Tensor:
    """Cost (n, L + 1) of joining both: nothing where one of them has no level."""
    step = altitude_m.diff().mean()
    edges = torch.cat([altitude_m - step / 2, altitude_m[-1:] + step / 2])
    both = (n_c > 0.5) & (weight_m > 0.5)
    mach = torch.where(both, mean_m, 0.7)
    meets = mach_to_cas_mps(mach, edges)
    steep = (mach_to_cas_mps(mach + _STEP_MACH, edges) - meets) / _STEP_MACH
    variance = 1 / n_c.clamp(min=0.5) + steep.square() / weight_m.clamp(min=0.5)
    return torch.where(both, (mean_c - meets).square() / variance, 0.0)


def _noise(left: Tensor, seen: Tensor) -> Tensor:
    """Variance of what is left (n, 1), times the levels over which it stays alike."""
    count = seen.sum(1, keepdim=True)
    total = left.square().sum(1, keepdim=True)
    variance = (total / (count - 2).clamp(min=1.0)).clamp(min=LEAST_SPREAD_MPS**2)
    window = min(WINDOW, left.shape[1])
    ones = left.new_ones(1, 1, window)
    together, of_them = (torch.nn.functional.conv1d(one[:, None], ones)[:, 0] for one in (left, seen))
    alike = together.square().sum(1, keepdim=True) / of_them.sum(1, keepdim=True).clamp(min=1.0)
    alike = alike / (total / count.clamp(min=1.0)).clamp(min=1e-12)
    return SMOOTHER * variance * alike.clamp(min=1.0)
