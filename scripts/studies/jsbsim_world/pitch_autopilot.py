"""The autopilot: speed or path by elevator, thrust by lever, wings level on a northerly heading.

In the idle descent the wanted pitch is driven by the speed error and its growth alone, as a speed-on-elevator law is:
the rate of descent is what comes out. Pitch is held by a proportional, integral and derivative law whose gains follow
the model's own pitch stiffness and the dynamic pressure, so that one law flies all models.
"""

import math
from dataclasses import dataclass

from descentflow.core.constants import G0_MPS2
from studies.jsbsim_world.flight_plans import FlightPlan
from studies.jsbsim_world.scalar_air import isa_temperature_k, mach_of_cas, pressure_altitude_m

CRUISE, DESCENT, HOLD, DONE = range(4)
"""Modes."""
FREQUENCY_RAD_S, DAMPING = 0.12, 0.9
"""Of the speed held by elevator."""
PITCH_RATE = math.radians(0.3)
"""Bound of the wanted pitch's change, rad/s: 0.13 g at 240 m/s."""
PATH_LAG_S = 4.0
CAPTURE_S = 20.0
"""Time constant in which a height error is removed in cruise."""
SPEED_LAG_S = 12.0
"""Time in which thrust removes a speed error."""
THRUST_LAG_S = 5.0
LEVER_RATE = 0.03
"""Bound of the thrust lever's change, 1/s."""
PITCH_LEAD = math.radians(4.0)
"""The wanted pitch never leaves the pitch by more."""
SETTLED_S = 45.0
"""A descent is called settled after this."""


@dataclass(slots=True)
class Seen:
    """Inputs of the autopilot in one step; SI units and radians.

    Example:
        >>> seen = Seen(**dict.fromkeys(Seen.__slots__, 0.0))  # every field is a number
        >>> seen.mach = 0.82
        >>> seen.mach, seen.climb_mps
        (0.82, 0.0)
    """

    pressure_pa: float
    temperature_k: float
    sound_mps: float
    mach: float
    height_m: float
    climb_mps: float
    groundspeed_mps: float
    pitch: float
    pitch_rate: float
    roll: float
    roll_rate: float
    heading: float
    dynamic_pa: float
    drag_n: float
    thrust_n: float
    idle_n: float
    full_n: float
    """Thrust that full lever adds to idle."""
    mass_kg: float


@dataclass(slots=True)
class Commands:
    """Outputs of the autopilot in one step.

    Example:
        >>> Commands(elevator_rad=-0.1, aileron=0.0, lever=0.6, brake=0.0)
        Commands(elevator_rad=-0.1, aileron=0.0, lever=0.6, brake=0.0)
    """

    elevator_rad: float
    aileron: float
    lever: float
    brake: float


@dataclass(frozen=True)
class PitchResponse:
    """Pitch acceleration of the model at a dynamic pressure.

    Example:
        >>> response = PitchResponse(dynamic_pa=10_400.0, stiffness=0.36, control=0.4)
        >>> math.sqrt(response.stiffness)  # rad/s, the model's own pitch oscillation
        0.6
    """

    dynamic_pa: float
    stiffness: float
    """For one radian of angle of attack, 1/s2, positive for a stable model."""
    control: float
    """For one radian of elevator, 1/s2, positive."""


class Autopilot:
    """Flies one plan; holds the memory of its loops.

    Example:
        An aircraft that is 2 m/s too fast in the cruise has its thrust taken back.

        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> plan = draw_plans(airframe_of("MD11"), [0], seed=0, config=JsbsimConfig(wander_kt=0.0))[0]
        >>> seen = Seen(
        ...     pressure_pa=21_663.0, temperature_k=216.65, sound_mps=295.1, mach=plan.mach + 0.007, height_m=11_300.0,
        ...     climb_mps=0.0, groundspeed_mps=244.0, pitch=0.05, pitch_rate=0.0, roll=0.0, roll_rate=0.0, heading=0.0,
        ...     dynamic_pa=10_400.0, drag_n=140e3, thrust_n=140e3, idle_n=40e3, full_n=260e3, mass_kg=180e3,
        ... )
        >>> trim = Commands(elevator_rad=-0.1, aileron=0.0, lever=0.6, brake=0.0)
        >>> pilot = Autopilot(plan, PitchResponse(10_400.0, 0.3, 0.4), trim, seen, step_s=0.1)
        >>> pilot.step(seen, time_s=0.0).lever < 0.6
        True
    """

    def __init__(self, plan: FlightPlan, response: PitchResponse, trim: Commands, seen: Seen, step_s: float) -> None:
        self.plan, self._response, self._trim, self._step_s = plan, response, trim, step_s
        self.mode, self.age_s, self.altitude_m = CRUISE, 0.0, pressure_altitude_m(seen.pressure_pa)
        self.speed_error_mps = 0.0
        self._pitch_wanted, self._pitch_sum = seen.pitch, 0.0
        self._lever, self._height_m = trim.lever, seen.height_m
        self._last_error: float | None = None

    def step(self, seen: Seen, time_s: float) -> Commands:
        """Read one step and command the next."""
        self.altitude_m = pressure_altitude_m(seen.pressure_pa)
        self._select_mode(time_s)
        self.speed_error_mps = (seen.mach - self._target_mach(seen, time_s)) * seen.sound_mps
        last = self.speed_error_mps if self._last_error is None else self._last_error
        growth = (self.speed_error_mps - last) / self._step_s
        self._last_error = self.speed_error_mps
        self._turn_pitch(seen, growth)
        self._move_lever(seen, growth)
        self.age_s += self._step_s
        return Commands(self._elevator(seen), _aileron(seen), self._lever, self._brake())

    @property
    def settled(self) -> bool:
        """True if the mode has been kept for long enough to call its motion steady."""
        return self.age_s >= SETTLED_S

    def _select_mode(self, time_s: float) -> None:
        p, mode = self.plan, self.mode
        held = p.hold_low_m < self.altitude_m <= p.hold_high_m  # false for the NaN of none
        if self.altitude_m <= p.bottom_m:
            mode = DONE
        elif (mode == CRUISE and time_s >= p.cruise_s) or (mode == HOLD and not held):
            mode = DESCENT
        elif mode == DESCENT and held and self.settled:
            mode = HOLD
        if mode != self.mode:
            self.mode, self.age_s = mode, 0.0

    def _target_mach(self, seen: Seen, time_s: float) -> float:
        """Mach above the flight's own crossover, CAS below it, with the slow wander."""
        p = self.plan
        wander = sum(size * math.sin(rate * time_s + phase) for size, rate, phase in p.wander)
        scale = 1 + wander / p.cas_mps
        return min(p.mach * scale, mach_of_cas(p.cas_mps * scale, seen.pressure_pa))

    def _turn_pitch(self, seen: Seen, growth: float) -> None:
        tas = seen.mach * seen.sound_mps
        if self.mode == DESCENT:
            turn = (FREQUENCY_RAD_S**2 * self.speed_error_mps + 2 * DAMPING * FREQUENCY_RAD_S * growth) / G0_MPS2
        else:
            turn = (self._wanted_climb_mps(seen) - seen.climb_mps) / tas / PATH_LAG_S
        wanted = self._pitch_wanted + self._step_s * max(-PITCH_RATE, min(PITCH_RATE, turn))
        self._pitch_wanted = max(seen.pitch - PITCH_LEAD, min(seen.pitch + PITCH_LEAD, wanted))

    def _wanted_climb_mps(self, seen: Seen) -> float:
        p = self.plan
        if self.mode != HOLD:
            return max(-5.0, min(5.0, (self._height_m - seen.height_m) / CAPTURE_S))
        if math.isnan(p.hold_rate_mps):
            return seen.groundspeed_mps * math.tan(p.hold_angle)
        return p.hold_rate_mps * seen.temperature_k / isa_temperature_k(self.altitude_m)

    def _move_lever(self, seen: Seen, growth: float) -> None:
        p = self.plan
        if self.mode == DESCENT:
            iced = p.ice_share if p.ice_low_m < self.altitude_m <= p.ice_high_m else 0.0
            kept = (p.kept_share * math.exp(-self.age_s / p.kept_s) + iced) * (seen.drag_n - seen.idle_n)
            # JSBSim's turbines: thrust above idle goes as the square of the lever.
            wanted = max(p.idle_setting, math.sqrt(max(kept, 0.0) / max(seen.full_n, 1.0)))
            change = (wanted - self._lever) / self._step_s
        else:
            force = seen.mass_kg * (-self.speed_error_mps / SPEED_LAG_S - growth)
            change = force / max(seen.full_n, 1.0) / THRUST_LAG_S
        bounded = max(-LEVER_RATE, min(LEVER_RATE, change))
        self._lever = max(0.0, min(1.0, self._lever + self._step_s * bounded))

    def _brake(self) -> float:
        p = self.plan
        return p.brake if self.mode != CRUISE and p.brake_low_m < self.altitude_m <= p.brake_high_m else 0.0

    def _elevator(self, seen: Seen) -> float:
        r = self._response
        share = seen.dynamic_pa / r.dynamic_pa
        square = 0.5 + 1.5 * r.stiffness * share
        error = self._pitch_wanted - seen.pitch
        self._pitch_sum += self._step_s * error
        wanted = square * (error + self._pitch_sum / 3.0) - 1.6 * math.sqrt(square) * seen.pitch_rate
        return self._trim.elevator_rad - wanted / (r.control * share)


def _aileron(seen: Seen) -> float:
    """Hold north with at most two degrees of bank."""
    heading = (seen.heading + math.pi) % (2 * math.pi) - math.pi
    bank = max(-0.035, min(0.035, -heading))
    return max(-1.0, min(1.0, 1.0 * (bank - seen.roll) - 1.5 * seen.roll_rate))
