"""Minimum speed and maximum altitude (BADA 3 user manual, sections 3.5 and 3.6.2)."""

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.bada3.global_parameters import STANDARD, GlobalParameters
from descentflow.core.constants import G0_MPS2, KAPPA
from descentflow.core.tensors import Number, as_tensors, safe_sqrt
from descentflow.core.units import FT_M
from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.physics.altitude_limits import is_below
from descentflow.physics.atmosphere import pressure_pa
from descentflow.physics.configuration import Configuration, stall_cas_mps

BUFFET_FLOOR_M = 15000 * FT_M
"""The low-speed buffet limits jets and turboprops from this altitude up."""
BUFFET_LOAD_FACTOR = 1.2
"""The manual's 0.2 g margin: 0.583 in its buffet equation is kappa / 2 / 1.2."""


def minimum_cas_mps(
    aircraft: Aircraft,
    altitude_m: Number,
    mass_kg: Number | None = None,
    configuration: Configuration = "CR",
    limits: GlobalParameters = STANDARD,
) -> Tensor:
    """Minimum speed in flight: 1.3 stall speeds, and the buffet limit from 15,000 ft up (manual 3.5-3 and 3.6.2).

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.
        mass_kg: Mass; the reference mass when None.
        configuration: Configuration whose stall speed counts.
        limits: Global parameters (the minimum speed factor is used).

    Returns:
        Calibrated airspeed in m/s, broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(minimum_cas_mps(open_aircraft("A320"), 3000.0) > 50)
        True
    """
    (altitude,) = as_tensors(altitude_m)
    stall = limits.min_speed_factor * stall_cas_mps(aircraft, mass_kg, configuration)
    if aircraft.engine == "piston":
        return stall + 0.0 * altitude
    buffet = buffet_mach(aircraft, altitude, mass_kg)
    known = ~is_below(altitude, BUFFET_FLOOR_M) & (buffet > 0)
    return torch.where(known, torch.maximum(stall, mach_to_cas_mps(buffet, altitude)), stall)


def buffet_mach(aircraft: Aircraft, altitude_m: Number, mass_kg: Number | None = None) -> Tensor:
    """Low-speed buffet limit: smallest positive root of ``k M^3 - Clbo M^2 + (m g0/S) / (0.583 p) = 0`` (manual 3.6-6).

    The roots are those of the manual's appendix B, in closed trigonometric form.

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.
        mass_kg: Mass; the reference mass when None.

    Returns:
        Mach number, broadcast shape; 0 where the type gives no buffet coefficients or the equation no positive root.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(buffet_mach(open_aircraft("A320"), 11000.0) < 0.8)
        True
    """
    altitude, clbo, k = as_tensors(altitude_m, aircraft.buffet_clbo, aircraft.buffet_k)
    mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg
    load = mass * G0_MPS2 / aircraft.wing_area_m2 / (KAPPA / 2 / BUFFET_LOAD_FACTOR) / pressure_pa(altitude)
    flat = safe_sqrt(load / torch.where(clbo > 0, clbo, torch.inf))
    curved = k > 0
    safe_k = torch.where(curved, k, 1.0)
    third = clbo / safe_k / 3
    cosine = 1 - load / safe_k / 2 / torch.where(curved & (clbo > 0), third, 1.0) ** 3
    has_root = curved & (clbo > 0) & (cosine > -1) & (cosine < 1)
    angle = torch.acos(torch.where(has_root, cosine, 0.0))
    root = third * (1 - 2 * torch.cos((angle + torch.pi) / 3))
    return torch.where(curved, torch.where(has_root, root, 0.0), flat)


def maximum_altitude_m(aircraft: Aircraft, mass_kg: Number | None = None, deviation_k: Number = 0.0) -> Tensor:
    """Maximum altitude for a mass and a temperature (manual 3.5-1).

    ``min(h_MO, h_max + Gt max(dT - CT4, 0) + Gw (m_max - m))`` with Gw at least 0 and Gt at most 0; h_MO where h_max
    is not given (0).

    Args:
        aircraft: Coefficients of the type.
        mass_kg: Mass; the reference mass when None.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Pressure altitude in metres, broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(maximum_altitude_m(open_aircraft("A320")) > 10000)
        True
    """
    mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg
    ceiling, at_mtow, heaviest, deviation, gw, gt, ct4 = as_tensors(
        aircraft.altitude_maximum_ft,
        aircraft.altitude_mtow_ft,
        aircraft.mass_maximum_kg,
        deviation_k,
        aircraft.altitude_mass_gradient_ft_kg,
        aircraft.altitude_temperature_gradient_ft_k,
        aircraft.ct4,
    )
    heat = gt.clamp(max=0.0) * (deviation - ct4).clamp(min=0.0)
    able = at_mtow + heat + gw.clamp(min=0.0) * (heaviest - mass)
    return torch.where(at_mtow == 0, ceiling + 0.0 * able, torch.minimum(ceiling, able)) * FT_M
