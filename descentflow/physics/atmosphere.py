"""International Standard Atmosphere with a temperature deviation (BADA 3 user manual, section 3.1).

Altitudes are geopotential *pressure* altitudes. The temperature deviation (``deviation_k``) changes temperature,
density and speed of sound, never the pressure at a pressure altitude. Exactly 11,000 m counts as below the
tropopause.

Constants: density follows from the gas law with the printed p0, T0 and R, so at sea level it is 1.2250000181, not the
printed 1.225 (relative 1.5e-8); the pressure at the tropopause is computed (22,632.0401 Pa), not the manual's rounded
22,632.04, so that pressure is continuous and :func:`pressure_altitude_m` is its exact inverse.
"""

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2, KAPPA, LAPSE_K_M, P0_PA, R_AIR, T0_K, TROPOPAUSE_M
from descentflow.core.tensors import Number, as_tensors

T_TROPOPAUSE_K = T0_K + LAPSE_K_M * TROPOPAUSE_M
"""ISA temperature at and above the tropopause, 216.65 K."""
PRESSURE_EXPONENT = -G0_MPS2 / (LAPSE_K_M * R_AIR)
"""5.2559: exponent of the temperature ratio in the pressure below the tropopause."""
SCALE_HEIGHT_M = R_AIR * T_TROPOPAUSE_K / G0_MPS2
"""Height over which pressure falls by a factor e above the tropopause."""
DELTA_TROPOPAUSE = (T_TROPOPAUSE_K / T0_K) ** PRESSURE_EXPONENT
"""Pressure ratio at the tropopause."""


def below_tropopause(altitude_m: Tensor) -> Tensor:
    """Return True at 11,000 m of pressure altitude and below (manual 3.1.2, 3.1-13).

    Example:
        >>> below_tropopause(torch.tensor([11000.0, 11000.1])).tolist()
        [True, False]
    """
    return altitude_m <= TROPOPAUSE_M


def isa_temperature_k(altitude_m: Number) -> Tensor:
    """ISA temperature without deviation: T0 + beta Hp, constant above the tropopause (manual 3.1-13, 3.1-16).

    Args:
        altitude_m: Pressure altitude, any shape.

    Returns:
        Temperature in kelvin, same shape.

    Example:
        >>> round(isa_temperature_k(12000.0).item(), 2)
        216.65
    """
    (altitude,) = as_tensors(altitude_m)
    below = T0_K + LAPSE_K_M * altitude
    # Not clamp: what its gradient is at exactly 11,000 m depends on the version of torch.
    return torch.where(below < T_TROPOPAUSE_K, T_TROPOPAUSE_K, below)


def temperature_k(altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """Air temperature: ISA plus the deviation (manual 3.1-13 to 3.1-16).

    Args:
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA; broadcasts against the altitude.

    Returns:
        Temperature in kelvin, broadcast shape.

    Example:
        >>> temperature_k(0.0, 10.0).item()
        298.15
    """
    altitude, deviation = as_tensors(altitude_m, deviation_k)
    return isa_temperature_k(altitude) + deviation


def isa_fraction(altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """``(T - dT) / T``: metres of pressure altitude in one geometric metre (manual 3.1.1 and 3.2-7).

    Example:
        >>> isa_fraction(0.0, 0.0).item()
        1.0
    """
    altitude, deviation = as_tensors(altitude_m, deviation_k)
    isa = isa_temperature_k(altitude)
    return isa / (isa + deviation)


def pressure_pa(altitude_m: Number) -> Tensor:
    """Air pressure, a function of pressure altitude alone (manual 3.1-18, 3.1-20).

    Args:
        altitude_m: Pressure altitude, any shape.

    Returns:
        Pressure in pascals, same shape.

    Example:
        >>> pressure_pa(0.0).item()
        101325.0
    """
    (altitude,) = as_tensors(altitude_m)
    ratio = (isa_temperature_k(altitude) / T0_K) ** PRESSURE_EXPONENT
    # relu and not clamp: its gradient at exactly 11,000 m is zero, so the gradient there is the lower side's alone.
    return P0_PA * ratio * torch.exp(torch.relu(altitude - TROPOPAUSE_M) / -SCALE_HEIGHT_M)


def pressure_altitude_m(pressure: Number) -> Tensor:
    """Pressure altitude at a pressure, the exact inverse of :func:`pressure_pa` (manual 3.1.2, as in 3.1-27).

    Args:
        pressure: Pressure in pascals, positive, any shape.

    Returns:
        Pressure altitude in metres, same shape.

    Example:
        >>> round(pressure_altitude_m(pressure_pa(9144.0)).item(), 6)
        9144.0
    """
    (pressure_tensor,) = as_tensors(pressure)
    delta = pressure_tensor / P0_PA
    low = T0_K / LAPSE_K_M * (delta ** (1 / PRESSURE_EXPONENT) - 1)
    high = TROPOPAUSE_M - SCALE_HEIGHT_M * torch.log(delta / DELTA_TROPOPAUSE)
    return torch.where(delta >= DELTA_TROPOPAUSE, low, high)


def density_kg_m3(altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """Air density by the perfect gas law, p / (R T) (manual 3.1-21).

    Args:
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Density in kg/m3, broadcast shape.

    Example:
        >>> round(density_kg_m3(0.0).item(), 6)
        1.225
    """
    return pressure_pa(altitude_m) / (R_AIR * temperature_k(altitude_m, deviation_k))


def speed_of_sound_mps(altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """Speed of sound, sqrt(kappa R T) (manual 3.1-22).

    Args:
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Speed in m/s, broadcast shape.

    Example:
        >>> round(speed_of_sound_mps(0.0).item(), 3)
        340.294
    """
    return torch.sqrt(KAPPA * R_AIR * temperature_k(altitude_m, deviation_k))


def geometric_altitude_m(altitude_m: Number, deviation_k: Number = 0.0) -> Tensor:
    """Altitude above the level where pressure is p0, from ``dh = T / (T - dT) dHp`` integrated (manual 3.1.1).

    ``h = Hp + dT / beta ln(T_isa / T0)``; above the tropopause ``dT / T_11 (Hp - 11,000)`` is added. Gravity is
    constant in BADA, so geopotential and geometric altitude are one (they differ by 23 m at 40,000 ft).

    Args:
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Altitude in metres, broadcast shape.

    Example:
        >>> round(geometric_altitude_m(11000.0, 10.0).item(), 1)
        11438.8
    """
    altitude, deviation = as_tensors(altitude_m, deviation_k)
    below = torch.log(isa_temperature_k(altitude) / T0_K) / LAPSE_K_M
    above = torch.relu(altitude - TROPOPAUSE_M) / T_TROPOPAUSE_K
    return altitude + deviation * (below + above)


SLACK_M = 5e-3
"""Altitudes so near to a threshold are equal to it: ``15 * 30.48`` is below ``1500 * 0.3048`` in floating point.

Above the rounding of float32 altitudes (1 mm at 40,000 ft), far below any height that matters.
"""


def is_below(altitude_m: Tensor, threshold_m: float | Tensor) -> Tensor:
    """Return True strictly below a threshold, by more than rounding: thresholds are whole feet.

    Example:
        >>> is_below(torch.tensor(15 * 30.48, dtype=torch.float64), 1500 * 0.3048).item()
        False
    """
    return altitude_m < threshold_m - SLACK_M


def is_above(altitude_m: Tensor, threshold_m: float | Tensor) -> Tensor:
    """Return True strictly above a threshold, by more than rounding: thresholds are whole feet.

    Example:
        >>> is_above(torch.tensor(3000.0), 3000.0).item()
        False
    """
    return altitude_m > threshold_m + SLACK_M
