"""Checks of prepared descents: types, possible values, columns that agree, one row for each flight and level."""

from math import inf

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.row_runs import numbered
from descentflow.surveillance.descents.store import MEND
from descentflow.surveillance.rows._times import LAST_TIME_S
from descentflow.surveillance.rows._units_check import check_consistency
from descentflow.surveillance.rows.schema import CHANNELS, POSSIBLE, TIMESTAMP

REQUIRED = ("flight_id", "icao24", "typecode", "level_fl", "timestamp", "time_s", "IAS", "Mach", "vertical_rate")
LEVELS_FL = (0, 600)
TEXT_COLUMNS = ("flight_id", "icao24", "typecode", "callsign")
MAX_COMPARED_LEVELS, MAX_FLIGHT_S = 400_000, 1e7
"""Levels of whole flights whose columns are compared, and time that no flight takes."""
NEVER_MISSING = ("flight_id", "level_fl", "time_s")


def checked_descents(frame: pl.DataFrame, source: object) -> pl.DataFrame:
    """The table with the types that prepared descents have, if every value is one that they can have."""
    absent = [name for name in REQUIRED if name not in frame.columns]
    if absent:
        raise DataError(f"{source}: no column {', '.join(absent)}", expected=f"{', '.join(REQUIRED)}", mend=MEND)
    if frame.is_empty():
        raise DataError(f"{source}: no descent in it", expected="at least one", mend="prepare other rows")
    frame = _typed(frame, source)
    for name in NEVER_MISSING:
        if missing := frame[name].null_count():
            raise _refused(source, name, f"lacks {missing:,} values", "one in every row")
    for name in (*CHANNELS, "time_s"):
        if name in frame.columns:
            _check_values(frame[name], source, *POSSIBLE.get(name, (-inf, inf)))
    _check_values(frame["level_fl"], source, *LEVELS_FL)
    _check_values(frame["timestamp"].dt.epoch("s"), source, 0, LAST_TIME_S)
    _, flight = numbered(frame["flight_id"])
    place = flight.astype(np.int64) * (LEVELS_FL[1] + 1) + frame["level_fl"].to_numpy()
    double = len(place) - pl.Series(place).n_unique()
    if double:
        raise _refused(source, "level_fl", f"has {double:,} levels twice in one flight", "each level of a flight once")
    _check_consistency(frame.filter(flight % (1 + len(frame) // MAX_COMPARED_LEVELS) == 0), source)
    return frame


def _check_consistency(frame: pl.DataFrame, source: object) -> None:
    """Hold columns of descents against each other as those of rows, but for groundspeed.

    Descents to one airport meet one wind: into a jet stream they look as if groundspeed were in another unit.
    """
    micros = pl.when(pl.col("time_s").abs() < MAX_FLIGHT_S).then(pl.col("time_s") * 1e6).cast(pl.Int64)
    rows = frame.drop("groundspeed", strict=False).with_columns(
        altitude=100.0 * pl.col("level_fl"), timestamp=pl.from_epoch(micros, time_unit="us")
    )
    try:
        check_consistency(rows, str(source))
    except DataError as error:
        raise DataError(error.got, expected=error.expected, mend=MEND) from error


def _typed(frame: pl.DataFrame, source: object) -> pl.DataFrame:
    """Columns cast to their types where nothing is lost by it."""
    wanted: pl.DataType
    for name, kind in frame.schema.items():
        if name in TEXT_COLUMNS:
            good, wanted = kind in (pl.String, pl.Categorical, pl.Enum), pl.String()
        elif name in (*CHANNELS, "time_s"):
            good, wanted = kind.is_numeric() or kind == pl.Null, pl.Float64()
        elif name == "level_fl":
            good, wanted = kind.is_integer(), pl.Int32()
        elif name == "timestamp":
            good, wanted = isinstance(kind, pl.Datetime) and kind.time_zone is not None, TIMESTAMP
        else:
            continue
        if not good:
            raise _refused(source, name, f"is of type {kind}", f"{wanted}")
        if kind != wanted:
            try:
                frame = frame.with_columns(pl.col(name).cast(wanted))
            except pl.exceptions.PolarsError:
                raise _refused(source, name, f"of type {kind} does not fit {wanted}", f"{wanted}") from None
    return frame


def _check_values(column: pl.Series, source: object, low: float, high: float) -> None:
    given = column.drop_nulls()
    finite = given.is_finite() if given.dtype.is_float() else given.is_not_null()
    if wrong := (~finite).sum():
        raise _refused(source, column.name, f"holds {wrong:,} values that are not finite", "finite values")
    outside = given.filter(~given.is_between(low, high))
    if len(outside):
        what = f"holds {len(outside):,} values outside {low:g} to {high:g}, the first of them {outside[0]:g}"
        raise _refused(source, column.name, what, "what an aircraft can do")


def _refused(source: object, column: str, what: str, expected: str) -> DataError:
    return DataError(
        f"{source}: column {column} {what}", expected=f"{expected}, as `descentflow prepare` writes", mend=MEND
    )
