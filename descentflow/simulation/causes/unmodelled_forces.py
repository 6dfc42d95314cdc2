"""Forces that the catalogue does not know: wave drag, thrust that is kept up, turns, anti-ice."""

import math

import numpy as np
import torch

from descentflow.core.units import FL_M
from descentflow.simulation.cause_values import Values
from descentflow.simulation.causes.cause import Cause, Fleet, Own, only
from descentflow.simulation.parameters import FlightParameters


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
