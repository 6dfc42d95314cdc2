"""Batched integration of BADA's rate equation from drag and CAS on the grid (paper, equation 2)."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.core.tensors import Number
from descentflow.physics.energy import descent_rate_mps, slope_per_m
from descentflow.physics.idle_state import idle_state
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.flight_grid import FlightGrid, flight_grid
from descentflow.representation.decoder.fused import integrate_fast, is_plain
from descentflow.representation.decoder.lower_speed import with_crossovers
from descentflow.representation.decoder.rate_jumps import Breaks, rate_breaks


@dataclass(frozen=True)
class Trajectories:
    """n descents on L ascending levels, each from its own entry level down to the lowest.

    Shapes: ``levels_fl`` (L,), ``entry`` (n,) index of the entry level, all else (n, L). ``time_s`` is zero at
    the entry level and grows downwards; levels above the entry have no meaning (``mask`` is false there).

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(4, seed=0))
        >>> len(flown), len(flown.subset(torch.tensor([0, 2])))
        (4, 2)
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
    """Join batches on one grid.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(4, seed=0))
        >>> len(concatenate([flown, flown]))
        8
    """
    names = ("entry", "time_s", "cas_mps", "mach", "tas_mps", "rate_mps", "drag_n")
    return Trajectories(parts[0].levels_fl, *(torch.cat([getattr(p, name) for p in parts]) for name in names))


def integrate(
    aircraft: PerformanceModel,
    levels_fl: Tensor,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
    *,
    wind_mps: Tensor | None = None,
    exact_energy_share: bool = False,
    out: Trajectories | None = None,
    grid: FlightGrid | None = None,
    ahead_mps: Tensor | None = None,
) -> Trajectories:
    """Fly drag and CAS profiles down the grid.

    With drag and CAS given on the grid the rate is known at every level, so time is a quadrature of
    ``dh / rate``: the trapezoid rule between levels, and between a level and each side of a jump of the rate
    (:mod:`descentflow.representation.decoder.rate_jumps`), where drag and CAS are continued from that side.

    The energy share factor is BADA's by default, of constant Mach above the transition altitude and of constant CAS
    below: the paper leaves BADA's algorithm unchanged, drag was inferred with the same factor, so that rates come back
    as observed, and it needs no derivative of noisy speeds. The exact one follows the CAS profile.

    Args:
        aircraft: Coefficients; tensors among them are differentiated through.
        levels_fl: (L,) ascending levels.
        altitude_m: (L,) their pressure altitude, in the precision wanted.
        drag_n: (n, L).
        cas_mps: (n, L).
        entry: (n,) index of the level where each descent starts.
        mass_kg: Mass, () or (n, 1); the reference mass if absent.
        deviation_k: ISA temperature deviation.
        wind_mps: (L,) or (n, L) along-track wind, positive from behind; its slope changes the energy share.
        exact_energy_share: Take the slope of the CAS itself for the energy share factor.
        out: Descents of the same shape, no longer needed, whose arrays may be reused for the result: on the CPU
            allocating memory can take longer than the computation.
        grid: What was tabulated of the levels for the same coefficients, mass and deviation, in the profiles'
            precision; computed here if absent.
        ahead_mps: (n, L) where each flight holds a Mach number of its own, see
            :class:`~descentflow.representation.decoder.lower_speed.LowerSpeed`; the energy share factor is then
            that of the flight's own regime, and the jump of the rate is at the flight's own crossover.

    Returns:
        The trajectories. A rate that is not negative gives times that are not finite or not increasing; the
        sampler rejects those.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> levels_fl = torch.arange(150, 351).double()
        >>> drag_n, cas_mps = torch.full((1, 201), 45e3).double(), torch.full((1, 201), 140.0).double()
        >>> flown = integrate(aircraft("A320"), levels_fl, levels_fl * 30.48, drag_n, cas_mps, torch.tensor([200]))
        >>> round(float(flown.time_s[0, 0]) / 60)  # minutes from FL350 to FL150
        8
    """
    # Whoever has tabulated the levels has looked at the coefficients.
    parameters = (*aircraft.numbers(), mass_kg, deviation_k) if grid is None else ()
    if is_plain(drag_n, cas_mps, *parameters) and wind_mps is None and not exact_energy_share:
        known = grid or flight_grid(aircraft, altitude_m, mass_kg, deviation_k, at_transition=ahead_mps is None)
        arrays = None if out is None else (out.time_s, out.mach, out.tas_mps, out.rate_mps)
        time_s, mach, tas_mps, rate_mps = integrate_fast(known, drag_n, cas_mps, entry, ahead_mps=ahead_mps, out=arrays)
        return Trajectories(levels_fl, entry, time_s, cas_mps, mach, tas_mps, rate_mps, drag_n)
    slopes = Slopes(
        0.0 if wind_mps is None else slope_per_m(wind_mps, altitude_m),
        slope_per_m(cas_mps, altitude_m) if exact_energy_share else None,
        ahead_mps,
    )
    return integrate_plain(aircraft, levels_fl, altitude_m, drag_n, cas_mps, entry, mass_kg, deviation_k, slopes)


class Slopes(NamedTuple):
    """Arguments of the energy share factor: slopes (1/s) of wind, and of CAS if it is exact, and the own regime.

    Example:
        >>> Slopes(wind=-0.002).cas is None  # the energy share factor is BADA's
        True
    """

    wind: Number = 0.0
    cas: Tensor | None = None
    ahead_mps: Tensor | None = None

    def continued(self, breaks: Breaks) -> "Slopes":
        """At both sides of the jumps."""
        wind = breaks.continued(self.wind) if isinstance(self.wind, Tensor) else self.wind
        cas, ahead = (None if one is None else breaks.continued(one) for one in (self.cas, self.ahead_mps))
        return Slopes(wind, cas, ahead)


def integrate_plain(
    aircraft: PerformanceModel,
    levels_fl: Tensor,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
    slopes: Slopes | None = None,
) -> Trajectories:
    """:func:`integrate` in the equations' own order, differentiable in all its arguments.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> levels_fl = torch.arange(150, 351).double()
        >>> drag_n = torch.full((1, 201), 45e3).double().requires_grad_()
        >>> profiles = drag_n, torch.full((1, 201), 140.0).double(), torch.tensor([200])
        >>> flown = integrate_plain(aircraft("A320"), levels_fl, levels_fl * 30.48, *profiles)
        >>> flown.time_s[0, 0].backward()
        >>> bool((drag_n.grad < 0).all())  # more drag is less time
        True
    """
    slopes = slopes or Slopes()
    breaks = rate_breaks(aircraft, altitude_m, at_transition=slopes.ahead_mps is None)
    mach, tas_mps, rate_mps = _fly(aircraft, altitude_m, drag_n, cas_mps, mass_kg, deviation_k, slopes)
    extra_rate = _fly(
        aircraft,
        breaks.altitude_m,
        breaks.continued(drag_n),
        breaks.continued(cas_mps),
        mass_kg,
        deviation_k,
        slopes.continued(breaks),
    )[2]
    half_step_m = altitude_m.diff() / 2
    leg_s = breaks.leg_times(-1 / rate_mps, -1 / extra_rate, half_step_m)
    if slopes.ahead_mps is not None:
        leg_s = with_crossovers(leg_s, -1 / rate_mps, slopes.ahead_mps, half_step_m)
    # Seconds since entry: the integral of slowness from the bottom to the entry, minus the part below the level.
    climbed_s = torch.nn.functional.pad(leg_s.cumsum(1), (1, 0))
    time_s = climbed_s.gather(1, entry[:, None]) - climbed_s
    return Trajectories(levels_fl, entry, time_s, cas_mps, mach, tas_mps, rate_mps, drag_n)


def _fly(
    aircraft: PerformanceModel,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    mass_kg: Number | None,
    deviation_k: Number,
    slopes: Slopes,
) -> tuple[Tensor, Tensor, Tensor]:
    """Mach, TAS and rate at some altitudes, each (n, number of altitudes)."""
    state = idle_state(
        aircraft,
        cas_mps,
        altitude_m,
        deviation_k,
        wind_gradient_per_s=slopes.wind,
        cas_gradient_per_s=slopes.cas,
        at_mach=None if slopes.ahead_mps is None else slopes.ahead_mps < 0,
    )
    rate_mps = descent_rate_mps(
        aircraft, drag_n, state.thrust_n, state.tas_mps, state.energy_share, altitude_m, deviation_k, mass_kg
    )
    return state.mach, state.tas_mps, rate_mps
