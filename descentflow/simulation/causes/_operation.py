"""Descents that are flown otherwise: constant paths and rates, level-offs, other speeds."""

import numpy as np
import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.autopilot import target_tas_mps
from descentflow.simulation.causes.cause import Fleet, Own, only
from descentflow.simulation.motion import Dynamics, Motion
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.plantable import Values

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


def hold_path(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Hold a geometric path angle shallower than idle, all the way down."""
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


def hold_rate(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Hold a rate of whole hundreds of ft/min over some levels."""
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


def level_off(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Level off, in flights without one."""
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


def plan(fleet: Fleet, v: Values) -> tuple[FlightParameters, Own]:
    """Plan other speeds."""
    p, chosen = fleet.parameters, fleet.chosen(v["share"])
    cas = v["cas_kt"] + v["spread_kt"] * fleet.normal[:, 0]
    changed = fleet.with_parameters(
        cas_mps=p.cas_mps + torch.where(chosen, cas * KT_MPS, 0.0), mach=p.mach + torch.where(chosen, v["mach"], 0.0)
    )
    return changed, only(chosen, cas_kt=cas, mach=v["mach"])
