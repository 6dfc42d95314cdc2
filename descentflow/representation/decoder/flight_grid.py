"""Jumps of a descent's rate between two levels, so that the time quadrature can stop on either side."""

from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.core.constants import TROPOPAUSE_M
from descentflow.core.tensors import Number
from descentflow.physics.level_table import LevelTable, level_table
from descentflow.physics.performance_model import PerformanceModel

SIDE_M = 0.01
"""Distance from a jump at which its two sides are evaluated: beyond the slack of the thresholds themselves."""


class Breaks(NamedTuple):
    """Trapezoid rule from level to level that stops at both sides, the b extras, of each jump inside the grid.

    Time is the integral of slowness over altitude. Weights are half the steps to the neighbouring points, in metres,
    and negative, for so is the slowness of a descent.
    ``lower_m`` and ``upper_m`` (L - 1,) are those of the levels below and above each cell, ``extra_m`` (b,) those of
    the extras at ``altitude_m``, which lie in ``cells``. A line through the levels ``base`` and ``base + 1`` of its own
    side, at ``share`` (b,) of the way, continues a profile to each extra. Weights carry gradients where the
    coefficients that place a jump do: time changes as the jump moves.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> breaks = rate_breaks(aircraft("A320"), torch.arange(150.0, 351.0).double() * 30.48)
        >>> len(breaks.cells), breaks.continued(torch.full((1, 201), 140.0).double()).tolist()  # one jump, two sides
        (2, [[140.0, 140.0]])
    """

    altitude_m: Tensor
    base: Tensor
    share: Tensor
    cells: tuple[int, ...]
    lower_m: Tensor
    upper_m: Tensor
    extra_m: Tensor

    def continued(self, values: Tensor) -> Tensor:
        """Values (..., L) of the levels continued to the extras: (..., b).

        From its own side, because either the drag or the rate jumps: inferred drag jumps so that the observed
        rate does not, and a smooth drag makes the rate jump.
        """
        columns = values.movedim(-1, 0)  # taken as rows, which is seven times as fast
        below, above = (columns[place].movedim(0, -1) for place in (self.base, self.base + 1))
        return torch.lerp(below, above, self.share.to(values))


def rate_breaks(aircraft: PerformanceModel, altitude_m: Tensor) -> Breaks:
    """Find the jumps of idle thrust and energy share factor inside a grid.

    They are BADA's own: transition altitude, tropopause and H_p,des. A trapezoid across the transition, where the
    rate changes by a third, would miss up to half a second of a ten-minute descent.

    Args:
        aircraft: Coefficients; of tensor coefficients the first entry places the jumps, and gets their gradient.
        altitude_m: (L,) ascending altitudes.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> breaks = rate_breaks(aircraft("A320"), torch.arange(150.0, 351.0) * 30.48)
        >>> [round(float(h)) for h in breaks.altitude_m[::2] / 30.48]  # H_p,des is below, the tropopause above
        [318]
    """
    places: tuple[Number, ...] = (aircraft.transition_altitude_m(), TROPOPAUSE_M, *aircraft.thrust_breaks_m())
    # Placed in float64: in float32 the two sides of a jump at 10 km would be one number.
    jumps = [torch.as_tensor(place).reshape(-1)[0].to("cpu", torch.float64) for place in places]
    levels = altitude_m.detach().to("cpu", torch.float64).contiguous()
    lowest, highest = float(levels[0]) + SIDE_M, float(levels[-1]) - SIDE_M
    inside = [jump for jump in sorted(jumps, key=lambda jump: jump.item()) if lowest < jump.item() < highest]
    sides = [side for jump in inside for side in (jump - SIDE_M, jump + SIDE_M)]
    extras = torch.stack(sides) if sides else levels[:0]
    last = len(levels) - 2
    cells = (torch.searchsorted(levels, extras.detach(), right=True) - 1).clamp(0, last)
    below = torch.arange(len(extras)) % 2 == 0
    base = torch.where(below, cells - 1, cells + 1).clamp(0, last)
    share = (extras - levels[base]) / (levels[base + 1] - levels[base])
    points, order = torch.cat([levels, extras]).sort(stable=True)
    half = torch.nn.functional.pad(points.diff() / -2, (1, 1))
    # Half of the step downwards and upwards of each level, then of each extra.
    downwards, upwards = (steps[order.argsort()] for steps in (half[:-1], half[1:]))
    weights = upwards[: last + 1], downwards[1 : last + 2], (downwards + upwards)[last + 2 :]
    extra_m, share, lower_m, upper_m, extra_weights_m = (v.to(altitude_m) for v in (extras, share, *weights))
    base = base.to(altitude_m.device)
    return Breaks(extra_m, base, share, tuple(cells.tolist()), lower_m, upper_m, extra_weights_m)


class FlightGrid(NamedTuple):
    """Constants of one aircraft, mass and temperature deviation on L levels; :func:`flight_grid` computes them.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> grid = load_model("best.ckpt").representation.decoder.grid(torch.zeros(1))
        >>> len(grid.breaks.lower_m) == len(grid.altitude_m) - 1
        True
    """

    altitude_m: Tensor
    """(L,) pressure altitude of the levels."""
    levels: LevelTable
    """At the levels."""
    breaks: Breaks
    sides: LevelTable
    """At both sides of the jumps."""

    @property
    def is_plain(self) -> bool:
        """True where no constant varies by flight or requires a gradient."""
        columns = (*self.levels.columns(), *self.sides.columns(), self.breaks.lower_m)
        return not any(column.dim() > 1 or column.requires_grad for column in columns)


def flight_grid(
    aircraft: PerformanceModel,
    altitude_m: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
) -> FlightGrid:
    """Tabulate a grid (L,) in its precision and on its device.

    Args:
        aircraft: Its model; gradients go through numbers that are tensors.
        altitude_m: (L,) ascending pressure altitudes.
        mass_kg: Mass, () or (n, 1); the reference mass if absent.
        deviation_k: ISA temperature deviation, likewise.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> grid = flight_grid(aircraft("A320"), torch.arange(150.0, 351.0).double() * 30.48)
        >>> len(grid.altitude_m), len(grid.breaks.altitude_m)  # one jump, two sides
        (201, 2)
    """
    breaks = rate_breaks(aircraft, altitude_m)
    levels = level_table(aircraft, altitude_m, mass_kg, deviation_k)
    sides = level_table(aircraft, breaks.altitude_m, mass_kg, deviation_k)
    return FlightGrid(altitude_m, levels, breaks, sides)
