"""A table of any source in the schema of rows: names, types and units."""

from collections.abc import Sequence
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.surveillance.rows._addresses import six_digits
from descentflow.surveillance.rows._column_names import (
    LEVELS,
    STATE_VECTOR,
    check_read,
    row_names,
    with_altitude,
    without_columns,
)
from descentflow.surveillance.rows._times import timestamps, where_fits
from descentflow.surveillance.rows.air_data import computable
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import (
    AIRSPEEDS,
    COLUMNS,
    FILLS,
    GROUND_VECTOR,
    REQUIRED,
    TIMESTAMP,
    check_types,
)

MAX_TEXT_BYTES = 500
"""Bytes of the longest text that is read; a small file can repeat one of megabytes in every row, which takes no memory
before it is processed."""
RATE_COLUMNS = ("vertical_rate", "geometric_rate")
"""Columns in which a number that stands for none would be a possible one."""
READABLE_VALUES = {
    pl.Float64: "numbers",
    pl.Datetime: "dates with time, or seconds since 1970",
    pl.String: f"texts of at most {MAX_TEXT_BYTES} bytes",
}
MAX_MESSAGE_AGE_S = 2.0
"""Age of the last message above which a state vector is dropped: OpenSky repeats the last one for minutes, and a
groundspeed of 2 s ago is that of 1 kt more."""


def normalise(table: pl.DataFrame, path: Path | str, report: DropReport, derived: bool = False) -> pl.DataFrame:
    """Rename, convert and cast the columns of a table; `derived` if it may have a ground vector for airspeeds."""
    theirs = table.columns
    table = _from_state_vectors(table, report) if STATE_VECTOR in table.columns else table
    table = with_altitude(_renamed(table, path, report), path, report)
    if derived and "icao24" not in table.columns and "flight_id" in table.columns:
        table = table.with_columns(icao24=pl.col("flight_id").cast(pl.String))
        report.note("addresses made of flight_id, for there is no icao24", len(table))
    missing = [n for n in REQUIRED if n not in {*table.columns, *computable(table.columns)}]
    if derived and set(AIRSPEEDS) & set(missing):
        missing = [n for n in (*REQUIRED, *GROUND_VECTOR) if n not in (*table.columns, *AIRSPEEDS)]
    if missing:
        raise without_columns(path, missing, theirs, table.columns)
    columns = []
    for name, kind in COLUMNS.items():
        if name not in table.columns:
            continue
        column = _cast(table[name], kind, path)
        if name == "icao24":
            given = table[name]
            column = six_digits(given if given.dtype.is_numeric() else column, path, report)
        lost = column.null_count() - table[name].null_count()
        if lost:
            report.note(f"values of {name} that could not be read", lost)
        if name in RATE_COLUMNS and (filled := column.is_in(FILLS).fill_null(False)).any():
            report.note(f"values 9999 of {name} taken for missing", int(filled.sum()))
            column = where_fits(column, ~filled)
        if name in REQUIRED:
            check_read(column, table[name], path, READABLE_VALUES[type(kind)])
        columns.append(column.alias(name))
    frame = pl.DataFrame(columns)
    # A missing number may be written as NaN or infinity.
    numbers = [n for n in frame.columns if frame[n].dtype == pl.Float64]
    return frame.with_columns(pl.when(pl.col(n).is_finite()).then(pl.col(n)) for n in numbers)


def is_list_of_types(columns: Sequence[str]) -> bool:
    """Test for the columns of a table that lists the types of aircraft and has no rows."""
    named = set(row_names(columns).values())
    rows = {*REQUIRED, STATE_VECTOR, LEVELS, "geoaltitude", "groundspeed"} - {"icao24"}
    return {"icao24", "typecode"} <= named and not named & rows


def _renamed(table: pl.DataFrame, path: Path | str, report: DropReport) -> pl.DataFrame:
    renames: dict[str, str] = {}
    for name, target in row_names(table.columns).items():
        if target == name:
            continue
        if target in table.columns:
            report.note(f"values of column {name} not used next to {target}", table[name].count())
        else:
            if target in renames.values():
                raise DataError(
                    f"{path}: two columns for {target}", expected="one", mend=f"drop all but one: {table.columns}"
                )
            renames[name] = target
    return table.rename(renames)


def _from_state_vectors(table: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """State vectors of OpenSky: metres, metres per second, and `heading` for a track."""
    numbers = {"baroaltitude", "geoaltitude", "velocity", "vertrate", "lastcontact"} & set(table.columns)
    table = table.with_columns(pl.col(name).cast(pl.Float64, strict=False) for name in numbers)
    converted = {new: pl.col(old) / size for new, (old, size) in STATE_VECTOR_COLUMNS.items() if old in table.columns}
    track = {"heading": "track"} if "heading" in table.columns and "track" not in table.columns else {}
    if all(name in table.columns and not table[name].dtype.is_temporal() for name in ("time", "lastcontact")):
        age = pl.col("time").cast(pl.Float64, strict=False) - pl.col("lastcontact")
        fresh = table.filter((age <= MAX_MESSAGE_AGE_S).fill_null(True))
        report.note("state vectors without a message for 2 s, left out", len(table) - len(fresh))
        table = fresh
    used = {old for old, _ in STATE_VECTOR_COLUMNS.values()} - set(converted)
    return table.with_columns(**converted).drop(used, strict=False).rename(track)


STATE_VECTOR_COLUMNS = {
    "altitude": ("baroaltitude", FT_M),
    "geoaltitude": ("geoaltitude", FT_M),
    "groundspeed": ("velocity", KT_MPS),
    "vertical_rate": ("vertrate", FPM_MPS),
}
"""Row column -> column of a state vector, and the row's unit in the unit of that column."""


def _cast(column: pl.Series, kind: pl.DataType, path: Path | str) -> pl.Series:
    check_types({column.name: column.dtype}, path, "numbers" if kind == pl.Float64 else "dates with time, or text")
    if column.dtype in (pl.Categorical, pl.Enum):
        column = where_fits(column, column.cat.len_bytes() <= MAX_TEXT_BYTES).cast(pl.String)
    if column.dtype == pl.String:
        column = where_fits(column, column.str.len_bytes() <= MAX_TEXT_BYTES)
    if kind == TIMESTAMP:
        return timestamps(column)
    if kind == pl.String:
        return column.cast(pl.String).str.strip_chars().replace("", None)
    if column.dtype == pl.String:
        column = column.str.strip_chars().replace("", None)
    return column.cast(pl.Float64, strict=False)


def wanted(names: Sequence[str], named: Sequence[str] = ()) -> list[str]:
    """Columns of a table that may be used; all of them if a required one is missing, so that they can be named."""
    targets = row_names(names)
    named = [*named, *(name.rpartition("*")[0] for name in named if "*" in name)]
    vectors = (
        {*(old for old, _ in STATE_VECTOR_COLUMNS.values()), "heading", "lastcontact"}
        if STATE_VECTOR in names
        else set()
    )
    known = {*COLUMNS, *(() if "altitude" in targets.values() else (LEVELS,))}
    useful = [name for name in names if targets[name] in known or name in vectors or name in named]
    given = {targets[name] for name in useful}
    given |= {"altitude"} if vectors or LEVELS in given else set()
    if set(AIRSPEEDS) <= set(named):  # not asked of rows whose airspeeds are derived
        given |= {*AIRSPEEDS, *(("icao24",) if "flight_id" in given else ())}
    return useful if given >= set(REQUIRED) - computable(given) else list(names)
