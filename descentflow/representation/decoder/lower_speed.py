"""A Mach number above and a CAS below: the lower of both speeds is flown; a flight's crossover is where they meet.

The crossover lies between two levels and not on one. Its place carries gradients: as a flight changes over later, its
time changes.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.physics.airspeed import mach_to_cas_mps


class LowerSpeed(NamedTuple):
    """Drag and speed of n flights on L levels.

    Attributes:
        cas_mps: (n, L) calibrated airspeed.
        ahead_mps: (n, L) CAS of the Mach number minus the CAS: below zero where the Mach number is held.

    Example:
        >>> altitude_m = torch.tensor([6000.0, 12000.0])
        >>> flown = lower_of(torch.full((1, 2), 0.78), torch.full((1, 2), 140.0), altitude_m)
        >>> flown.at_mach
        tensor([[False,  True]])
    """

    cas_mps: Tensor
    ahead_mps: Tensor

    @property
    def at_mach(self) -> Tensor:
        """(n, L) whether the Mach number is held."""
        return self.ahead_mps < 0


class FlownCurves(NamedTuple):
    """Drag (N) of n descents on L levels, and CAS (m/s) with each flight's own crossover where it has one.

    Attributes:
        drag_n: (n, L).
        cas_mps: (n, L).
        ahead_mps: (n, L) as :class:`LowerSpeed` has it; None where
            speed is one CAS profile, so that the type's transition holds.

    Example:
        >>> FlownCurves(torch.full((1, 2), 4e4), torch.full((1, 2), 140.0)).ahead_mps is None
        True
    """

    drag_n: Tensor
    cas_mps: Tensor
    ahead_mps: Tensor | None = None


def lower_of(mach: Tensor, cas_mps: Tensor, altitude_m: Tensor) -> LowerSpeed:
    """The schedule of a Mach number (n, L) and a CAS (n, L) on altitudes (L,).

    Example:
        >>> lower_of(torch.full((1, 1), 0.78), torch.full((1, 1), 140.0), torch.tensor([6000.0])).cas_mps
        tensor([[140.]])
    """
    by_mach = mach_to_cas_mps(mach, altitude_m)
    return LowerSpeed(torch.minimum(by_mach, cas_mps), by_mach - cas_mps)


def with_crossovers(legs: Tensor, slowness: Tensor, ahead_mps: Tensor, half_step_m: Tensor) -> Tensor:
    """Times between neighbouring levels, those in which a crossover lies split there.

    Below and above the crossover the slowness is that of the level on its own side: a trapezoid across it, where the
    rate changes by a third, would miss up to half a second. What it changes from level to level otherwise, some 0.3 %,
    is left out in that one cell.

    Args:
        legs: (n, L - 1) times as if there were none.
        slowness: (n, L) seconds per metre.
        ahead_mps: (n, L), see :class:`LowerSpeed`.
        half_step_m: (L - 1,) half the distance of neighbouring levels.

    Example:
        >>> slowness, ahead = torch.tensor([[0.1, 0.2]]), torch.tensor([[1.0, -3.0]])  # a quarter of the way up
        >>> with_crossovers(torch.zeros(1, 1), slowness, ahead, torch.tensor([50.0]))
        tensor([[17.5000]])
    """
    lower, upper = ahead_mps[:, :-1], ahead_mps[:, 1:]
    across = (lower < 0) != (upper < 0)
    share = lower / torch.where(across, lower - upper, 1.0)
    split = 2 * half_step_m * (share * slowness[:, :-1] + (1 - share) * slowness[:, 1:])
    return torch.where(across, split, legs)
