"""The one place where field units (kt, ft, ft/min, FL) meet SI.

The knot is BADA's own 0.514444 m/s (BADA 3 user manual, section 2; relative 9e-7 below 1852/3600), so that
speeds read from BADA files come out as in EUROCONTROL's tables.

Example:
    >>> 150 * FL_M
    4572.0
"""

FT_M = 0.3048
"""Metres in a foot."""
FL_M = 100 * FT_M
"""Metres in one flight level (100 ft)."""
KT_MPS = 0.514444
"""Metres a second in a knot."""
FPM_MPS = FT_M / 60
"""Metres a second in a foot a minute."""
NM_M = 1852.0
"""Metres in a nautical mile."""
