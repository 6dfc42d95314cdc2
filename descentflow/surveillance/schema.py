"""The schema of rows, named as the `traffic` library names things, and what counts as physically possible."""

import polars as pl

TIMESTAMP = pl.Datetime("us", "UTC")

COLUMNS: dict[str, pl.DataType] = {
    "timestamp": TIMESTAMP,
    "icao24": pl.String(),
    "callsign": pl.String(),
    "flight_id": pl.String(),
    "typecode": pl.String(),
    "altitude": pl.Float64(),
    "vertical_rate": pl.Float64(),
    "IAS": pl.Float64(),
    "Mach": pl.Float64(),
    "TAS": pl.Float64(),
    "groundspeed": pl.Float64(),
    "track": pl.Float64(),
    "heading": pl.Float64(),
    "roll": pl.Float64(),
    "geoaltitude": pl.Float64(),
    "latitude": pl.Float64(),
    "longitude": pl.Float64(),
    "temperature": pl.Float64(),
}
"""Every column of a row and its type.

Units: `altitude` (pressure altitude) and `geoaltitude` in ft, `vertical_rate` in ft/min, `IAS`, `TAS` and
`groundspeed` in kt, angles in degrees (`track` true; `heading` as the source gives it, magnetic from Mode S),
`temperature` in K.
"""

REQUIRED = ("timestamp", "icao24", "altitude", "IAS", "Mach")
"""A row without one of these says nothing about a descent; `vertical_rate` can be differenced from `altitude`."""

CHANNELS = tuple(name for name, kind in COLUMNS.items() if kind == pl.Float64 and name != "altitude")
"""Numbers that are interpolated to flight levels."""

POSSIBLE = {
    "altitude": (-1500.0, 60_000.0),
    "IAS": (40.0, 500.0),
    "Mach": (0.05, 1.0),
    "vertical_rate": (-15_000.0, 15_000.0),
    "TAS": (40.0, 700.0),
    "groundspeed": (0.0, 900.0),
    "roll": (-90.0, 90.0),
    "temperature": (150.0, 340.0),
}
"""What an airliner or business aircraft can report: ICAO Doc 9684's register ranges, narrowed to flight."""

ALIASES = {
    "time": "timestamp",
    "ts": "timestamp",
    "ias": "IAS",
    "indicated_airspeed": "IAS",
    "mach": "Mach",
    "tas": "TAS",
    "true_airspeed": "TAS",
    "gs": "groundspeed",
    "lat": "latitude",
    "lon": "longitude",
    "baro_rate": "vertical_rate",
    "alt_baro": "altitude",
    "alt_geom": "geoaltitude",
    "hex": "icao24",
    "aircraft_type": "typecode",
    "mag_heading": "heading",
}
"""Other names under which sources carry the same quantity in the same unit."""
