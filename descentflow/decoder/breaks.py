"""Where the rate of a descent jumps between two levels, so that the time quadrature can stop on either side."""

from typing import NamedTuple

import numpy as np
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
    """Extra altitudes (b,) on both sides of each jump inside the grid, and how they enter the time of their cells.

    ``base`` and ``share`` (b) continue a profile to each extra by a line through the two levels ``base`` and
    ``base + 1`` of its own side. ``cells`` (c) are the cells that hold extras, with the weights in metres of the
    slowness at the level below, at the level above and, in ``inner`` (b, c), at the extras: together the trapezoid rule
    from level to extra, between extras, and on to the next level.
    """

    altitude_m: Tensor
    base: tuple[int, ...]
    share: tuple[float, ...]
    cells: tuple[tuple[int, float, float], ...]
    inner: Tensor

    def continued(self, values: Tensor) -> Tensor:
        """Values (..., L) of the levels continued to the extras: (..., b).

        From its own side, because either the drag or the rate jumps: inferred drag jumps so that the observed
        rate does not, and a smooth drag makes the rate jump.
        """
        if not self.base:
            return values[..., :0]
        # Column by column: indexing by a tensor takes longer than all the arithmetic.
        columns = zip(self.base, self.share, strict=True)
        return torch.stack([torch.lerp(values[..., k], values[..., k + 1], share) for k, share in columns], -1)

    def leg_times(self, slowness: Tensor, extra: Tensor, half_step_m: Tensor) -> Tensor:
        """Time between neighbouring levels (n, L - 1) from slowness on the levels (n, L) and at the extras (n, b).

        Args:
            slowness: (n, L) seconds a metre on the levels.
            extra: (n, b) the same at the extras.
            half_step_m: (L - 1,) half the distance of neighbouring levels.
        """
        legs = (slowness[:, 1:] + slowness[:, :-1]).mul_(half_step_m.to(slowness))
        between = (extra @ self.inner.to(slowness)).unbind(1) if self.cells else ()
        for (cell, lower, upper), inner in zip(self.cells, between, strict=True):
            legs[:, cell] = slowness[:, cell] * lower + slowness[:, cell + 1] * upper + inner
        return legs


def rate_breaks(aircraft: Aircraft, altitude_m: Tensor) -> Breaks:
    """Find the jumps of idle thrust and energy share factor inside a grid.

    They are BADA's own: transition altitude, tropopause and H_p,des. A trapezoid across the transition, where the
    rate changes by a third, would miss up to half a second of a ten-minute descent.

    Args:
        aircraft: Coefficients; of tensor coefficients the first entry places the jumps.
        altitude_m: (L,) ascending altitudes.
    """
    jumps = (transition_altitude_m(aircraft), TROPOPAUSE_M, descent_thrust_floor_ft(aircraft) * FT_M)
    where = sorted(float(torch.as_tensor(jump).detach().reshape(-1)[0]) for jump in jumps)
    # Placed in float64: in float32 the two sides of a jump at 10 km would be one number.
    levels = np.asarray(altitude_m.detach().cpu(), dtype=np.float64)
    inside = [jump for jump in where if levels[0] + SIDE_M < jump < levels[-1] - SIDE_M]
    extras = np.array([side for jump in inside for side in (jump - SIDE_M, jump + SIDE_M)])
    holds = np.clip(np.searchsorted(levels, extras, side="right") - 1, 0, len(levels) - 2)
    below = np.arange(len(extras)) % 2 == 0
    base = np.clip(np.where(below, holds - 1, holds + 1), 0, len(levels) - 2)
    share = (extras - levels[base]) / (levels[base + 1] - levels[base])
    cells, inner = [], np.zeros((len(extras), len(set(holds.tolist()))))
    for column, cell in enumerate(sorted(set(holds.tolist()))):
        # Half of the step on either side of each point, levels first and last.
        half = np.diff(np.concatenate([[levels[cell]], extras[holds == cell], [levels[cell + 1]]])) / 2
        inner[holds == cell, column] = half[1:] + half[:-1]
        cells.append((cell, float(half[0]), float(half[-1])))
    return Breaks(
        torch.as_tensor(extras).to(altitude_m),
        tuple(base.tolist()),
        tuple(share.tolist()),
        tuple(cells),
        torch.as_tensor(inner).to(altitude_m),
    )
