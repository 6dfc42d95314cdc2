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
    """Extra altitudes (b,) on both sides of each jump inside the grid, and how they enter the time of their cells.

    ``base`` and ``share`` (b) continue a profile to each extra by a line through the two levels ``base`` and
    ``base + 1`` of its own side. ``cells`` are the cells that hold extras, with the weights in metres of the slowness
    at the level below, at the level above and at the extras inside, by their numbers: together the trapezoid rule
    from level to extra, between extras, and on to the next level. All carry gradients where the coefficients that
    place a jump do: time changes as the jump moves.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> breaks = rate_breaks(aircraft("A320"), torch.arange(150.0, 351.0).double() * 30.48)
        >>> len(breaks.cells), breaks.continued(torch.full((1, 201), 140.0).double()).tolist()  # one jump, two sides
        (1, [[140.0, 140.0]])
    """

    altitude_m: Tensor
    base: tuple[int, ...]
    share: tuple[Number, ...]
    cells: tuple[tuple[int, Number, Number, tuple[tuple[int, Number], ...]], ...]

    def continued(self, values: Tensor) -> Tensor:
        """Values (..., L) of the levels continued to the extras: (..., b).

        From its own side, because either the drag or the rate jumps: inferred drag jumps so that the observed
        rate does not, and a smooth drag makes the rate jump.
        """
        if not self.base:
            return values[..., :0]
        # Column by column: indexing by a tensor takes longer than all the arithmetic.
        columns = zip(self.base, self.share, strict=True)
        return torch.stack([_between(values[..., k], values[..., k + 1], share) for k, share in columns], -1)

    def leg_times(self, slowness: Tensor, extra: Tensor, half_step_m: Tensor) -> Tensor:
        """Time between neighbouring levels (n, L - 1) from slowness on the levels (n, L) and at the extras (n, b).

        Args:
            slowness: (n, L) seconds per metre on the levels.
            extra: (n, b) the same at the extras.
            half_step_m: (L - 1,) half the distance of neighbouring levels.
        """
        # Sums and products one by one: a product of matrices would sum in another order in another batch.
        legs = (slowness[:, 1:] + slowness[:, :-1]).mul_(half_step_m)
        for cell, lower, upper, inside in self.cells:
            ends = slowness[:, cell] * lower + slowness[:, cell + 1] * upper
            legs[:, cell] = ends + sum(extra[:, number] * weight for number, weight in inside)
        return legs


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
    inside = [jump for jump in sorted(jumps, key=_value) if lowest < _value(jump) < highest]
    sides = [side for jump in inside for side in (jump - SIDE_M, jump + SIDE_M)]
    extras = torch.stack(sides) if sides else levels[:0]
    last = len(levels) - 2
    holds = (torch.searchsorted(levels, extras.detach(), right=True) - 1).clamp(0, last)
    below = torch.arange(len(extras)) % 2 == 0
    base = torch.where(below, holds - 1, holds + 1).clamp(0, last)
    share = (extras - levels[base]) / (levels[base + 1] - levels[base])
    cells: list[tuple[int, Number, Number, tuple[tuple[int, Number], ...]]] = []
    for cell in sorted(set(holds.tolist())):
        here = (holds == cell).nonzero().flatten()
        # Half of the step on either side of each point, levels first and last.
        half = torch.cat([levels[cell : cell + 1], extras[here], levels[cell + 1 : cell + 2]]).diff() / 2
        weights = tuple(zip(here.tolist(), _plain(half[1:] + half[:-1]), strict=True))
        first, last_half = _plain(half[[0, -1]])
        cells.append((cell, first, last_half, weights))
    return Breaks(extras.to(altitude_m), tuple(base.tolist()), tuple(_plain(share)), tuple(cells))


def _value(number: Tensor) -> float:
    return float(number.detach())


def _plain(values: Tensor) -> list[Number]:
    """Floats, which are faster to calculate with, unless a gradient is wanted."""
    found: list[Number] = list(values.unbind()) if values.requires_grad else values.tolist()
    return found


def _between(lower: Tensor, upper: Tensor, share: Number) -> Tensor:
    return torch.lerp(lower, upper, share.to(lower) if isinstance(share, Tensor) else share)


class FlightGrid(NamedTuple):
    """Constants of one aircraft, mass and temperature deviation on L levels; :func:`flight_grid` computes them.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> grid = load_model("best.ckpt").representation.decoder.grid(torch.zeros(1))
        >>> len(grid.half_step_m) == len(grid.altitude_m) - 1
        True
    """

    altitude_m: Tensor
    """(L,) pressure altitude of the levels."""
    half_step_m: Tensor
    """(L - 1,) half the distance of neighbouring levels."""
    levels: LevelTable
    """At the levels."""
    breaks: Breaks
    sides: LevelTable
    """At both sides of the jumps."""

    @property
    def is_plain(self) -> bool:
        """True where no constant varies by flight or requires a gradient."""
        columns = (*self.levels.columns(), *self.sides.columns())
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
    return FlightGrid(altitude_m, (altitude_m.double().diff() / 2).to(altitude_m), levels, breaks, sides)
