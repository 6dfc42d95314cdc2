"""CAS of a Mach number at a pressure altitude, for checks of rows; in numpy, because surveillance never imports torch.

The same ISA and impact-pressure relations as :mod:`descentflow.physics`, to which a test holds it.
"""

import numpy as np
from numpy.typing import NDArray

from descentflow.core.constants import (
    G0_MPS2,
    KAPPA,
    LAPSE_K_M,
    P0_PA,
    R_AIR,
    RHO0_KG_M3,
    T0_K,
    T_TROPOPAUSE_PRINTED_K,
    TROPOPAUSE_M,
)
from descentflow.core.units import FT_M, KT_MPS

Array = NDArray[np.float64]


def pressure_ratio(altitude_ft: Array) -> Array:
    """Pressure over sea-level pressure (BADA 3 user manual, section 3.1).

    Args:
        altitude_ft: (...) pressure altitude.

    Example:
        >>> np.round(pressure_ratio(np.array([0.0, 36_089.0])), 3)
        array([1.   , 0.223])
    """
    altitude_m = altitude_ft * FT_M
    low = (1 + LAPSE_K_M * np.minimum(altitude_m, TROPOPAUSE_M) / T0_K) ** (-G0_MPS2 / (LAPSE_K_M * R_AIR))
    above_m = np.maximum(altitude_m - TROPOPAUSE_M, 0.0)
    return np.asarray(low * np.exp(-G0_MPS2 / (R_AIR * T_TROPOPAUSE_PRINTED_K) * above_m))


def isa_tas_of_mach_kt(mach: Array, altitude_ft: Array) -> Array:
    """True airspeed in the standard atmosphere, kt.

    Example:
        >>> round(float(isa_tas_of_mach_kt(np.array([0.78]), np.array([35000.0]))[0]))
        450
    """
    temperature_k = T0_K + LAPSE_K_M * np.minimum(altitude_ft * FT_M, TROPOPAUSE_M)
    return np.asarray(mach * np.sqrt(KAPPA * R_AIR * temperature_k) / KT_MPS)


def cas_of_mach_kt(mach: Array, altitude_ft: Array) -> Array:
    """Calibrated airspeed in kt.

    Example:
        >>> round(float(cas_of_mach_kt(np.array([0.78]), np.array([35000.0]))[0]))
        264
    """
    impact = pressure_ratio(altitude_ft) * ((1 + 0.2 * mach**2) ** 3.5 - 1)
    scale_mps = np.sqrt(KAPPA * P0_PA / RHO0_KG_M3)
    return np.asarray(scale_mps * np.sqrt(5 * ((1 + impact) ** (1 / 3.5) - 1)) / KT_MPS)


def mach_of_cas(cas_kt: Array, altitude_ft: Array) -> Array:
    """Mach number, the inverse of :func:`cas_of_mach_kt`.

    Example:
        >>> round(float(mach_of_cas(np.array([266.0]), np.array([35000.0]))[0]), 2)
        0.78
    """
    scale_mps = np.sqrt(KAPPA * P0_PA / RHO0_KG_M3)
    impact = ((1 + 0.2 * (cas_kt * KT_MPS / scale_mps) ** 2) ** 3.5 - 1) / pressure_ratio(altitude_ft)
    return np.asarray(np.sqrt(5 * ((1 + impact) ** (1 / 3.5) - 1)))
