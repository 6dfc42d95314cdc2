"""Calibrated airspeed, true airspeed and Mach number (BADA 3 user manual, section 3.1.2, 3.1-23 to 3.1-28).

Every conversion goes through the impact pressure: at Mach M it is ``p ((1 + 0.2 M^2)^3.5 - 1)``, and calibrated
airspeed is the speed that makes the same impact pressure at sea level. The powers are written with expm1 and log1p:
the same numbers in float64, three digits more in float32 at low speed.

Constants: the CAS scale is sqrt(kappa p0 / rho0) with the printed p0 and rho0, as in the manual's CAS equation; only
the crossover altitude uses the printed a0 = 340.294 m/s, as its own equation does. The two differ by 2.8e-8, so the
two branches of a speed schedule meet 0.4 mm from the crossover altitude.
"""

import math

import torch
from torch import Tensor

from descentflow.core.constants import A0_MPS, KAPPA, P0_PA, RHO0_KG_M3
from descentflow.core.tensors import Number, as_tensors, safe_sqrt
from descentflow.physics.atmosphere import pressure_altitude_m, pressure_pa, speed_of_sound_mps

IMPACT_EXPONENT = KAPPA / (KAPPA - 1)
CAS_SCALE_MPS = math.sqrt(KAPPA * P0_PA / RHO0_KG_M3)
"""Speed of sound that belongs to p0 and rho0, the scale of calibrated airspeed."""


def impact_pressure_ratio(mach: Tensor) -> Tensor:
    """Impact over static pressure, ``(1 + (kappa - 1)/2 M^2)^(kappa/(kappa - 1)) - 1`` (manual 3.1-23).

    Example:
        >>> round(impact_pressure_ratio(torch.tensor(0.8)).item(), 4)
        0.5243
    """
    return torch.expm1(IMPACT_EXPONENT * torch.log1p((KAPPA - 1) / 2 * mach * mach))


def mach_of_impact(ratio: Tensor) -> Tensor:
    """Mach number that makes an impact pressure ratio, the inverse of :func:`impact_pressure_ratio` (manual 3.1-23).

    Example:
        >>> round(mach_of_impact(impact_pressure_ratio(torch.tensor(0.8))).item(), 4)
        0.8
    """
    return safe_sqrt(2 / (KAPPA - 1) * torch.expm1(torch.log1p(ratio) / IMPACT_EXPONENT))


def cas_to_mach(cas_mps: Number, altitude_m: Number) -> Tensor:
    """Mach number at a calibrated airspeed; temperature plays no part (manual 3.1-23, 3.1-26).

    Args:
        cas_mps: Calibrated airspeed.
        altitude_m: Pressure altitude; broadcasts.

    Returns:
        Mach number, broadcast shape.

    Example:
        >>> round(cas_to_mach(128.611, 11000.0).item(), 4)
        0.7584
    """
    cas, altitude = as_tensors(cas_mps, altitude_m)
    at_sea_level = impact_pressure_ratio(cas / CAS_SCALE_MPS)
    return mach_of_impact(at_sea_level * P0_PA / pressure_pa(altitude))


def mach_to_cas_mps(mach: Number, altitude_m: Number) -> Tensor:
    """Calibrated airspeed at a Mach number, the inverse of :func:`cas_to_mach` (manual 3.1-24, 3.1-26).

    Args:
        mach: Mach number.
        altitude_m: Pressure altitude; broadcasts.

    Returns:
        Calibrated airspeed in m/s, broadcast shape.

    Example:
        >>> round(mach_to_cas_mps(0.78, 0.0).item(), 2)
        265.43
    """
    number, altitude = as_tensors(mach, altitude_m)
    return CAS_SCALE_MPS * mach_of_impact(impact_pressure_ratio(number) * pressure_pa(altitude) / P0_PA)


def mach_to_tas_mps(mach: Number, altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """True airspeed at a Mach number, ``M sqrt(kappa R T)`` (manual 3.1-26).

    Args:
        mach: Mach number.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        True airspeed in m/s, broadcast shape.

    Example:
        >>> round(mach_to_tas_mps(0.78, 11000.0).item(), 2)
        230.15
    """
    number, altitude, deviation = as_tensors(mach, altitude_m, deviation_k)
    return number * speed_of_sound_mps(altitude, deviation)


def tas_to_mach(tas_mps: Number, altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """Mach number at a true airspeed (manual 3.1-26).

    Args:
        tas_mps: True airspeed.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Mach number, broadcast shape.

    Example:
        >>> round(tas_to_mach(230.15, 11000.0).item(), 3)
        0.78
    """
    tas, altitude, deviation = as_tensors(tas_mps, altitude_m, deviation_k)
    return tas / speed_of_sound_mps(altitude, deviation)


def cas_to_tas_mps(cas_mps: Number, altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """True airspeed at a calibrated airspeed (manual 3.1-23).

    Args:
        cas_mps: Calibrated airspeed.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        True airspeed in m/s, broadcast shape.

    Example:
        >>> round(cas_to_tas_mps(149.18876, 4572.0).item(), 4)
        184.9217
    """
    cas, altitude, deviation = as_tensors(cas_mps, altitude_m, deviation_k)
    return mach_to_tas_mps(cas_to_mach(cas, altitude), altitude, deviation)


def tas_to_cas_mps(tas_mps: Number, altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """Calibrated airspeed at a true airspeed, the inverse of :func:`cas_to_tas_mps` (manual 3.1-24).

    Args:
        tas_mps: True airspeed.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Calibrated airspeed in m/s, broadcast shape.

    Example:
        >>> round(tas_to_cas_mps(184.92167745786855, 4572.0).item(), 4)
        149.1888
    """
    tas, altitude, deviation = as_tensors(tas_mps, altitude_m, deviation_k)
    return mach_to_cas_mps(tas_to_mach(tas, altitude, deviation), altitude)


def crossover_altitude_m(cas_mps: Number, mach: Number) -> Tensor:
    """Pressure altitude where a calibrated airspeed and a Mach number are one true airspeed (manual 3.1-27, 3.1-28).

    Args:
        cas_mps: Calibrated airspeed.
        mach: Mach number, positive; broadcasts.

    Returns:
        Pressure altitude in metres (negative where the Mach number is below the CAS at sea level), broadcast shape.

    Example:
        >>> round(crossover_altitude_m(149.18876, 0.74).item(), 3)
        8604.181
    """
    cas, number = as_tensors(cas_mps, mach)
    delta = impact_pressure_ratio(cas / A0_MPS) / impact_pressure_ratio(number)
    return pressure_altitude_m(P0_PA * delta)
