"""The schema of rows, with the names of the `traffic` library, and the physically possible values."""

from collections.abc import Mapping
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.files import table_beside

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
    "wind_direction": pl.Float64(),
    "wind_speed": pl.Float64(),
    "u_component_of_wind": pl.Float64(),
    "v_component_of_wind": pl.Float64(),
    "geometric_rate": pl.Float64(),
    "fuel_flow": pl.Float64(),
    "N1": pl.Float64(),
    "thrust": pl.Float64(),
    "selected_altitude": pl.Float64(),
    "cleared_flight_level": pl.Float64(),
    "cleared_speed_kt": pl.Float64(),
    "cleared_mach": pl.Float64(),
    "airspeed_source": pl.String(),
    "derived_IAS": pl.Float64(),
}
"""Every column of a row and its type.

Units: `altitude` (pressure altitude), `geoaltitude` and `selected_altitude` (of the autopilot's panel) in ft,
`vertical_rate` and `geometric_rate` in ft/min, `IAS`, `TAS`, `groundspeed` and `wind_speed` in kt, angles in degrees
(`track` true; `heading` as the source gives it, magnetic from Mode S; `wind_direction` true, from where it blows),
`temperature` in K, `fuel_flow` of all engines in kg/s, `N1` (speed of the fan) in percent, `thrust` of all engines in
N. What a controller has cleared: `cleared_flight_level` in hundreds of feet, `cleared_speed_kt` (IAS) and
`cleared_mach`, missing where nothing is assigned. Of a weather model: `u_component_of_wind` towards east and
`v_component_of_wind` towards north, in m/s. Where airspeeds are derived from groundspeed: `airspeed_source` names each
row's source, and `derived_IAS` (kt) stands beside a reported IAS.
"""

REQUIRED = ("timestamp", "icao24", "altitude", "IAS", "Mach")
"""A row without one of these is dropped; a missing `vertical_rate` is computed from `altitude`."""

AIRSPEEDS = ("IAS", "Mach")
GROUND_VECTOR = ("groundspeed", "track")
"""Columns of which IAS and Mach are derived, with a wind and a temperature."""

ROWS_WITHOUT = "rows without "
"""First words of a note that counts rows in which a required column is empty."""

INSTRUCTIONS = ("selected_altitude", "cleared_flight_level", "cleared_speed_kt", "cleared_mach")
"""Selected or cleared values: they change in steps and are not interpolated."""

CHANNELS = tuple(
    name for name, kind in COLUMNS.items() if kind == pl.Float64 and name not in ("altitude", *INSTRUCTIONS)
)
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
    "wind_speed": (0.0, 300.0),
    "u_component_of_wind": (-150.0, 150.0),
    "v_component_of_wind": (-150.0, 150.0),
    "derived_IAS": (0.0, 700.0),
    "geometric_rate": (-15_000.0, 15_000.0),
    "fuel_flow": (0.0, 20.0),
    "N1": (0.0, 130.0),
    "thrust": (-1e6, 2e6),
    "cleared_flight_level": (0.0, 600.0),
    "cleared_speed_kt": (100.0, 400.0),
    "cleared_mach": (0.3, 1.0),
}
"""Possible reports of an airliner or business aircraft: register ranges of ICAO Doc 9684, narrowed to flight."""

FILLS = (9999.0, -9999.0)
"""Numbers that stand for none: rates of no register, whose steps are 32 and 64, and altitudes of no encoder."""

MIN_CHECKED_VALUES = 20
"""Values of a column below which nothing of them is checked."""

_NAMES = table_beside(__file__)
ALIASES, TRADE = (
    {other: name for name, others in _NAMES[kind].items() for other in others} for kind in ("aliases", "trade")
)
"""Other names of the same quantity in the same unit -> the name in a row, and names of the trade, in small letters:
these count where no column has a surer name."""


def check_types(
    types: Mapping[str, pl.DataType], path: Path | str, expected: str = "numbers, dates with time, or text"
) -> None:
    """Refuse columns whose type cannot have values of a row."""
    for name, kind in types.items():
        if kind.is_nested() or kind in (pl.Binary, pl.Object, pl.Date, pl.Time, pl.Duration):
            raise DataError(
                f"{path}: column {name} of type {kind}", expected=expected, mend=f"convert the column {name}"
            )
