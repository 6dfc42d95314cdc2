"""Steps in which aircraft report: the least significant bits of Mode S."""

STEPS = {
    "altitude": 25.0,
    "geoaltitude": 25.0,
    "IAS": 1.0,
    "Mach": 0.004,
    "vertical_rate": 32.0,
    "TAS": 2.0,
    "groundspeed": 2.0,
    "track": 90 / 512,
    "heading": 90 / 512,
}
"""Field -> its least significant bit, in the field's unit (registers 4,0 to 6,0, and ADS-B: ICAO Doc 9871)."""
UNCERTAINTY = {name: step / 12**0.5 for name, step in STEPS.items()}
"""Standard uncertainty of one report of a field by its rounding, in the field's unit."""
