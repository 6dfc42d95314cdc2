"""Air warmer or colder than the standard atmosphere, by the same amount at every altitude."""

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.physics.airspeed import mach_to_tas_mps
from descentflow.physics.atmosphere import geometric_altitude_m, isa_temperature_k


class Temperature(Effect):
    """Deviation from ISA: true airspeed at a Mach number, rate of pressure altitude, height between pressure levels.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = Temperature().shift(example_flights(), torch.tensor([10.0]))
        >>> round(float(shift["tas"].mean()), 3)  # 10 K warmer: ln of the true airspeed at a Mach number
        0.021
    """

    name = "temperature"
    description = "air warmer or colder than the standard atmosphere"
    directions = ("air warmer than the standard atmosphere", "air colder than the standard atmosphere")
    against = ("air warmer than that of the simulator's flights", "air colder than that of the simulator's flights")
    inherited_from = 2.0
    is_temperature = of_air = True
    parameters = (
        Parameter("deviation_k", -40.0, 40.0, "K", 5.0, label="deviation from the standard atmosphere", symbol="ISA"),
    )
    splits = ("TAS", "geoaltitude")

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation, ln TAS at the same Mach number, geometric height within the flight."""
        deviation = theta[0]
        mach = state.mach()
        tas = mach_to_tas_mps(mach, state.altitude_m, deviation) / mach_to_tas_mps(mach, state.altitude_m)
        height = geometric_altitude_m(state.altitude_m, deviation) - state.altitude_m
        return {
            "rate": log_rate(state, deviation_k=deviation) - state.own_log_rate,
            "tas": tas.log(),
            "height": state.centred(height + torch.zeros_like(state.cas_mps)),
        }

    def measured(self, state: FlightState, shown: Shift) -> Tensor | None:
        """Deviation by TAS and Mach number: the square of TAS over that in standard air is the temperature's ratio."""
        if "tas" not in shown or not bool(shown["tas"].isfinite().any()):
            return None
        standard_k = isa_temperature_k(state.altitude_m)
        by_band = (standard_k * ((2 * shown["tas"]).exp() - 1)).nanmean(0)
        return by_band.nanmean()[None]
