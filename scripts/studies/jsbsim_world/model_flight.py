"""One flight of one JSBSim aircraft: the loop of steps, what is recorded, and when a flight has failed."""

import math
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from descentflow.core.units import FPM_MPS
from descentflow.simulation.autopilot import IDLE_LABEL, MANAGED_LABEL, PATH_LABEL, TRANSIENT_LABEL
from studies.jsbsim_world.airframes import Airframe
from studies.jsbsim_world.flight_plans import FlightPlan, JsbsimConfig
from studies.jsbsim_world.model_aircraft import FlightFailed, ModelAircraft, quiet_logger
from studies.jsbsim_world.model_files import copy_model, jsbsim
from studies.jsbsim_world.pitch_autopilot import CRUISE, DESCENT, DONE, HOLD, Autopilot, Commands, Seen

SETTLING_S = 60.0
"""Beginning of every flight that is not recorded: the trim's last errors die out."""
LONGEST_S = 5400.0
POSSIBLE_MACH = (0.2, 1.0)
LEAST_PA = 5000.0
"""A flight outside these has diverged."""
WORST_SPEED_MPS = 3.0
"""Largest speed error of a settled idle descent."""
WORST_BANK = math.radians(5.0)
"""Largest bank of one."""
COLUMNS = (
    *("time_s", "altitude_m", "height_m", "cas_mps", "mach", "tas_mps", "groundspeed_mps", "rate_mps", "gamma"),
    *("drag_n", "thrust_n", "mass_kg", "temperature_k", "wind_mps", "brake", "lever", "speed_error_mps", "label"),
)
"""Of a record; see :func:`studies.jsbsim_world.fly_models.fly`."""


@dataclass(frozen=True)
class Record:
    """States of a flight, in rows of :data:`COLUMNS`, and the plan that it flew (with the path that it held).

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> (plan,) = draw_plans(airframe_of("MD11"), [0], 0, JsbsimConfig())
        >>> Record(plan, np.zeros((3, len(COLUMNS)))).column("mach")
        array([0., 0., 0.])
    """

    plan: FlightPlan
    rows: NDArray[np.float64]

    def column(self, name: str) -> NDArray[np.float64]:
        """Values of a column."""
        return self.rows[:, COLUMNS.index(name)]


class ModelFleet:
    """Flies plans with one model; its files are copied into a folder once.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import draw_plans
        >>> config = JsbsimConfig()
        >>> record = ModelFleet(airframe_of("MD11"), Path("."), config).fly(
        ...     draw_plans(airframe_of("MD11"), [0], seed=0, config=config)[0]
        ... )
        >>> bool((record.column("mach") < 0.84).all())
        True
    """

    def __init__(self, airframe: Airframe, folder: Path, config: JsbsimConfig) -> None:
        self.airframe, self.config, self._folder = airframe, config, folder
        self._load = copy_model(airframe, folder)
        self._quiet = quiet_logger()

    def fly(self, plan: FlightPlan) -> Record:
        """Fly one plan; one that holds a path flies an idle descent first, from which its path is chosen.

        Raises:
            FlightFailed: If the model cannot be trimmed, diverges or does not come down.
        """
        if not math.isnan(plan.hold_of_idle):
            plan = _chosen_path(plan, self._fly(replace(plan, hold_of_idle=math.nan, hold_low_m=math.nan)))
        return self._fly(plan)

    def _fly(self, plan: FlightPlan) -> Record:
        module = jsbsim()
        before = module.get_logger()
        module.set_logger(self._quiet)
        try:
            aircraft = ModelAircraft(module, self._folder, self.airframe, self._load, plan, self.config.step_s)
            return Record(plan, _flown(aircraft, plan, self.config))
        finally:
            module.set_logger(before)


def _flown(aircraft: ModelAircraft, plan: FlightPlan, config: JsbsimConfig) -> NDArray[np.float64]:
    """Fly from trim to the bottom; rows of :data:`COLUMNS` after the first minute."""
    every = round(config.interval_s / config.step_s)
    seen = aircraft.read()
    pilot = Autopilot(plan, aircraft.response(), aircraft.trimmed, seen, config.step_s)
    rows: list[list[float]] = []
    tick = 0
    while True:
        time_s = tick * config.step_s
        before = pilot.altitude_m
        if not (POSSIBLE_MACH[0] < seen.mach < POSSIBLE_MACH[1] and seen.pressure_pa > LEAST_PA):
            raise FlightFailed("diverged")
        commands = pilot.step(seen, time_s)
        if pilot.mode == DONE:
            break
        if tick % every == 0:
            _check(time_s, seen, pilot)
            if time_s >= SETTLING_S:
                rate = (pilot.altitude_m - before) / config.step_s
                rows.append([time_s - SETTLING_S, *_record(aircraft, seen, rate, pilot, commands)])
        aircraft.move(commands)
        aircraft.blow(seen.height_m)
        aircraft.run()
        seen = aircraft.read()
        tick += 1
    return np.array(rows)


def _record(aircraft: ModelAircraft, seen: Seen, rate_mps: float, pilot: Autopilot, commands: Commands) -> list[float]:
    """One row of :data:`COLUMNS` without its time."""
    tas, brake = seen.mach * seen.sound_mps, aircraft.brake
    gamma = math.asin(max(-1.0, min(1.0, seen.climb_mps / tas)))
    row = [pilot.altitude_m, seen.height_m, aircraft.cas_mps, seen.mach, tas, seen.groundspeed_mps, rate_mps, gamma]
    row += [seen.drag_n, seen.thrust_n, seen.mass_kg, seen.temperature_k, aircraft.wind_mps(seen.height_m)]
    return [*row, brake, commands.lever, pilot.speed_error_mps, float(_label(pilot))]


def _check(time_s: float, seen: Seen, pilot: Autopilot) -> None:
    """Refuse a flight that is not flown as planned."""
    if not all(map(math.isfinite, astuple(seen))):
        raise FlightFailed("diverged")
    if time_s > LONGEST_S:
        raise FlightFailed("not down in time")
    if time_s >= SETTLING_S and abs(seen.roll) > WORST_BANK:
        raise FlightFailed("banked")
    steady = pilot.settled or pilot.mode == CRUISE
    if time_s >= SETTLING_S and steady and abs(pilot.speed_error_mps) > WORST_SPEED_MPS:
        raise FlightFailed("speed not held")


def _label(pilot: Autopilot) -> int:
    if pilot.mode == HOLD and pilot.settled:
        return MANAGED_LABEL if math.isnan(pilot.plan.hold_angle) else PATH_LABEL
    return IDLE_LABEL if pilot.mode == DESCENT and pilot.settled else TRANSIENT_LABEL


def _chosen_path(plan: FlightPlan, idle: Record) -> FlightPlan:
    """Choose the path or the rate that a flight holds, from its own idle descent.

    A path is planned in steps of a tenth of a degree and a rate in steps of 100 ft/min, the shallower one each time,
    so that thrust is left to hold the speed.

    Args:
        plan: The flight; ``hold_of_idle`` is the share of the shallowest idle descent between the two levels.
        idle: What it does at idle.

    Returns:
        The plan with its angle or rate.

    Raises:
        FlightFailed: If the idle descent has no settled row between the levels.
    """
    altitude, steady = idle.column("altitude_m"), idle.column("label") == IDLE_LABEL
    inside = steady & (altitude <= plan.hold_high_m) & (altitude > plan.hold_low_m)
    if not inside.any():
        raise FlightFailed("no idle descent between the levels of the held path")
    climb = idle.column("tas_mps") * np.sin(idle.column("gamma"))
    angle = np.arctan(climb / idle.column("groundspeed_mps"))[inside].max()
    rate = idle.column("rate_mps")[inside].max()
    if plan.hold_path:
        degrees = math.ceil(math.degrees(angle) * plan.hold_of_idle * 10) / 10
        return replace(plan, hold_angle=math.radians(degrees))
    hundred = 100 * FPM_MPS
    return replace(plan, hold_rate_mps=math.ceil(rate * plan.hold_of_idle / hundred) * hundred)
