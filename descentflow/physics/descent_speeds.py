"""The standard descent speed schedule of the airlines procedure model (BADA 3 user manual, section 4.3)."""

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.bada3.global_parameters import STANDARD, GlobalParameters
from descentflow.core.tensors import Number, as_tensors
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.physics.altitude_limits import is_below
from descentflow.physics.configuration import stall_cas_mps
from descentflow.physics.transition import transition_altitude_m

HIGH_SCHEDULE_M = 10000 * FT_M
"""From here up the high speed V_des,2 and the Mach number hold."""
_CEILING_FT = {
    "turbine": (6000.0, 3000.0, 2000.0, 1500.0, 1000.0),
    "piston": (1500.0, 1000.0, 500.0),
}
"""Altitudes below which the next lower speed of the schedule holds."""


def descent_cas_mps(
    aircraft: Aircraft,
    altitude_m: Number,
    mass_kg: Number | None = None,
    limits: GlobalParameters = STANDARD,
) -> Tensor:
    """CAS of the standard descent (manual 4.3-1 to 4.3-7).

    From the top: Mach ``M_des`` from the transition altitude, ``V_des,2`` down to 10,000 ft, ``V_des,1`` at most 250
    kt down to 6,000 ft, at most 220 kt down to 3,000 ft, then 1.3 stall speeds in landing configuration plus 50, 20,
    10 and 5 kt below 3,000, 2,000, 1,500 and 1,000 ft. Pistons: ``V_des,1`` down to 1,500 ft, then 20, 10 and 5 kt
    above the minimum below 1,500, 1,000 and 500 ft. No speed exceeds that of the range above it, as the manual
    recommends. A level on a boundary belongs to the upper range.

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.
        mass_kg: Mass, for the stall speed; the reference mass when None.
        limits: Global parameters (speed increments and minimum speed factor).

    Returns:
        Calibrated airspeed in m/s, broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> descent_cas_mps(open_aircraft("A320"), 8000 * 0.3048).item() / 0.514444 <= 250.0
        True
    """
    altitude, high, mach = as_tensors(altitude_m, aircraft.des_cas_high_kt, aircraft.des_mach)
    cas, *slower = as_tensors(altitude, *_low_speeds_mps(aircraft, mass_kg, limits))[1:]
    for ceiling_ft, lower in zip(ceilings_ft(aircraft), slower, strict=True):
        cas = torch.where(is_below(altitude, ceiling_ft * FT_M), torch.minimum(lower, cas), cas)
    upper = torch.where(holds_mach(aircraft, altitude), mach_to_cas_mps(mach, altitude), high * KT_MPS)
    return torch.where(is_below(altitude, HIGH_SCHEDULE_M), cas, upper)


def ceilings_ft(aircraft: Aircraft) -> tuple[float, ...]:
    """Altitudes in ft where the low schedule steps down, from the top (manual 4.3-1 to 4.3-7).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> ceilings_ft(open_aircraft("A320"))
        (6000.0, 3000.0, 2000.0, 1500.0, 1000.0)
    """
    return _CEILING_FT["piston" if aircraft.engine == "piston" else "turbine"]


def holds_mach(aircraft: Aircraft, altitude_m: Number) -> Tensor:
    """Return True where the schedule holds Mach: from the transition up, and never below 10,000 ft (manual 4.3).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> holds_mach(open_aircraft("A320"), torch.tensor([5000.0, 11500.0])).tolist()
        [False, True]
    """
    (altitude,) = as_tensors(altitude_m)
    return (altitude >= transition_altitude_m(aircraft)) & ~is_below(altitude, HIGH_SCHEDULE_M)


def _low_speeds_mps(aircraft: Aircraft, mass_kg: Number | None, limits: GlobalParameters) -> list[Tensor]:
    """Speeds below 10,000 ft, from the top range to the lowest."""
    (low,) = as_tensors(aircraft.des_cas_low_kt)
    low = low * KT_MPS
    slowest = limits.min_speed_factor * stall_cas_mps(aircraft, mass_kg, "LD")
    if aircraft.engine == "piston":
        return [low, *(slowest + v * KT_MPS for v in reversed(limits.des_increment_piston_kt))]
    capped = [low.clamp(max=250 * KT_MPS), low.clamp(max=220 * KT_MPS)]
    return [*capped, *(slowest + v * KT_MPS for v in reversed(limits.des_increment_kt))]
