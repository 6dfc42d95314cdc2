"""A table of any source in the schema of rows: names, types and units."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.surveillance.rows.addresses import six_digits
from descentflow.surveillance.rows.column_names import LEVELS, row_names, with_altitude
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.missing_columns import STATE_VECTOR, without_columns
from descentflow.surveillance.rows.named_columns import computable
from descentflow.surveillance.rows.relative_times import FIRST_S
from descentflow.surveillance.rows.schema import COLUMNS, FILLS, REQUIRED, TIMESTAMP

LONGEST_TEXT = 500
"""Bytes of the longest text that is read; a small file can repeat one of megabytes in every row, which takes no memory
before it is processed."""
RATES = ("vertical_rate", "geometric_rate")
"""Columns in which a number that stands for none would be a possible one."""
READABLE = {
    pl.Float64: "numbers",
    pl.Datetime: "dates with time, or seconds since 1970",
    pl.String: f"texts of at most {LONGEST_TEXT} bytes",
}
STALE_S = 10.0
"""Age of the last message above which a state vector is dropped: OpenSky repeats the last one for minutes."""

DATE_FORMATS = (
    "%+",
    "%Y-%m-%d %H:%M:%S%.f%:z",
    "%Y-%m-%d %H:%M:%S%.f%#z",
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y-%m-%dT%H:%M",
    "%Y-%m-%d %H:%M",
)
"""Written dates: RFC 3339, `traffic`'s CSV, and the same without a zone (taken as UTC)."""


def normalise(table: pl.DataFrame, path: Path | str, report: DropReport) -> pl.DataFrame:
    """Rename, convert and cast the columns of a table.

    Args:
        table: Columns as the source names them.
        path: Named in errors.
        report: Takes the number of values that are no numbers or dates.

    Returns:
        Columns of :data:`~descentflow.surveillance.rows.schema.COLUMNS` in their types and units; without the airspeed
        that is to be computed (:func:`~descentflow.surveillance.rows.named_columns.computable`).

    Raises:
        DataError: If a required column is missing or occurs twice, or most of its values cannot be read.

    Example:
        >>> row = {"time": 1.7e9, "hex": "4CA001 ", "alt_baro": "30000", "ias": 270, "mach": 0.7}
        >>> table = pl.DataFrame([row])
        >>> normalise(table, "rows.csv", DropReport()).select("icao24", "altitude", "IAS").row(0)
        ('4ca001', 30000.0, 270.0)
    """
    theirs = table.columns
    table = _from_state_vectors(table, report) if STATE_VECTOR in table.columns else table
    table = with_altitude(_renamed(table, path, report), path, report)
    missing = [n for n in REQUIRED if n not in {*table.columns, *computable(table.columns)}]
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
        if name in RATES and (filled := column.is_in(FILLS).fill_null(False)).any():
            report.note(f"values 9999 of {name} taken for missing", int(filled.sum()))
            column = _where(column, ~filled)
        if name in REQUIRED and len(column) and lost > len(column) / 2:
            raise DataError(
                f"{path}: {lost} of {len(column)} values of {name} cannot be read (the first: "
                f"{repr(table[name].filter(column.is_null() & table[name].is_not_null())[0])[:80]})",
                expected=READABLE[type(kind)],
                mend=f"convert the column {name}",
            )
        columns.append(column.alias(name))
    frame = pl.DataFrame(columns)
    # A missing number may be written as NaN or infinity.
    numbers = [n for n in frame.columns if frame[n].dtype == pl.Float64]
    return frame.with_columns(pl.when(pl.col(n).is_finite()).then(pl.col(n)) for n in numbers)


def is_list_of_types(columns: Sequence[str]) -> bool:
    """Test for the columns of a table that lists the types of aircraft and has no rows.

    Example:
        >>> is_list_of_types(["icao24", "registration", "typecode"]), is_list_of_types(["icao24", "typecode", "IAS"])
        (True, False)
    """
    named = set(row_names(columns).values())
    rows = {*REQUIRED, STATE_VECTOR, LEVELS, "geoaltitude", "groundspeed"} - {"icao24"}
    return {"icao24", "typecode"} <= named and not named & rows


def _renamed(table: pl.DataFrame, path: Path | str, report: DropReport) -> pl.DataFrame:
    renames: dict[str, str] = {}
    for name, target in row_names(table.columns).items():
        if target == name:
            continue
        if target in table.columns:
            report.note(f"values of column {name} not used beside {target}", table[name].count())
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
    converted = {new: pl.col(old) / size for new, (old, size) in SI.items() if old in table.columns}
    track = {"heading": "track"} if "heading" in table.columns and "track" not in table.columns else {}
    if all(name in table.columns and not table[name].dtype.is_temporal() for name in ("time", "lastcontact")):
        age = pl.col("time").cast(pl.Float64, strict=False) - pl.col("lastcontact")
        fresh = table.filter((age <= STALE_S).fill_null(True))
        report.note("state vectors without a message for 10 s, left out", len(table) - len(fresh))
        table = fresh
    used = {old for old, _ in SI.values()} - set(converted)
    return table.with_columns(**converted).drop(used, strict=False).rename(track)


SI = {
    "altitude": ("baroaltitude", FT_M),
    "geoaltitude": ("geoaltitude", FT_M),
    "groundspeed": ("velocity", KT_MPS),
    "vertical_rate": ("vertrate", FPM_MPS),
}
"""Row column -> column of a state vector, and the row's unit in the unit of that column."""


LAST_S = 10_000_000_000
"""Seconds since 1970 up to which a number is a time, November 2286."""
PER_SECOND = {"ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
"""Unit of a datetime -> how many are a second."""


def _cast(column: pl.Series, kind: pl.DataType, path: Path | str) -> pl.Series:
    check_types({column.name: column.dtype}, path, "numbers" if kind == pl.Float64 else "dates with time, or text")
    if column.dtype in (pl.Categorical, pl.Enum):
        column = _where(column, column.cat.len_bytes() <= LONGEST_TEXT).cast(pl.String)
    if column.dtype == pl.String:
        column = _where(column, column.str.len_bytes() <= LONGEST_TEXT)
    if kind == TIMESTAMP:
        return timestamps(column)
    if kind == pl.String:
        return column.cast(pl.String).str.strip_chars().replace("", None)
    if column.dtype == pl.String:
        column = column.str.strip_chars().replace("", None)
    return column.cast(pl.Float64, strict=False)


def check_types(
    types: Mapping[str, pl.DataType], path: Path | str, expected: str = "numbers, dates with time, or text"
) -> None:
    """Refuse columns whose type cannot have values of a row.

    Raises:
        DataError: If there is one.

    Example:
        >>> check_types({"IAS": pl.List(pl.Float64)}, "rows.parquet")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: rows.parquet: column IAS of type List(Float64)...
    """
    for name, kind in types.items():
        if kind.is_nested() or kind in (pl.Binary, pl.Object, pl.Date, pl.Time, pl.Duration):
            raise DataError(
                f"{path}: column {name} of type {kind}", expected=expected, mend=f"convert the column {name}"
            )


def _where(column: pl.Series, fits: pl.Series) -> pl.Series:
    return column if fits.all() else pl.select(pl.when(fits).then(column).alias(column.name)).to_series()


def timestamps(column: pl.Series) -> pl.Series:
    """Datetimes in UTC of datetimes, written dates, or seconds (also milliseconds) since 1970.

    Texts are read cell by cell, so that dates and numbers may stand in one column. What is neither is missing.

    Example:
        >>> timestamps(pl.Series(["2024-03-01T12:00:00Z"])).dt.hour().to_list()
        [12]
    """
    if isinstance(column.dtype, pl.Datetime):
        is_zoned = column.dtype.time_zone is not None
        column = _in_time(column)
        zoned = column if is_zoned else column.dt.replace_time_zone("UTC")
        return zoned.dt.convert_time_zone("UTC").cast(TIMESTAMP)
    if column.dtype != pl.String:
        return _from_epoch(column.cast(pl.Float64, strict=False))
    column = column.str.strip_chars()
    seconds = column.cast(pl.Float64, strict=False)
    found = pl.repeat(None, len(column), dtype=TIMESTAMP, eager=True)
    for form in DATE_FORMATS:
        # Reading dates costs more than anything else: only those that no earlier form fits are read again.
        left = (found.is_null() & seconds.is_null() & column.is_not_null()).arg_true()
        if left.is_empty():
            break
        found = _parsed(column, form) if len(left) == len(column) else found.scatter(left, _parsed(column[left], form))
    if found.count() > seconds.count():  # among dates, a number such as 0 stands for a missing time
        seconds = _where(seconds, seconds >= FIRST_S)
    return found.fill_null(_from_epoch(seconds))


def _in_time(column: pl.Series) -> pl.Series:
    """Datetimes of 1970 and up to 2286, as for numbers; what is outside is missing: libraries give up on year 10000."""
    per_second = PER_SECOND[column.dtype.time_unit]  # type: ignore[attr-defined]
    return _where(column, column.to_physical().is_between(0, min(LAST_S * per_second, 2**63 - 1)).fill_null(True))


def _parsed(column: pl.Series, form: str) -> pl.Series:
    zoned = "z" in form or form == "%+"
    parsed = _in_time(column.str.to_datetime(form, time_unit="us", strict=False))
    return (parsed.dt.convert_time_zone("UTC") if zoned else parsed.dt.replace_time_zone("UTC")).cast(TIMESTAMP)


def wanted(names: Sequence[str], named: Sequence[str] = ()) -> list[str]:
    """Columns of a table that may say something; all of them if a required one is missing, so that they can be named.

    Args:
        names: Of all columns.
        named: Those that the user has named.

    Example:
        >>> wanted(["timestamp", "icao24", "altitude", "ias", "mach", "squawk"])
        ['timestamp', 'icao24', 'altitude', 'ias', 'mach']
    """
    targets = row_names(names)
    named = [*named, *(name.rpartition("*")[0] for name in named if "*" in name)]
    vectors = {*(old for old, _ in SI.values()), "heading", "lastcontact"} if STATE_VECTOR in names else set()
    known = {*COLUMNS, *(() if "altitude" in targets.values() else (LEVELS,))}
    useful = [name for name in names if targets[name] in known or name in vectors or name in named]
    given = {targets[name] for name in useful}
    given |= {"altitude"} if vectors or LEVELS in given else set()
    return useful if given >= set(REQUIRED) - computable(given) else list(names)


def in_seconds(s: pl.Expr) -> pl.Expr:
    """Seconds; also of milli-, micro- or nanoseconds where a number can only be these (up to the year 5138).

    Example:
        >>> pl.select(in_seconds(pl.Series([1.7e9, 1.7e12]))).to_series().to_list()
        [1700000000.0, 1700000000.0]
    """
    return pl.when(s > 1e17).then(s / 1e9).when(s > 1e14).then(s / 1e6).when(s > 1e11).then(s / 1e3).otherwise(s)


def _from_epoch(seconds: pl.Series) -> pl.Series:
    read = in_seconds(pl.col("s"))
    valid = pl.when(read.is_finite() & read.is_between(0, LAST_S)).then(read)
    micro = (valid * 1e6).round().cast(pl.Int64)
    return (
        seconds.alias("s")
        .to_frame()
        .select(pl.from_epoch(micro, time_unit="us").dt.replace_time_zone("UTC"))
        .to_series()
    )
