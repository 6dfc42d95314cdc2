"""Mass, thrust, drag and brakes that differ from the simulator's, and forces that no effect of the catalogue is."""

import math

import torch

from descentflow.core.units import FL_M
from descentflow.simulation.causes.cause import Fleet, Inject, Own, only
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.plantable import Values

LEAST_FACTOR = 0.2
"""A factor of a flight's own, however far out its draw, is no less."""
NARROWEST_FL = 10.0
"""Nor is a window of a flight's own less high."""


def multiply(name: str) -> Inject:
    """Multiply a parameter by a factor of each flight's own, on a share of the flights."""

    def inject(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
        own = (v["factor"] + v["spread"] * fleet.normal[:, 0]).clamp(min=LEAST_FACTOR)
        chosen = fleet.chosen(v["share"])
        changed = getattr(fleet.parameters, name) * torch.where(chosen, own, 1.0)
        return fleet.with_parameters(**{name: changed}), only(chosen, factor=own)

    return inject


def extend(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Add drag of speed brakes between two levels; levels and drag may be each flight's own."""
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


def induce(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Multiply CD2."""
    n = torch.ones_like(fleet.parameters.mass_kg)
    return fleet.with_injected(induced_gain=v["factor"] - 1), {"factor": v["factor"] * n}


def compress(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Add drag with the square of the Mach number above an onset."""
    planned = float(fleet.aircraft.des_mach)
    onset = planned - v["onset_below"]
    own = v["gain"] * torch.ones_like(fleet.parameters.mass_kg)
    return fleet.with_injected(wave_gain=own, wave_onset=onset, wave_mach=planned), {"gain": own}


def keep(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Keep thrust up at the top, decaying."""
    chosen = fleet.chosen(v["of_flights"])
    share, decay = fleet.about(v["share"], v["share_range"], 0), fleet.about(v["decay_s"], v["decay_range_s"], 1)
    changed = fleet.with_injected(kept_share=torch.where(chosen, share, 0.0), kept_s=decay)
    return changed, only(chosen, share=share, decay_s=decay)


def turn(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Bank over some thousand feet, at levels of each flight's own."""
    chosen = fleet.chosen(v["share"])
    bank = torch.where(chosen, math.radians(v["bank_deg"]), 0.0).double()
    side = torch.where(fleet.uniform[:, 1] < 0.5, -1.0, 1.0)
    high = 190 + 110 * fleet.uniform[:, 0]
    low = high - v["depth_fl"]
    changed = fleet.with_injected(bank_rad=bank * side, turn_high_m=high * FL_M, turn_low_m=low * FL_M)
    return changed, only(chosen, bank_deg=v["bank_deg"] * side, low_fl=low, high_fl=high)


def heat(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Keep thrust up between two levels."""
    chosen, shift = fleet.chosen(v["share"]), v["spread_fl"] * fleet.normal[:, 0]
    low, high = v["low_fl"] + shift, v["high_fl"] + shift
    gain = torch.where(chosen, v["drag_share"], 0.0).double()
    changed = fleet.with_injected(ice_share=gain, ice_low_m=low * FL_M, ice_high_m=high * FL_M)
    return changed, only(chosen, drag_share=v["drag_share"], low_fl=low, high_fl=high)


def power(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Keep thrust up all the way down."""
    chosen, share = fleet.chosen(v["of_flights"]), fleet.about(v["share"], v["share_range"], 0)
    return fleet.with_injected(power_share=torch.where(chosen, share, 0.0)), only(chosen, share=share)
