"""The schema of rows, with the names of the `traffic` library, and the physically possible values."""

from collections.abc import Mapping
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.files import table_beside

TIMESTAMP = pl.Datetime("us", "UTC")

KINDS: dict[str, pl.DataType] = {"UTC": TIMESTAMP, "text": pl.String()}
_TABLE = table_beside(__file__)
COLUMNS = {name: KINDS.get(unit, pl.Float64()) for name, unit in _TABLE["columns"].items()}
"""Every column of a row and its type."""
UNITS: dict[str, str] = {name: unit for name, unit in _TABLE["columns"].items() if unit not in KINDS}
"""Unit of every column of numbers."""

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

POSSIBLE: dict[str, tuple[float, float]] = {name: tuple(ends) for name, ends in _TABLE["possible"].items()}
"""Possible reports of an airliner or business aircraft: register ranges of ICAO Doc 9684, narrowed to flight."""

FILLS = (9999.0, -9999.0)
"""Numbers that stand for none: rates of no register, whose steps are 32 and 64, and altitudes of no encoder."""

MIN_CHECKED_VALUES = 20
"""Values of a column below which nothing of them is checked."""

ALIASES, TRADE = (
    {other: name for name, others in _TABLE[kind].items() for other in others} for kind in ("aliases", "trade")
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
