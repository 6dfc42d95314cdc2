"""Descents that are flown otherwise: constant paths and rates, level-offs, other speeds."""

import numpy as np
import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.autopilot import target_tas_mps
from descentflow.simulation.cause_values import Values
from descentflow.simulation.causes.cause import Cause, Fleet, Own, only, sign
from descentflow.simulation.motion import Dynamics, Motion
from descentflow.simulation.parameters import FlightParameters

_POINTS = 8
"""Heights at which an idle descent is computed before a path or a rate below it is chosen."""


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
        sine = force / (G0_MPS2 + tas * (slope + dynamics.wind_slope_per_s(state)))
        angles.append(torch.asin(sine))
        rates.append(tas * sine)
    return torch.stack(angles).amax(0), torch.stack(rates).amax(0)


def _path(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.8 * size, "of_idle": generator.uniform(0.85, 0.95)}


def _own_paths(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"of_idle": 0.885, "of_idle_range": generator.uniform(0.05, 0.09)}


def _hold_path(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    p = fleet.parameters
    angle, _ = _idle_path(fleet, p.top_m - 2000 * FT_M, p.bottom_m)
    # Real ones are planned in steps of about a tenth of a degree; the shallower step leaves thrust to hold the speed.
    tenths = torch.ceil(torch.rad2deg(angle * fleet.about(v["of_idle"], v["of_idle_range"], 1)) * 10)
    chosen = fleet.chosen(v["share"])
    changed = fleet.with_injected(
        hold_high_m=torch.where(chosen, p.top_m, torch.nan),
        hold_low_m=p.bottom_m,
        hold_angle=torch.where(chosen, torch.deg2rad(tenths / 10), torch.nan),
    )
    return changed, only(chosen, angle_deg=tenths / 10)


def _rate(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.8 * size, "of_idle": generator.uniform(0.8, 0.95), "depth_fl": generator.uniform(70, 110)}


def _own_rates(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"of_idle": 0.86, "of_idle_range": generator.uniform(0.06, 0.1), "depth_range_fl": 30.0}


def _hold_rate(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    p = fleet.parameters
    depth = fleet.about(v["depth_fl"], v["depth_range_fl"], 2) * FL_M
    room = (p.top_m - p.bottom_m - (depth + 50 * FL_M)).clamp(min=0.0)
    low = p.bottom_m + 20 * FL_M + room * fleet.uniform[:, 0]
    high = torch.minimum(low + depth, p.top_m - 20 * FL_M)
    _, rate = _idle_path(fleet, high, low)
    hundred = 100 * FPM_MPS
    held = torch.ceil(rate * fleet.about(v["of_idle"], v["of_idle_range"], 1) / hundred) * hundred
    chosen = fleet.chosen(v["share"])
    changed = fleet.with_injected(
        hold_high_m=torch.where(chosen, high, torch.nan),
        hold_low_m=low,
        hold_rate_mps=torch.where(chosen, held, torch.nan),
    )
    return changed, only(chosen, rate_fpm=held / FPM_MPS, low_fl=low / FL_M, high_fl=high / FL_M)


def _levels(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"share": 0.6 * size, "duration_s": generator.uniform(60, 150)}


def _own_durations(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"duration_range_s": 45.0}


def _level_off(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    p = fleet.parameters
    # Like the world's own: on whole thousands of feet, well inside the descent, and only where there is room for it.
    high, low = p.top_m - 3000 * FT_M, p.bottom_m + 2000 * FT_M
    level = ((low + (high - low) * fleet.uniform[:, 0]) / (1000 * FT_M)).round() * (1000 * FT_M)
    chosen = fleet.chosen(v["share"]) & p.level_off_m.isnan() & (p.top_m - p.bottom_m > 6000 * FT_M)
    duration = fleet.about(v["duration_s"], v["duration_range_s"], 1)
    changed = fleet.with_parameters(
        level_off_m=torch.where(chosen, level, p.level_off_m),
        level_off_s=torch.where(chosen, duration, p.level_off_s),
    )
    return changed, only(chosen, level_fl=level / FL_M, duration_s=duration)


def _speeds(generator: np.random.Generator, size: float) -> dict[str, float]:
    side = sign(generator)
    return {"cas_kt": 20.0 * size * side, "mach": 0.02 * size * side}


def _some_crews(generator: np.random.Generator, size: float) -> dict[str, float]:
    return {"spread_kt": 3.0 * size, "share": generator.uniform(0.6, 0.95)}


def _plan(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    p, chosen = fleet.parameters, fleet.chosen(v["share"])
    cas = v["cas_kt"] + v["spread_kt"] * fleet.normal[:, 0]
    changed = fleet.with_parameters(
        cas_mps=p.cas_mps + torch.where(chosen, cas * KT_MPS, 0.0), mach=p.mach + torch.where(chosen, v["mach"], 0.0)
    )
    return changed, only(chosen, cas_kt=cas, mach=v["mach"])


GEOMETRIC_PATH = Cause("geometric_path", _path, _hold_path, stream=6, vary=_own_paths)
"""Four flights in five at full size hold a geometric path angle shallower than idle, all the way down."""
VERTICAL_SPEED_MODE = Cause("vertical_speed_mode", _rate, _hold_rate, stream=7, vary=_own_rates)
"""Four flights in five at full size hold a rate of whole hundreds of ft/min over 7,000 to 11,000 ft."""
LEVEL_OFF = Cause("level_off", _levels, _level_off, stream=8, vary=_own_durations)
"""Three flights in five of those without one are given a level-off, at full size."""
SPEED_SCHEDULE = Cause("speed_schedule", _speeds, _plan, stream=9, vary=_some_crews)
"""20 kt and M 0.02 slower or faster at full size."""
