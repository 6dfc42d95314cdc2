"""A few flights in closed form, to try an effect on before any data."""

from dataclasses import replace

import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M, KT_MPS
from descentflow.effects.flight_state import FlightState
from descentflow.physics.airspeed import mach_to_cas_mps


def example_flights(n: int = 6, affected: bool = False) -> FlightState:
    """A320 at Mach 0.78 and then at CAS between 270 and 310 kt, in eleven bands from FL150 to FL370.

    Args:
        n: Flights.
        affected: Whether they have the effect in question already, as real flights do; else it is to be added.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> heavier = EFFECTS["mass"].shift(example_flights(3), torch.tensor([0.1]))["rate"]
        >>> heavier.shape, bool((heavier < 0).all())  # a heavier aircraft comes down more slowly
        (torch.Size([3, 11]), True)
    """
    altitude = torch.linspace(160, 360, 11, dtype=torch.float64) * FL_M
    planned = torch.linspace(270, 310, n, dtype=torch.float64)[:, None] * KT_MPS
    by_mach = mach_to_cas_mps(0.78, altitude)
    cas = torch.minimum(planned + 0 * by_mach, by_mach)
    (slope,) = torch.gradient(by_mach, spacing=(altitude,))
    mask = torch.ones_like(cas, dtype=torch.bool)
    slopes = torch.where(cas < planned, slope, 0.0)
    depth = altitude[-1] - altitude + 0 * cas
    flown = FlightState(
        open_aircraft("A320"), 57e3, altitude, 20 * FL_M, cas, slopes, torch.zeros_like(cas), mask, depth, affected
    )
    return replace(flown, rate_change_per_s=flown.schedule_change_per_s)
