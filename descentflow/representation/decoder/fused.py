"""The decoder without gradients: fused arithmetic in chunks that the processor's caches hold."""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.physics.fused_table import LevelTable, fused_rate
from descentflow.representation.decoder.flight_grid import FlightGrid
from descentflow.representation.decoder.lower_speed import with_crossovers

CHUNK_VALUES = 1 << 17
"""Values of a quantity in one chunk for each thread of the CPU: the handful of arrays in use stay in the caches."""
GPU_CHUNK_VALUES = 1 << 26
"""The same for a GPU: enough to fill it, while the arrays between the steps stay below 2 GiB."""


def is_plain(*values: object) -> bool:
    """True where no value requires a gradient and no coefficient varies by flight.

    Args:
        *values: Two profiles (n, L), then coefficients.

    Example:
        >>> profile = torch.zeros(2, 3)
        >>> is_plain(profile, profile, 1.0), is_plain(profile, profile, torch.ones(2, 1))
        (True, False)
    """
    return not any(isinstance(value, Tensor) and value.requires_grad for value in values) and not any(
        isinstance(value, Tensor) and value.numel() > 1 for value in values[2:]
    )


def integrate_fast(
    grid: FlightGrid,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    *,
    ahead_mps: Tensor | None = None,
    out: tuple[Tensor, ...] | None = None,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Time, Mach, TAS and rate, each (n, L): the numbers of the plain path to rounding.

    Args:
        grid: Of the L levels, in the profiles' precision.
        drag_n: (n, L).
        cas_mps: (n, L).
        entry: (n,) index of the entry level.
        ahead_mps: (n, L) where each flight holds a Mach number of its own, see
            :class:`~descentflow.representation.decoder.lower_speed.LowerSpeed`; the type's transition if absent.
        out: Arrays for the result, in its order; new ones if absent. On the CPU the system may take longer to hand
            out new memory than the descents take to compute.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.decoder.flight_grid import flight_grid
        >>> grid = flight_grid(aircraft("A320"), torch.arange(150, 351).double() * 30.48)
        >>> drag_n, cas_mps = torch.full((1, 201), 45e3).double(), torch.full((1, 201), 140.0).double()
        >>> time_s, *_ = integrate_fast(grid, drag_n, cas_mps, torch.tensor([200]))
        >>> round(float(time_s[0, 0]) / 60)  # minutes from FL350 to FL150
        8
    """
    time_s, mach, tas_mps, rate_mps = out or (torch.empty_like(drag_n) for _ in range(4))
    values = GPU_CHUNK_VALUES if drag_n.is_cuda else CHUNK_VALUES * torch.get_num_threads()
    size = max(values // drag_n.shape[1], 1)
    with torch.no_grad():
        extra = _extra_slowness(grid, drag_n, cas_mps, ahead_mps)
        for start in range(0, len(drag_n), size):
            part = slice(start, start + size)
            here = (mach[part], tas_mps[part], rate_mps[part], time_s[part])
            ahead = None if ahead_mps is None else ahead_mps[part]
            fused_rate(_own_regime(grid.levels, ahead), drag_n[part], cas_mps[part], here)
            # Seconds gained on the way up are negative here: the rate is.
            legs = grid.breaks.leg_times(here[3], extra[part], grid.half_step_m)
            if ahead is not None:
                legs = with_crossovers(legs, here[3], ahead, grid.half_step_m)
            _time_from_entry(legs, entry[part], here[3])
    return time_s, mach, tas_mps, rate_mps


def _own_regime(table: LevelTable, ahead_mps: Tensor | None) -> LevelTable:
    """The table with the energy share factor of each flight's own regime."""
    return table if ahead_mps is None else replace(table, compression=(ahead_mps >= 0).to(ahead_mps))


def _extra_slowness(grid: FlightGrid, drag_n: Tensor, cas_mps: Tensor, ahead_mps: Tensor | None) -> Tensor:
    """Slowness (n, b) at both sides of the jumps."""
    out = tuple(drag_n.new_empty(len(drag_n), len(grid.breaks.base)) for _ in range(4))
    if len(grid.breaks.base):
        sides = _own_regime(grid.sides, None if ahead_mps is None else grid.breaks.continued(ahead_mps))
        fused_rate(sides, grid.breaks.continued(drag_n), grid.breaks.continued(cas_mps), out)
    return out[3]


def _time_from_entry(leg_s: Tensor, entry: Tensor, time_s: Tensor) -> None:
    """Add up legs (n, L - 1) from the bottom to times (n, L) that are zero at the entry."""
    time_s[:, 0] = 0
    torch.cumsum(leg_s, 1, out=time_s[:, 1:])
    time_s -= time_s.gather(1, entry[:, None])
