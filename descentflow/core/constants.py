"""Constants of the International Standard Atmosphere as BADA 3 prints them (user manual, section 3.1).

The only copy: equations in torch (:mod:`descentflow.physics`), in numpy (:mod:`descentflow.surveillance`) and of the
simulated world use these.

Example:
    >>> round((KAPPA * R_AIR * T0_K) ** 0.5, 3) == A0_MPS
    True
"""

G0_MPS2 = 9.80665
"""Standard gravity, m/s2."""
R_AIR = 287.05287
"""Gas constant of air, J / (kg K)."""
KAPPA = 1.4
"""Adiabatic index of air."""
T0_K = 288.15
"""Temperature at sea level."""
P0_PA = 101325.0
"""Pressure at sea level."""
RHO0_KG_M3 = 1.225
"""Density at sea level."""
A0_MPS = 340.294
"""Speed of sound at sea level."""
LAPSE_K_M = -0.0065
"""Temperature gradient below the tropopause, K/m."""
TROPOPAUSE_M = 11000.0
"""Pressure altitude of the tropopause; exactly 11,000 m counts as below it."""
T_TROPOPAUSE_PRINTED_K = 216.65
"""Temperature above the tropopause as printed. :mod:`descentflow.physics.atmosphere` computes it from the gradient, so
that temperature and pressure are continuous there: one unit in the last place smaller."""
