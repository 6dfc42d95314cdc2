"""Other speeds: the Mach number and the CAS that flights descend at."""

from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState


class SpeedSchedule(Effect):
    """CAS shifted on the constant-CAS leg, Mach shifted on the constant-Mach leg; the rate follows the speed.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = SpeedSchedule().shift(example_flights(), torch.tensor([10.0, 0.0]))
        >>> round(float(shift["cas"][:, 0].mean()), 3)  # kt at the lowest band
        10.0
    """

    name = "speed_schedule"
    description = "other descent speeds"
    directions = ("faster descents", "slower descents")
    parameters = (
        Parameter("cas_kt", -120.0, 120.0, "kt", 5.0, label="CAS"),
        Parameter("mach", -0.25, 0.25, "1", 0.005, label="Mach number"),
    )
    needs = ("IAS",)
    rate_follows_cas = True

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """CAS of the schedule with the change minus that without: the slower of Mach and CAS decides."""
        (cas_kt, mach), plan, altitude = theta, state.schedule, state.altitude_m
        # Flights that have the change in them already are moved back.
        sign = -1.0 if state.affected else 1.0
        moved = plan.at(altitude, sign * mach, sign * cas_kt * KT_MPS)
        return {"cas": sign * (moved - plan.at(altitude)) / KT_MPS}
