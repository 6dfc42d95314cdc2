"""A loaded JSBSim aircraft: initial condition and trim, what is read of it and what is moved, in SI units."""

import math
from pathlib import Path
from typing import Any

from descentflow.core.units import FT_M
from descentflow.simulation.weather import SPACING_M
from studies.jsbsim_world.airframes import Airframe
from studies.jsbsim_world.flight_plans import FlightPlan
from studies.jsbsim_world.model_files import FACTORS, jsbsim
from studies.jsbsim_world.pitch_autopilot import Commands, PitchResponse, Seen
from studies.jsbsim_world.scalar_air import mach_of_cas, pressure_altitude_m

LBF_N, SLUG_KG, PSF_PA, LB_KG = 4.4482216152605, 14.593902937206, 47.88025898, 0.45359237
NAUTICAL_MPS = 1852 / 3600
"""The knot that JSBSim uses."""
LATITUDE_DEG = 52.0
FASTEST_MPS = 500.0
"""Airspeed while the wind is set: in a wind faster than the airspeed JSBSim's initial condition turns round."""
_READ = (
    *("atmosphere/P-psf", "atmosphere/T-R", "atmosphere/a-fps", "velocities/mach", "position/h-sl-ft"),
    *("velocities/h-dot-fps", "velocities/vg-fps", "attitude/theta-rad", "velocities/q-rad_sec", "attitude/phi-rad"),
    *("velocities/p-rad_sec", "attitude/psi-rad", "aero/qbar-psf", "forces/fwx-aero-lbs", "inertia/mass-slugs"),
    "aero/alpha-rad",
)
_ENGINE = ("thrust-lbs", "IdleThrust", "MilThrust")
_PITCH = (
    ("aero/coefficient/Cmalpha", "aero/moment/Pitch_alpha"),
    ("aero/coefficient/Cmde", "aero/moment/Pitch_elevator"),
)


class FlightFailed(Exception):
    """A flight that is not kept; its message is the reason.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> from dataclasses import replace
        >>> from studies.jsbsim_world.model_flight import ModelFleet
        >>> model, config = airframe_of("MD11"), JsbsimConfig()
        >>> plan = replace(draw_plans(model, [0], 0, config)[0], cas_mps=60.0)  # too slow to fly
        >>> ModelFleet(model, Path("."), config).fly(plan)
        Traceback (most recent call last):
            ...
        studies.jsbsim_world.model_aircraft.FlightFailed: not trimmed
    """


def quiet_logger() -> Any:
    """A logger that drops what JSBSim prints.

    Raises:
        ConfigError: If JSBSim is not installed.

    Example:
        >>> quiet_logger().message("JSBSim Flight Dynamics Model")  # prints nothing
    """

    class Quiet(jsbsim().FGLogger):  # type: ignore[misc]
        def set_level(self, level: Any) -> None:
            """Drop."""

        def message(self, message: str) -> None:
            """Drop."""

        def file_location(self, filename: str, line: int) -> None:
            """Drop."""

        def format(self, format: Any) -> None:
            """Drop."""

        def flush(self) -> None:
            """Drop."""

    return Quiet()


class ModelAircraft:
    """One loaded model in trimmed level flight, read and moved in SI units.

    Args:
        module: JSBSim, see :func:`~studies.jsbsim_world.model_files.jsbsim`.
        folder: Folder of the copied files, see :func:`~studies.jsbsim_world.model_files.copy_model`.
        airframe: The model.
        load: Index of the point mass that brings the aircraft to its planned mass.
        plan: The flight.
        step_s: Step of the integration.

    Raises:
        FlightFailed: If the model cannot be loaded, put at its planned state or trimmed there.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> from studies.jsbsim_world.flight_plans import JsbsimConfig, draw_plans
        >>> from studies.jsbsim_world.model_files import copy_model
        >>> model, folder = airframe_of("MD11"), Path(".")
        >>> (plan,) = draw_plans(model, [0], seed=0, config=JsbsimConfig())
        >>> aircraft = ModelAircraft(jsbsim(), folder, model, copy_model(model, folder), plan, step_s=0.1)
        >>> seen = aircraft.read()
        >>> abs(seen.mass_kg - plan.mass_kg) < 1, abs(seen.climb_mps) < 0.1
        (True, True)
    """

    def __init__(
        self, module: Any, folder: Path, airframe: Airframe, load: int, plan: FlightPlan, step_s: float
    ) -> None:
        self._airframe, self._plan = airframe, plan
        self._fdm = fdm = module.FGFDMExec(str(folder))
        fdm.set_debug_level(0)
        # Before the files are read: the factors that they name, and the step, which moving parts keep from then on.
        fdm.set_dt(step_s)
        factors = (plan.cd0_factor, plan.cdi_factor, plan.wave_factor, plan.idle_factor)
        for name, value in zip(FACTORS, factors, strict=True):
            fdm[name] = value
        if not fdm.load_model(airframe.name):
            raise FlightFailed("not loaded")
        fdm.disable_output()
        fdm["atmosphere/delta-T"] = plan.deviation_k * 1.8
        self._start(load)
        nodes = fdm.get_property_manager().get_node
        engines = range(fdm.get_propulsion().get_num_engines())
        self._engines = [[nodes(f"propulsion/engine[{k}]/{name}") for name in _ENGINE] for k in engines]
        self._nodes = [nodes(name) for name in _READ]
        self._cas, self._brake = nodes("velocities/vc-kts"), nodes("fcs/speedbrake-pos-norm")
        self._levers = [nodes(f"fcs/throttle-cmd-norm[{k}]") for k in engines]
        self._moved = [nodes(f"fcs/{name}-cmd-norm") for name in ("elevator", "aileron", "speedbrake")]
        self._wind = nodes("atmosphere/wind-north-fps")
        self._rating_n = airframe.rated_n / len(engines)
        self.trimmed = self._trim()

    def _start(self, load: int) -> None:
        """Level flight at the planned pressure altitude and speed, in the planned wind, engines running."""
        fdm, p = self._fdm, self._plan
        weight = f"inertia/pointmass-weight-lbs[{load}]"
        fdm["gear/gear-cmd-norm"] = fdm["gear/gear-pos-norm"] = 0.0
        fdm["ic/lat-geod-deg"], fdm["ic/psi-true-deg"], fdm["ic/gamma-deg"] = LATITUDE_DEG, 0.0, 0.0
        fdm["propulsion/set-running"] = -1
        height, correction = p.top_m, 0.0
        for _ in range(8):
            wind = self.wind_mps(height)
            fdm["ic/h-sl-ft"], fdm["ic/vt-fps"] = height / FT_M, FASTEST_MPS / FT_M
            fdm["ic/vw-dir-deg"], fdm["ic/vw-mag-fps"] = (0.0 if wind >= 0 else 180.0), abs(wind) / FT_M
            pressure, sound = fdm["atmosphere/P-psf"] * PSF_PA, fdm["atmosphere/a-fps"] * FT_M
            wanted = sound * min(p.mach, mach_of_cas(p.cas_mps, pressure))
            fdm["ic/vt-fps"] = (wanted + correction) / FT_M
            fdm.run_ic()
            # JSBSim 1.3.3 takes the wind's direction one way round for the airspeed and the other for the air.
            correction += wanted - fdm["velocities/vt-fps"] * FT_M
            height += p.top_m - pressure_altitude_m(fdm["atmosphere/P-psf"] * PSF_PA)
            fdm[weight] += p.mass_kg / LB_KG - fdm["inertia/weight-lbs"]
        if abs(fdm["atmosphere/wind-north-fps"] * FT_M - wind) > 0.1:
            raise FlightFailed("no initial condition")

    def _trim(self) -> Commands:
        try:
            self._fdm.do_trim(0)
        except RuntimeError as error:
            raise FlightFailed("not trimmed") from error
        elevator, lever = _elevator(self._fdm), self._fdm["fcs/throttle-cmd-norm"]
        self._fdm["fcs/pitch-trim-cmd-norm"] = 0.0
        commands = Commands(elevator, 0.0, lever, 0.0)
        self.move(commands)
        return commands

    def response(self) -> PitchResponse:
        """Pitch stiffness and control in the flight's present state."""
        fdm = self._fdm
        catalog = {name.split(" ")[0] for name in fdm.get_property_catalog()}
        alpha, control = (next(name for name in names if name in catalog) for names in _PITCH)
        inertia = fdm["inertia/iyy-slugs_ft2"]
        return PitchResponse(
            fdm["aero/qbar-psf"] * PSF_PA,
            -fdm[alpha] / fdm["aero/alpha-rad"] / inertia,
            -fdm[control] / _elevator(fdm) / inertia,
        )

    def wind_mps(self, height_m: float) -> float:
        """Tailwind at a geometric altitude."""
        layers, place = self._plan.layered_mps, max(height_m / SPACING_M, 0.0)
        below = min(int(place), len(layers) - 2)
        layered = layers[below] + (place - below) * (layers[below + 1] - layers[below]) if layers else 0.0
        return self._plan.wind_mps + self._plan.wind_slope_per_s * height_m + layered

    def read(self) -> Seen:
        """Read the present state."""
        v = [node.get_double_value() for node in self._nodes]
        engines = [[node.get_double_value() for node in nodes] for nodes in self._engines]
        thrust = sum(e[0] for e in engines) * LBF_N * math.cos(v[15])
        idle = self._rating_n * sum(e[1] for e in engines)
        full = self._rating_n * sum((1 - e[1]) * e[2] for e in engines)
        return Seen(
            pressure_pa=v[0] * PSF_PA,
            temperature_k=v[1] / 1.8,
            sound_mps=v[2] * FT_M,
            mach=v[3],
            height_m=v[4] * FT_M,
            climb_mps=v[5] * FT_M,
            groundspeed_mps=v[6] * FT_M,
            pitch=v[7],
            pitch_rate=v[8],
            roll=v[9],
            roll_rate=v[10],
            heading=v[11],
            dynamic_pa=v[12] * PSF_PA,
            drag_n=v[13] * LBF_N,
            thrust_n=thrust,
            idle_n=idle,
            full_n=full,
            mass_kg=v[14] * SLUG_KG,
        )

    def move(self, commands: Commands) -> None:
        """Set the controls."""
        nose_up, nose_down = self._airframe.elevator_rad
        radians = commands.elevator_rad
        elevator = radians / nose_down if radians > 0 else -radians / nose_up
        for node, value in zip(self._moved, (elevator, commands.aileron, commands.brake), strict=True):
            node.set_double_value(max(-1.0, min(1.0, value)))
        for node in self._levers:
            node.set_double_value(commands.lever)

    def blow(self, height_m: float) -> None:
        """Set the wind of a height."""
        self._wind.set_double_value(self.wind_mps(height_m) / FT_M)

    def run(self) -> None:
        """Integrate one step."""
        try:
            self._fdm.run()
        except RuntimeError as error:
            raise FlightFailed("diverged") from error

    @property
    def cas_mps(self) -> float:
        """CAS as JSBSim works it out."""
        return float(self._cas.get_double_value()) * NAUTICAL_MPS

    @property
    def brake(self) -> float:
        """Position of the speed brakes, 0 to 1."""
        return float(self._brake.get_double_value())


def _elevator(fdm: Any) -> float:
    """Position of the elevator in radians; of a model that knows a share of its range alone, that share."""
    return float(fdm["fcs/elevator-pos-rad"] or fdm["fcs/elevator-pos-norm"])
