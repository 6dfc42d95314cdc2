"""Temperature and pressure of the standard atmosphere in NumPy, for rows and weather fields, which do without torch.

A test holds them to :mod:`descentflow.physics.atmosphere`.
"""

import numpy as np
from numpy.typing import NDArray

from descentflow.core.constants import G0_MPS2, LAPSE_K_M, P0_PA, R_AIR, T0_K, T_TROPOPAUSE_PRINTED_K, TROPOPAUSE_M

Array = NDArray[np.float64]
EXPONENT = -G0_MPS2 / (LAPSE_K_M * R_AIR)
SCALE_M = R_AIR * T_TROPOPAUSE_PRINTED_K / G0_MPS2
"""Height over which pressure falls to 1/e above the tropopause."""


def pressure_ratio(altitude_m: Array) -> Array:
    """Pressure over sea-level pressure (BADA 3 user manual, section 3.1).

    Args:
        altitude_m: (...) pressure altitude.

    Example:
        >>> pressure_ratio(np.array([0.0, 11_000.0])).round(4)
        array([1.    , 0.2234])
    """
    low = (1 + LAPSE_K_M * np.minimum(altitude_m, TROPOPAUSE_M) / T0_K) ** EXPONENT
    return np.asarray(low * np.exp(-np.maximum(altitude_m - TROPOPAUSE_M, 0.0) / SCALE_M))


def standard_altitude_m(pressure_pa: Array) -> Array:
    """Pressure altitude (...) at pressures, the inverse of :func:`pressure_ratio`.

    Example:
        >>> standard_altitude_m(101_325.0 * pressure_ratio(np.array([9_000.0, 12_000.0]))).round(6)
        array([ 9000., 12000.])
    """
    ratio, tropopause = pressure_pa / P0_PA, pressure_ratio(np.array(TROPOPAUSE_M))
    low = T0_K / LAPSE_K_M * (np.maximum(ratio, tropopause) ** (1 / EXPONENT) - 1)
    return np.asarray(low - SCALE_M * np.log(np.minimum(ratio / tropopause, 1.0)))


def standard_k(altitude_m: Array) -> Array:
    """Temperature of the standard atmosphere, K.

    Example:
        >>> standard_k(np.array([0.0, 12_000.0])).round(2)
        array([288.15, 216.65])
    """
    return np.asarray(T0_K + LAPSE_K_M * np.minimum(altitude_m, TROPOPAUSE_M))
