"""Where the rate of a descent jumps between two levels, so that the time quadrature can stop on either side."""

from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.performance.aircraft import Aircraft
from descentflow.performance.constants import TROPOPAUSE_M
from descentflow.performance.forces import descent_thrust_floor_ft
from descentflow.performance.transition import transition_altitude_m
from descentflow.units import FT_M

SIDE_M = 0.01
"""How far from a jump its two sides are evaluated: beyond the slack of the thresholds themselves."""


class Breaks(NamedTuple):
    """Extra altitudes (b,) on both sides of each jump inside the grid, and how to place them among the levels.

    ``base`` and ``share`` (b,) continue a profile to each extra by a line through the two levels ``base`` and
    ``base + 1`` of its own side; ``order`` (L + b,) sorts levels followed by extras, ``levels_at`` (L,) says
    where the levels are in that order.
    """

    altitude_m: Tensor
    base: Tensor
    share: Tensor
    order: Tensor
    levels_at: Tensor

    def continued(self, values: Tensor) -> Tensor:
        """Values (n, L) of the levels continued to the extras: (n, b).

        From its own side, because either the drag or the rate jumps: inferred drag jumps so that the observed
        rate does not, and a smooth drag makes the rate jump.
        """
        return torch.lerp(values[:, self.base], values[:, self.base + 1], self.share.to(values))


def rate_breaks(aircraft: Aircraft, altitude_m: Tensor) -> Breaks:
    """Find the jumps of idle thrust and energy share factor inside a grid.

    They are BADA's own: transition altitude, tropopause and H_p,des. A trapezoid across the transition, where the
    rate changes by a third, would miss up to half a second of a ten-minute descent.

    Args:
        aircraft: Coefficients; of tensor coefficients the first entry places the jumps.
        altitude_m: (L,) ascending altitudes.
    """
    jumps = (transition_altitude_m(aircraft), TROPOPAUSE_M, descent_thrust_floor_ft(aircraft) * FT_M)
    where = [float(torch.as_tensor(jump).detach().reshape(-1)[0]) for jump in jumps]
    low, high = float(altitude_m[0]), float(altitude_m[-1])
    sides = [side for jump in where if low + SIDE_M < jump < high - SIDE_M for side in (jump - SIDE_M, jump + SIDE_M)]
    # Placed in float64: in float32 the two sides of a jump at 10 km would be one number.
    levels, extras = altitude_m.double(), torch.tensor(sides, dtype=torch.float64, device=altitude_m.device)
    below = torch.arange(len(sides), device=altitude_m.device) % 2 == 0
    cell = (torch.searchsorted(levels, extras, right=True) - 1).clamp(0, len(levels) - 2)
    base = torch.where(below, cell - 1, cell + 1).clamp(0, len(levels) - 2)
    share = (extras - levels[base]) / (levels[base + 1] - levels[base])
    order = torch.cat([levels, extras]).argsort(stable=True)
    levels_at = order.argsort()[: len(levels)]
    return Breaks(extras.to(altitude_m), base, share, order, levels_at)
