"""Batched integration of BADA's rate equation from drag and CAS on the grid (paper, equation 2)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.decoder.breaks import Breaks, rate_breaks
from descentflow.decoder.fast import integrate_fast, is_plain
from descentflow.performance.aircraft import Aircraft, Number
from descentflow.performance.energy import descent_rate_mps
from descentflow.performance.state import idle_state


@dataclass(frozen=True)
class Trajectories:
    """n descents on L ascending levels, each from its own entry level down to the lowest.

    Shapes: ``levels_fl`` (L,), ``entry`` (n,) index of the entry level, all else (n, L). ``time_s`` is zero at
    the entry level and grows downwards; levels above the entry have no meaning (``mask`` is false there).
    """

    levels_fl: Tensor
    entry: Tensor
    time_s: Tensor
    cas_mps: Tensor
    mach: Tensor
    tas_mps: Tensor
    rate_mps: Tensor
    drag_n: Tensor

    @property
    def mask(self) -> Tensor:
        """(n, L) true at and below the entry level."""
        return torch.arange(len(self.levels_fl), device=self.entry.device) <= self.entry[:, None]

    def __len__(self) -> int:
        """Number of descents."""
        return len(self.entry)

    def subset(self, index: Tensor) -> "Trajectories":
        """The descents at these positions, or where a bool mask (n,) is true."""
        rest = (self.entry, self.time_s, self.cas_mps, self.mach, self.tas_mps, self.rate_mps, self.drag_n)
        return Trajectories(self.levels_fl, *(values[index] for values in rest))


def concatenate(parts: list[Trajectories]) -> Trajectories:
    """Join batches on one grid."""
    names = ("entry", "time_s", "cas_mps", "mach", "tas_mps", "rate_mps", "drag_n")
    return Trajectories(parts[0].levels_fl, *(torch.cat([getattr(p, name) for p in parts]) for name in names))


def integrate(
    aircraft: Aircraft,
    levels_fl: Tensor,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
) -> Trajectories:
    """Fly drag and CAS profiles down the grid.

    With drag and CAS given on the grid the rate is known at every level, so time is a quadrature of
    ``dh / rate``: the trapezoid rule between levels, and between a level and each side of a jump of the rate
    (:mod:`descentflow.decoder.breaks`), where drag and CAS are continued from that side.

    Args:
        aircraft: Coefficients; tensors among them are differentiated through.
        levels_fl: (L,) ascending levels.
        altitude_m: (L,) their pressure altitude, in the precision wanted.
        drag_n: (n, L).
        cas_mps: (n, L).
        entry: (n,) index of the level where each descent starts.
        mass_kg: Mass, () or (n, 1); the reference mass if absent.
        deviation_k: ISA temperature deviation.

    Returns:
        The trajectories. A rate that is not negative gives times that are not finite or not increasing: it is
        the sampler that rejects those.
    """
    if is_plain(*aircraft.numbers(), mass_kg, deviation_k) and not (drag_n.requires_grad or cas_mps.requires_grad):
        time_s, mach, tas_mps, rate_mps = integrate_fast(
            aircraft, altitude_m, drag_n, cas_mps, entry, mass_kg, deviation_k
        )
        return Trajectories(levels_fl, entry, time_s, cas_mps, mach, tas_mps, rate_mps, drag_n)
    return integrate_plain(aircraft, levels_fl, altitude_m, drag_n, cas_mps, entry, mass_kg, deviation_k)


def integrate_plain(
    aircraft: Aircraft,
    levels_fl: Tensor,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
) -> Trajectories:
    """:func:`integrate` in the equations' own order, differentiable in all its arguments."""
    mach, tas_mps, rate_mps = _fly(aircraft, altitude_m, drag_n, cas_mps, mass_kg, deviation_k)
    breaks = rate_breaks(aircraft, altitude_m)
    extra_rate = _fly(
        aircraft, breaks.altitude_m, breaks.continued(drag_n), breaks.continued(cas_mps), mass_kg, deviation_k
    )[2]
    time_s = _time_from_entry(altitude_m, rate_mps, extra_rate, breaks, entry)
    return Trajectories(levels_fl, entry, time_s, cas_mps, mach, tas_mps, rate_mps, drag_n)


def _fly(
    aircraft: Aircraft,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    mass_kg: Number | None,
    deviation_k: Number,
) -> tuple[Tensor, Tensor, Tensor]:
    """Mach, TAS and rate at some altitudes, each (n, number of altitudes)."""
    state = idle_state(aircraft, cas_mps, altitude_m, deviation_k)
    rate_mps = descent_rate_mps(
        aircraft, drag_n, state.thrust_n, state.tas_mps, state.energy_share, altitude_m, deviation_k, mass_kg
    )
    return state.mach, state.tas_mps, rate_mps


def _time_from_entry(altitude_m: Tensor, rate_mps: Tensor, extra_rate: Tensor, breaks: Breaks, entry: Tensor) -> Tensor:
    """Seconds since entry at each level: the integral of slowness from the bottom, less the part above."""
    slowness = -1.0 / torch.cat([rate_mps, extra_rate], 1)[:, breaks.order]
    steps_m = torch.cat([altitude_m, breaks.altitude_m])[breaks.order].diff()
    leg_s = 0.5 * (slowness[:, 1:] + slowness[:, :-1]) * steps_m
    climbed_s = torch.nn.functional.pad(leg_s.cumsum(1), (1, 0))[:, breaks.levels_at]
    return climbed_s.gather(1, entry[:, None]) - climbed_s
