"""Mass, thrust and drag that differ from the simulator's, and forces that it does not know."""

import math
from collections.abc import Mapping

import numpy as np
import torch

from descentflow.core.units import FL_M
from descentflow.simulation.causes.cause import Cause, Fleet, sign
from descentflow.simulation.parameters import FlightParameters

ONSET = 0.06
"""Compressibility drag begins this far below the planned Mach number."""


class _Factor:
    """Draws ``{"factor": 1 +- full * size}``."""

    def __init__(self, full: float) -> None:
        self.full = full

    def __call__(self, generator: np.random.Generator, size: float) -> dict[str, float]:
        return {"factor": 1 + self.full * size * sign(generator)}


def _load(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    return fleet.with_parameters(mass_kg=fleet.parameters.mass_kg * values["factor"])


def _idle(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    return fleet.with_parameters(thrust_factor=fleet.parameters.thrust_factor * values["factor"])


def _polar(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    return fleet.with_parameters(cd0_factor=fleet.parameters.cd0_factor * values["factor"])


def _brake(generator: np.random.Generator, size: float) -> dict[str, float]:
    high = generator.uniform(230, 300)
    low = high - generator.uniform(40, 60)
    return {"factor": 1 + 0.6 * size, "share": generator.uniform(0.4, 0.8), "low_fl": low, "high_fl": high}


def _extend(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    gain = torch.where(fleet.chosen(values["share"]), values["factor"] - 1, 0.0).double()
    high, low = values["high_fl"] * FL_M, values["low_fl"] * FL_M
    return fleet.with_injected(brake_gain=gain, brake_high_m=high, brake_low_m=low)


def _wave(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"gain": 0.2 * size}


def _compress(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    planned = float(fleet.aircraft.des_mach)
    return fleet.with_injected(wave_gain=values["gain"], wave_onset=planned - ONSET, wave_mach=planned)


def _kept(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.4 * size, "decay_s": generator.uniform(120, 180)}


def _keep(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    return fleet.with_injected(kept_share=values["share"], kept_s=values["decay_s"])


def _bank(generator: np.random.Generator, size: float) -> dict[str, float]:
    # The square of the load factor, on which drag depends, grows with the size: a bank of 30 degrees is its full size.
    bank = math.acos((1 + size / 3) ** -0.5)
    return {"bank_deg": math.degrees(bank), "share": generator.uniform(0.7, 0.9), "depth_fl": generator.uniform(30, 50)}


def _turn(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    bank = torch.where(fleet.chosen(values["share"]), math.radians(values["bank_deg"]), 0.0).double()
    side = torch.where(fleet.uniform[:, 1] < 0.5, -1.0, 1.0)
    high = (190 + 110 * fleet.uniform[:, 0]) * FL_M
    return fleet.with_injected(bank_rad=bank * side, turn_high_m=high, turn_low_m=high - values["depth_fl"] * FL_M)


MASS = Cause("mass", {"factor": "1"}, _Factor(0.1), _load)
"""10 % lighter or heavier at full size."""
IDLE_THRUST = Cause("idle_thrust", {"factor": "1"}, _Factor(0.8), _idle)
"""80 % less or more at full size: only a twentieth of the open A320's retarding force is idle thrust."""
DRAG_POLAR = Cause("drag_polar", {"factor": "1"}, _Factor(0.1), _polar)
"""CD0 10 % lower or higher at full size."""
SPEED_BRAKE = Cause("speed_brake", {"factor": "1", "share": "1", "low_fl": "FL", "high_fl": "FL"}, _brake, _extend)
"""CD0 up by 60 % at full size between two levels, on a share of the flights."""
COMPRESSIBILITY = Cause("compressibility", {"gain": "1"}, _wave, _compress)
"""Wave drag near M_MO: 20 % of CD0 at the planned Mach number at full size, as the square from 0.06 below."""
KEPT_THRUST = Cause("kept_thrust", {"share": "1", "decay_s": "s"}, _kept, _keep)
"""Thrust kept up at the top of descent: 40 % of drag minus idle thrust at full size, decaying in some 150 s."""
TURN = Cause("turn", {"bank_deg": "deg", "share": "1", "depth_fl": "FL"}, _bank, _turn)
"""A turn of 30 degrees of bank at full size, over 3,000 to 5,000 ft at a height of each flight's own."""
