"""Tables of a grid of levels that no descent changes: level tables and jumps of the rate, computed once."""

from typing import NamedTuple

from torch import Tensor

from descentflow.core.tensors import Number
from descentflow.physics.fused_table import LevelTable, level_table
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.rate_jumps import Breaks, rate_breaks


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


def flight_grid(
    aircraft: PerformanceModel,
    altitude_m: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
    *,
    at_transition: bool = True,
) -> FlightGrid:
    """Tabulate a grid (L,) in its precision and on its device.

    Args:
        aircraft: Coefficients, all floats.
        altitude_m: (L,) ascending pressure altitudes.
        mass_kg: Mass; the reference mass if absent.
        deviation_k: ISA temperature deviation.
        at_transition: Whether the rate jumps at the type's transition, see :func:`~.rate_jumps.rate_breaks`.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> grid = flight_grid(aircraft("A320"), torch.arange(150.0, 351.0).double() * 30.48)
        >>> len(grid.levels.thrust_n), len(grid.sides.thrust_n)  # one jump, two sides
        (201, 2)
    """
    breaks = rate_breaks(aircraft, altitude_m, at_transition=at_transition)
    levels, sides = (level_table(aircraft, h, mass_kg, deviation_k) for h in (altitude_m, breaks.altitude_m))
    return FlightGrid(altitude_m, (altitude_m.double().diff() / 2).to(altitude_m), levels, breaks, sides)
