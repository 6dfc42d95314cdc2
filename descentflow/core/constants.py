"""Constants of the International Standard Atmosphere as BADA 3 prints them (user manual, section 3.1)."""

G0_MPS2 = 9.80665
R_AIR = 287.05287
"""Gas constant of air, J / (kg K)."""
KAPPA = 1.4
"""Adiabatic index of air."""
T0_K = 288.15
P0_PA = 101325.0
RHO0_KG_M3 = 1.225
A0_MPS = 340.294
LAPSE_K_M = -0.0065
"""Temperature gradient below the tropopause."""
TROPOPAUSE_M = 11000.0
"""Pressure altitude of the tropopause; exactly 11,000 m counts as below it."""
