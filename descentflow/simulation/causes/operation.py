"""Descents that are flown otherwise: constant paths and rates, level-offs, other speeds."""

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.autopilot import target_tas_mps
from descentflow.simulation.causes.cause import Cause, Fleet, sign
from descentflow.simulation.motion import Dynamics, Motion
from descentflow.simulation.parameters import FlightParameters

_POINTS = 8
"""Heights at which an idle descent is worked out before a path or a rate below it is chosen."""


def _idle_path(fleet: Fleet, high_m: Tensor, low_m: Tensor) -> tuple[Tensor, Tensor]:
    """Path angle and vertical speed of an idle descent where they are shallowest between two altitudes.

    ``Thr - D = m g sin(gamma) + m dV/dt`` with ``dV/dt = V sin(gamma) (dV/dh + dw/dh)``, the speed's change with height
    by difference.

    Args:
        fleet: The flights.
        high_m: (n,) upper pressure altitude.
        low_m: (n,) lower one.

    Returns:
        Angle (radians, negative) and vertical speed (m/s, negative) through the air, each of shape (n,).
    """
    p, dynamics = fleet.parameters, Dynamics(fleet.aircraft, fleet.parameters)
    angles, rates = [], []
    for share in np.linspace(0, 1, _POINTS):
        altitude = low_m + float(share) * (high_m - low_m)
        tas = target_tas_mps(dynamics, altitude, 0.0)
        slope = (target_tas_mps(dynamics, altitude + 50, 0.0) - target_tas_mps(dynamics, altitude - 50, 0.0)) / 100
        state = Motion(tas, altitude, altitude)
        force = (dynamics.idle_n(state) - dynamics.drag_n(state)) / p.mass_kg
        sine = force / (G0_MPS2 + tas * (slope + p.wind_slope_per_s))
        angles.append(torch.asin(sine))
        rates.append(tas * sine)
    return torch.stack(angles).amax(0), torch.stack(rates).amax(0)


def _path(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.8 * size, "of_idle": generator.uniform(0.85, 0.95)}


def _hold_path(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    p = fleet.parameters
    angle, _ = _idle_path(fleet, p.top_m - 2000 * FT_M, p.bottom_m)
    # Real ones are planned in steps of about a tenth of a degree; the shallower step leaves thrust to hold the speed.
    held = torch.deg2rad(torch.ceil(torch.rad2deg(angle * values["of_idle"]) * 10) / 10)
    chosen = fleet.chosen(values["share"])
    return fleet.with_injected(
        hold_high_m=torch.where(chosen, p.top_m, torch.nan),
        hold_low_m=p.bottom_m,
        hold_angle=torch.where(chosen, held, torch.nan),
    )


def _rate(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.8 * size, "of_idle": generator.uniform(0.8, 0.95), "depth_fl": generator.uniform(70, 110)}


def _hold_rate(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    p = fleet.parameters
    room = (p.top_m - p.bottom_m - (values["depth_fl"] + 50) * FL_M).clamp(min=0.0)
    low = p.bottom_m + 20 * FL_M + room * fleet.uniform[:, 0]
    high = torch.minimum(low + values["depth_fl"] * FL_M, p.top_m - 20 * FL_M)
    _, rate = _idle_path(fleet, high, low)
    hundred = 100 * FPM_MPS
    held = torch.ceil(rate * values["of_idle"] / hundred) * hundred
    chosen = fleet.chosen(values["share"])
    return fleet.with_injected(
        hold_high_m=torch.where(chosen, high, torch.nan),
        hold_low_m=low,
        hold_rate_mps=torch.where(chosen, held, torch.nan),
    )


def _levels(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.6 * size, "duration_s": generator.uniform(60, 150)}


def _level_off(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    p = fleet.parameters
    # Like the world's own: on whole thousands of feet, well inside the descent, and only where there is room for it.
    high, low = p.top_m - 3000 * FT_M, p.bottom_m + 2000 * FT_M
    level = ((low + (high - low) * fleet.uniform[:, 0]) / (1000 * FT_M)).round() * (1000 * FT_M)
    chosen = fleet.chosen(values["share"]) & p.level_off_m.isnan() & (p.top_m - p.bottom_m > 6000 * FT_M)
    duration = torch.full_like(p.level_off_s, values["duration_s"])
    return fleet.with_parameters(
        level_off_m=torch.where(chosen, level, p.level_off_m),
        level_off_s=torch.where(chosen, duration, p.level_off_s),
    )


def _speeds(generator: np.random.Generator, size: float) -> dict[str, float]:
    side = sign(generator)
    return {"cas_kt": 20.0 * size * side, "mach": 0.02 * size * side}


def _plan(fleet: Fleet, values: Mapping[str, float]) -> FlightParameters:
    p = fleet.parameters
    return fleet.with_parameters(cas_mps=p.cas_mps + values["cas_kt"] * KT_MPS, mach=p.mach + values["mach"])


GEOMETRIC_PATH = Cause("geometric_path", {"share": "1", "of_idle": "1"}, _path, _hold_path)
"""Four flights in five at full size hold a geometric path angle shallower than idle, all the way down."""
VERTICAL_SPEED_MODE = Cause("vertical_speed_mode", {"share": "1", "of_idle": "1", "depth_fl": "FL"}, _rate, _hold_rate)
"""Four flights in five at full size hold a rate of whole hundreds of ft/min over 7,000 to 11,000 ft."""
LEVEL_OFF = Cause("level_off", {"share": "1", "duration_s": "s"}, _levels, _level_off)
"""Three flights in five of those without one are given a level-off, at full size."""
SPEED_SCHEDULE = Cause("speed_schedule", {"cas_kt": "kt", "mach": "1"}, _speeds, _plan)
"""20 kt and M 0.02 slower or faster at full size."""
