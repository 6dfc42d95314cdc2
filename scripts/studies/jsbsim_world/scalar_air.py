"""The standard atmosphere and airspeeds for single numbers, as the autopilot needs them at every step.

The same formulas as :mod:`descentflow.physics.atmosphere` and :mod:`descentflow.physics.airspeed`, which are for
tensors and take a hundred times as long for one number.
"""

import math

from descentflow.core.constants import A0_MPS, G0_MPS2, LAPSE_K_M, P0_PA, R_AIR, T0_K, TROPOPAUSE_M

_TROPOPAUSE_K = T0_K + LAPSE_K_M * TROPOPAUSE_M
_EXPONENT = -R_AIR * LAPSE_K_M / G0_MPS2
_SCALE_M = R_AIR * _TROPOPAUSE_K / G0_MPS2
_TROPOPAUSE_PA = P0_PA * (_TROPOPAUSE_K / T0_K) ** (1 / _EXPONENT)


def pressure_altitude_m(pressure_pa: float) -> float:
    """Pressure altitude at a pressure.

    Example:
        >>> pressure_altitude_m(101_325.0)
        -0.0
    """
    if pressure_pa >= _TROPOPAUSE_PA:
        return float(T0_K / LAPSE_K_M * ((pressure_pa / P0_PA) ** _EXPONENT - 1))
    return TROPOPAUSE_M - _SCALE_M * math.log(pressure_pa / _TROPOPAUSE_PA)


def isa_temperature_k(altitude_m: float) -> float:
    """ISA temperature at a pressure altitude.

    Example:
        >>> round(isa_temperature_k(12_000.0), 2)
        216.65
    """
    return T0_K + LAPSE_K_M * min(altitude_m, TROPOPAUSE_M)


def mach_of_cas(cas_mps: float, pressure_pa: float) -> float:
    """Mach number of a CAS at a pressure.

    Example:
        >>> round(mach_of_cas(150.0, 30_000.0), 2)
        0.77
    """
    impact = P0_PA * ((1 + 0.2 * (cas_mps / A0_MPS) ** 2) ** 3.5 - 1)
    return math.sqrt(5 * ((impact / pressure_pa + 1) ** (2 / 7) - 1))
