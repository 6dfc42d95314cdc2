"""Fly a batch of flights from cruise to the bottom of descent and keep what they did."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.errors import ConfigError
from descentflow.performance.aircraft import Aircraft
from descentflow.units import FL_M
from descentflow.world.autopilot import DONE, decide, labels, start
from descentflow.world.config import WorldConfig
from descentflow.world.motion import Plant
from descentflow.world.parameters import FlightParameters

LONGEST_S = 7200.0
"""A flight that has not come down by then never will."""
WIDTH = 64
"""Batches are filled up to a multiple of this: the last few entries of a vector take another path through the
processor, and with it another last bit, so that a flight's numbers would depend on its place in the batch."""


@dataclass(frozen=True)
class Flown:
    """Records at a fixed interval, each of shape (records, n); rows after a flight's end are not ``flying``."""

    time_s: Tensor
    """(records,)"""
    tas_mps: Tensor
    altitude_m: Tensor
    height_m: Tensor
    gamma: Tensor
    thrust_n: Tensor
    drag_n: Tensor
    wind_mps: Tensor
    label: Tensor
    """Codes of :data:`descentflow.world.autopilot.LABELS`."""
    flying: Tensor


@torch.no_grad()
def fly(aircraft: Aircraft, parameters: FlightParameters, config: WorldConfig | None = None) -> Flown:
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
        >>> flown = fly(aircraft, draw_parameters(aircraft, range(10), seed=0))
    """
    config = config or WorldConfig()
    n = len(parameters)
    full = torch.arange(-(-n // WIDTH) * WIDTH).clamp(max=n - 1)
    plant = Plant(aircraft, parameters.rows(full))
    state, pilot = start(plant)
    times: list[float] = []
    records: list[list[Tensor]] = []
    tick = 0
    while True:
        time_s = tick * config.step_s
        state_now, gamma, extra = state, pilot.gamma, pilot.extra_n
        pilot, controls, drag = decide(plant, state, pilot, time_s, config.step_s)
        flying = pilot.mode != DONE
        if not bool(flying.any()):
            break
        if tick % config.interval_s == 0:
            thrust = plant.idle_n(state_now) + extra
            values = [state_now.tas_mps, state_now.altitude_m, state_now.height_m, gamma, thrust, drag]
            values += [plant.wind_mps(state_now), labels(pilot, drag).to(torch.int8), flying]
            times.append(time_s)
            records.append([v[:n] for v in values])
        if time_s > LONGEST_S:
            _complain(aircraft, state.altitude_m[flying])
        state = plant.step(state, controls, config.step_s, config.substeps)
        tick += 1
    stacked = [torch.stack(column) for column in zip(*records, strict=True)]
    return Flown(torch.tensor(times, dtype=torch.float64), *stacked)


def _complain(aircraft: Aircraft, altitude_m: Tensor) -> None:
    raise ConfigError(
        f"{len(altitude_m)} flights of {aircraft.typecode} still at up to FL{float(altitude_m.max()) / FL_M:.0f} after "
        f"{LONGEST_S / 60:.0f} minutes",
        expected="idle thrust well below drag",
        mend="check the aircraft's descent thrust coefficients and the thrust factors of the flights",
    )
