"""CAS of a Mach number at a pressure altitude, for checks on rows: numpy, because this part never imports torch.

The same ISA and impact-pressure relations as :mod:`descentflow.physics`, to which a test holds it.
"""

import numpy as np
from numpy.typing import NDArray

from descentflow.core.units import FT_M, KT_MPS

Array = NDArray[np.float64]


def pressure_ratio(altitude_ft: Array) -> Array:
    """Pressure over sea-level pressure (BADA 3 user manual, section 3.1)."""
    altitude_m = altitude_ft * FT_M
    low = (1 - 0.0065 * np.minimum(altitude_m, 11_000.0) / 288.15) ** (9.80665 / (0.0065 * 287.05287))
    return np.asarray(low * np.exp(-9.80665 / (287.05287 * 216.65) * np.maximum(altitude_m - 11_000.0, 0.0)))


def isa_tas_of_mach_kt(mach: Array, altitude_ft: Array) -> Array:
    """True airspeed in the standard atmosphere, kt.

    Example:
        >>> round(float(isa_tas_of_mach_kt(np.array([0.78]), np.array([35000.0]))[0]))
        450
    """
    temperature_k = 288.15 - 0.0065 * np.minimum(altitude_ft * FT_M, 11_000.0)
    return np.asarray(mach * np.sqrt(1.4 * 287.05287 * temperature_k) / KT_MPS)


def cas_of_mach_kt(mach: Array, altitude_ft: Array) -> Array:
    """Calibrated airspeed in kt.

    Example:
        >>> round(float(cas_of_mach_kt(np.array([0.78]), np.array([35000.0]))[0]))
        266
    """
    impact = pressure_ratio(altitude_ft) * ((1 + 0.2 * mach**2) ** 3.5 - 1)
    scale_mps = np.sqrt(1.4 * 101_325.0 / 1.225)
    return np.asarray(scale_mps * np.sqrt(5 * ((1 + impact) ** (1 / 3.5) - 1)) / KT_MPS)


def mach_of_cas(cas_kt: Array, altitude_ft: Array) -> Array:
    """Mach number, the inverse of :func:`cas_of_mach_kt`.

    Example:
        >>> round(float(mach_of_cas(np.array([266.0]), np.array([35000.0]))[0]), 2)
        0.78
    """
    scale_mps = np.sqrt(1.4 * 101_325.0 / 1.225)
    impact = ((1 + 0.2 * (cas_kt * KT_MPS / scale_mps) ** 2) ** 3.5 - 1) / pressure_ratio(altitude_ft)
    return np.asarray(np.sqrt(5 * ((1 + impact) ** (1 / 3.5) - 1)))
