"""Mass, thrust, drag and brakes that differ from the simulator's, and forces that no effect of the catalogue is."""

import math
from collections.abc import Callable

import numpy as np
import torch

from descentflow.core.units import FL_M
from descentflow.simulation.cause_values import Values
from descentflow.simulation.causes.cause import Cause, Fleet, Own, only, sign
from descentflow.simulation.parameters import FlightParameters

LEAST_FACTOR = 0.2
"""A factor of a flight's own, however far out its draw, is no less."""
NARROWEST_FL = 10.0
"""Nor is a window of a flight's own less high."""


class _Factor:
    """Draws ``{"factor": 1 +- full * size}``."""

    def __init__(self, full: float) -> None:
        self.full = full

    def __call__(self, generator: np.random.Generator, size: float) -> dict[str, float]:
        return {"factor": 1 + self.full * size * sign(generator)}


class _Multiply:
    """Multiplies a parameter by a factor of each flight's own, on a share of the flights."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
        own = (v["factor"] + v["spread"] * fleet.normal[:, 0]).clamp(min=LEAST_FACTOR)
        chosen = fleet.chosen(v["share"])
        before = getattr(fleet.parameters, self.name)
        return fleet.with_parameters(**{self.name: before * torch.where(chosen, own, 1.0)}), only(chosen, factor=own)


def _by_flight(spread: float) -> Callable[[np.random.Generator, float], dict[str, float]]:
    """Of a factor that each flight has of its own, or a share of the flights alone."""

    def vary(generator: np.random.Generator, size: float) -> dict[str, float]:
        return {"spread": spread * size, "share": float(generator.choice([1.0, generator.uniform(0.5, 0.9)]))}

    return vary


def _brake(generator: np.random.Generator, size: float) -> dict[str, float]:
    high = generator.uniform(230, 300)
    low = high - generator.uniform(40, 60)
    return {"factor": 1 + 0.6 * size, "share": generator.uniform(0.4, 0.8), "low_fl": low, "high_fl": high}


def _own_brakes(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_fl": generator.uniform(10.0, 40.0), "depth_spread": 0.2, "strength_spread": 0.2}


def _extend(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    z = fleet.normal.clamp(-3.0, 3.0)
    middle = (v["low_fl"] + v["high_fl"]) / 2 + v["spread_fl"] * z[:, 0]
    depth = ((v["high_fl"] - v["low_fl"]) * (1 + v["depth_spread"] * z[:, 1])).clamp(min=NARROWEST_FL)
    gain = ((v["factor"] - 1) * (1 + v["strength_spread"] * z[:, 2])).clamp(min=0.0)
    chosen = fleet.chosen(v["share"])
    low, high = middle - depth / 2, middle + depth / 2
    changed = fleet.with_injected(
        brake_gain=torch.where(chosen, gain, 0.0).double(), brake_high_m=high * FL_M, brake_low_m=low * FL_M
    )
    return changed, only(chosen, factor=1 + gain, low_fl=low, high_fl=high)


def _induce(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    n = torch.ones_like(fleet.parameters.mass_kg)
    return fleet.with_injected(induced_gain=v["factor"] - 1), {"factor": v["factor"] * n}


MASS = Cause("mass", _Factor(0.1), _Multiply("mass_kg"), stream=2, vary=_by_flight(0.05))
"""10 % lighter or heavier at full size."""
IDLE_THRUST = Cause("idle_thrust", _Factor(0.8), _Multiply("thrust_factor"), stream=3, vary=_by_flight(0.3))
"""80 % less or more at full size: only a twentieth of the open A320's retarding force is idle thrust."""
DRAG_POLAR = Cause("drag_polar", _Factor(0.1), _Multiply("cd0_factor"), stream=4, vary=_by_flight(0.04))
"""CD0 10 % lower or higher at full size."""
SPEED_BRAKE = Cause("speed_brake", _brake, _extend, stream=5, vary=_own_brakes)
"""CD0 up by 60 % at full size between two levels, on a share of the flights; levels and drag may be each flight's."""
INDUCED_DRAG = Cause("induced_drag", _Factor(0.1), _induce, stream=16)
"""CD2 10 % lower or higher at full size: a polar of the wrong shape, which the catalogue does not have."""


def _wave(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"gain": 0.2 * size}


def _compress(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    planned = float(fleet.aircraft.des_mach)
    onset = planned - v["onset_below"]
    own = v["gain"] * torch.ones_like(fleet.parameters.mass_kg)
    return fleet.with_injected(wave_gain=own, wave_onset=onset, wave_mach=planned), {"gain": own}


def _kept(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.4 * size, "decay_s": generator.uniform(120, 180)}


def _own_keeping(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share_range": 0.1 * size, "decay_range_s": 60.0, "of_flights": generator.uniform(0.7, 1.0)}


def _keep(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    chosen = fleet.chosen(v["of_flights"])
    share, decay = fleet.about(v["share"], v["share_range"], 0), fleet.about(v["decay_s"], v["decay_range_s"], 1)
    changed = fleet.with_injected(kept_share=torch.where(chosen, share, 0.0), kept_s=decay)
    return changed, only(chosen, share=share, decay_s=decay)


def _bank(generator: np.random.Generator, size: float) -> dict[str, float]:
    # The square of the load factor, on which drag depends, grows with the size: a bank of 30 degrees is its full size.
    bank = math.acos((1 + size / 3) ** -0.5)
    return {"bank_deg": math.degrees(bank), "share": generator.uniform(0.7, 0.9), "depth_fl": generator.uniform(30, 50)}


def _turn(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    chosen = fleet.chosen(v["share"])
    bank = torch.where(chosen, math.radians(v["bank_deg"]), 0.0).double()
    side = torch.where(fleet.uniform[:, 1] < 0.5, -1.0, 1.0)
    high = 190 + 110 * fleet.uniform[:, 0]
    low = high - v["depth_fl"]
    changed = fleet.with_injected(bank_rad=bank * side, turn_high_m=high * FL_M, turn_low_m=low * FL_M)
    return changed, only(chosen, bank_deg=v["bank_deg"] * side, low_fl=low, high_fl=high)


def _ice(generator: np.random.Generator, size: float) -> dict[str, float]:
    high = generator.uniform(230, 290)
    return {
        "share": generator.uniform(0.5, 0.9),
        "drag_share": 0.4 * size,
        "low_fl": high - generator.uniform(40, 60),
        "high_fl": high,
        "spread_fl": generator.uniform(5.0, 25.0),
    }


def _heat(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    chosen, shift = fleet.chosen(v["share"]), v["spread_fl"] * fleet.normal[:, 0]
    low, high = v["low_fl"] + shift, v["high_fl"] + shift
    gain = torch.where(chosen, v["drag_share"], 0.0).double()
    changed = fleet.with_injected(ice_share=gain, ice_low_m=low * FL_M, ice_high_m=high * FL_M)
    return changed, only(chosen, drag_share=v["drag_share"], low_fl=low, high_fl=high)


def _powered(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.18 * size, "share_range": 0.06 * size}


def _power(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    chosen, share = fleet.chosen(v["of_flights"]), fleet.about(v["share"], v["share_range"], 0)
    return fleet.with_injected(power_share=torch.where(chosen, share, 0.0)), only(chosen, share=share)


COMPRESSIBILITY = Cause("compressibility", _wave, _compress, stream=13)
"""20 % of CD0 at the planned Mach number at full size, as the square of Mach number above 0.06 below it."""
KEPT_THRUST = Cause("kept_thrust", _kept, _keep, stream=14, vary=_own_keeping)
"""40 % of drag minus idle thrust at full size, decaying in some 150 s."""
TURN = Cause("turn", _bank, _turn, stream=15)
"""30 degrees of bank at full size, over 3,000 to 5,000 ft."""
ANTI_ICE = Cause("anti_ice", _ice, _heat, stream=17)
"""Thrust of 40 % of drag minus idle thrust at full size: speed brakes the other way round."""
POWERED_DESCENT = Cause("powered_descent", _powered, _power, stream=18)
"""Flights that descend 18 % slower at full size, for their thrust is never taken back altogether."""
