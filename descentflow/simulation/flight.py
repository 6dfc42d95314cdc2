"""Fly a batch of flights from cruise to the bottom of descent and keep what they did."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.core.threads import one_thread
from descentflow.core.units import FL_M
from descentflow.physics.airspeed import tas_to_cas_mps, tas_to_mach
from descentflow.physics.atmosphere import isa_fraction
from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.autopilot import DONE, decide, labels, start
from descentflow.simulation.motion import Dynamics, Motion
from descentflow.simulation.parameters import WIDTH, FlightParameters
from descentflow.simulation.world_config import WorldConfig

LONGEST_S = 7200.0
"""A flight that has not come down by then never will."""


@dataclass(frozen=True)
class Flown:
    """Records at a fixed interval, each of shape (records, n); rows after a flight's end are not ``flying``.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft, config = open_aircraft("A320"), WorldConfig(bottom_fl=290.0, low_top_share=0.0)
        >>> flown = fly(aircraft, draw_parameters(aircraft, [0], 0, config), config)
        >>> flown.mach.shape == (len(flown.time_s), 1), flown.time_s[:3].tolist()
        (True, [0.0, 4.0, 8.0])
    """

    time_s: Tensor
    """(records,)"""
    altitude_m: Tensor
    """Pressure altitude."""
    height_m: Tensor
    """Geometric altitude."""
    cas_mps: Tensor
    mach: Tensor
    tas_mps: Tensor
    groundspeed_mps: Tensor
    rate_mps: Tensor
    """Of pressure altitude."""
    gamma: Tensor
    """Path angle through the air, radians."""
    drag_n: Tensor
    thrust_n: Tensor
    label: Tensor
    """Codes of :data:`descentflow.simulation.autopilot.LABELS`."""
    flying: Tensor


@torch.no_grad()
def fly(aircraft: PerformanceModel, parameters: FlightParameters, config: WorldConfig | None = None) -> Flown:
    """Fly every flight by the equation of motion.

    Args:
        aircraft: Coefficients of the type.
        parameters: The flights, shape (n,).
        config: Steps and interval of records.

    Returns:
        Records of shape (records, n), float64.

    Raises:
        ConfigError: If a flight does not come down within two hours: idle thrust that exceeds drag.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft, config = open_aircraft("A320"), WorldConfig(bottom_fl=290.0, low_top_share=0.0)
        >>> flown = fly(aircraft, draw_parameters(aircraft, range(2), 0, config), config)
        >>> flown.altitude_m.shape == flown.rate_mps.shape, float(flown.altitude_m[flown.flying].min()) < 8_900
        (True, True)
    """
    with one_thread():
        return _fly(aircraft, parameters, config or WorldConfig())


def _fly(aircraft: PerformanceModel, parameters: FlightParameters, config: WorldConfig) -> Flown:
    n = len(parameters)
    full = torch.arange(-(-n // WIDTH) * WIDTH).clamp(max=n - 1)
    dynamics = Dynamics(aircraft, parameters.rows(full))
    state, pilot = start(dynamics)
    times: list[float] = []
    records: list[list[Tensor]] = []
    tick = 0
    while True:
        time_s = tick * config.step_s
        gamma, extra = pilot.gamma, pilot.extra_n
        pilot, controls, drag = decide(dynamics, state, pilot, time_s, config.step_s)
        flying = pilot.mode != DONE
        if not bool(flying.any()):
            break
        if tick % config.interval_s == 0:
            values = [*_measured(dynamics, state, gamma), gamma, drag, dynamics.idle_n(state) + extra]
            values += [labels(pilot, drag, dynamics.parameters.injected).to(torch.int8), flying]
            times.append(time_s)
            records.append([v[:n] for v in values])
        if time_s > LONGEST_S:
            _complain(aircraft, state.altitude_m[flying])
        state = dynamics.step(state, controls, config.step_s, config.substeps)
        tick += 1
    stacked = [torch.stack(column) for column in zip(*records, strict=True)]
    return Flown(torch.tensor(times, dtype=torch.float64), *stacked)


def _measured(dynamics: Dynamics, state: Motion, gamma: Tensor) -> list[Tensor]:
    """Altitudes, speeds and rate, in the order of :class:`Flown`."""
    tas, altitude = state.tas_mps, state.altitude_m
    deviation = dynamics.deviation_k(altitude)
    cas, mach = tas_to_cas_mps(tas, altitude, deviation), tas_to_mach(tas, altitude, deviation)
    over_ground = tas * torch.cos(gamma) + dynamics.wind_mps(state)
    rate = tas * torch.sin(gamma) * isa_fraction(altitude, deviation)
    return [altitude, state.height_m, cas, mach, tas, over_ground, rate]


def _complain(aircraft: PerformanceModel, altitude_m: Tensor) -> None:
    raise ConfigError(
        f"{len(altitude_m)} flights of {aircraft.typecode} still at up to FL{float(altitude_m.max()) / FL_M:.0f} after "
        f"{LONGEST_S / 60:.0f} minutes",
        expected="idle thrust well below drag",
        mend="check the aircraft's descent thrust coefficients and the thrust factors of the flights",
    )
