"""Columns of a table by known names, by those of the trade, and by those that a user gives."""

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path, PurePath
from urllib.parse import unquote

import numpy as np
import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import ALIASES, COLUMNS, REQUIRED, TRADE

OF_ROWS = {name.lower(): name for name in COLUMNS}
"""The rows' own names in small letters: `ALTITUDE` is no other column."""
LEVELS = "FL"
"""Name of a column of flight levels, of which altitudes are made; also `flight_level`, and either in any case."""
LEVEL_NAMES = ("fl", "flight_level")
HIGHEST_LEVEL = 1000.0
"""A median above this is no flight level but feet."""
MAX_NOTED_COLUMNS, MAX_NAME_LETTERS = 12, 40
"""Columns that a line of the report names, and letters of a name."""
UNUSED = "rows whose columns are not used: "
"""First words of such a line."""


def row_names(names: Sequence[str]) -> dict[str, str]:
    """Column -> its name in a row; the name itself where nothing is known.

    Names of the trade (`ROCD`, `TRK`, `ACID`, `IAS_KT`, `FL`) count where no column has a surer name.

    Example:
        >>> row_names(["TIME_UTC", "MODE_S", "FL", "IAS_KT", "ROCD", "squawk"]) == {
        ...     "TIME_UTC": "timestamp", "MODE_S": "icao24", "FL": "FL", "IAS_KT": "IAS", "ROCD": "vertical_rate",
        ...     "squawk": "squawk"}
        True
    """
    small = {name: name.strip().lower() for name in names}
    targets = {name: ALIASES.get(small[name], name) for name in names}
    taken = set(targets.values())
    for name in names:
        target = TRADE.get(small[name], OF_ROWS.get(small[name]))
        target = LEVELS if small[name] in LEVEL_NAMES and "altitude" not in taken else target
        if target is not None and targets[name] == name and target not in taken - {name}:
            targets[name] = target
            # Altitudes in feet are surer than levels, whichever comes first.
            taken |= {target}
    if LEVELS in taken and "altitude" in taken:
        targets = {name: name if target == LEVELS and name != LEVELS else target for name, target in targets.items()}
    return targets


def with_altitude(table: pl.DataFrame, path: object, report: DropReport) -> pl.DataFrame:
    """A table with altitudes in feet, of its flight levels if it has no altitude."""
    if LEVELS not in table.columns or "altitude" in table.columns:
        return table.drop(LEVELS, strict=False)
    levels = table[LEVELS]
    if levels.dtype == pl.String:
        levels = levels.str.strip_chars().replace("", None)
    numbers = levels.cast(pl.Float64, strict=False) if not levels.dtype.is_nested() else levels
    if numbers.dtype != pl.Float64:
        raise DataError(f"{path}: column FL of type {levels.dtype}", expected="numbers", mend="convert the column FL")
    report.note("values of FL that could not be read", numbers.null_count() - levels.null_count())
    check_read(numbers, levels, path, "numbers, in hundreds of feet")
    known = numbers.drop_nulls().to_numpy()
    high = float(np.median(known)) if len(known) else 0.0
    if high > HIGHEST_LEVEL:
        raise DataError(
            f"{path}: column FL holds {high:g} in the middle of its values, which is no flight level",
            expected="flight levels, in hundreds of feet",
            mend="if it is in ft, name it altitude (--column altitude=FL)",
        )
    report.note("altitudes made of flight levels (column FL), times 100", numbers.count())
    return table.with_columns((numbers * 100).alias("altitude")).drop(LEVELS)


def check_read(read: pl.Series, given: pl.Series, path: object, expected: str) -> None:
    """Refuse a column most of whose values cannot be read."""
    lost = read.null_count() - given.null_count()
    if lost <= len(read) / 2:
        return
    unread = given.filter(read.is_null() & given.is_not_null())
    # Python has no dates of far years, which a damaged table may hold.
    first = (unread.to_physical() if unread.dtype.is_temporal() else unread)[0]
    raise DataError(
        f"{path}: {lost} of {len(read)} values of {given.name} cannot be read (the first: {repr(first)[:80]})",
        expected=expected,
        mend=f"convert the column {given.name}",
    )


def with_folders(table: pl.DataFrame, path: object) -> pl.DataFrame:
    """A table with the columns that its folders name, as in `typecode=A320/part-0.parquet`, if it has none for them."""
    have = set(row_names(table.columns).values())
    named = dict(unquote(part).split("=", 1) for part in PurePath(str(path)).parent.parts if "=" in part)
    return table.with_columns(
        pl.lit(None if value == NO_PARTITION else value, pl.String).alias(name)
        for name, target in row_names(list(named)).items()
        for value in [named[name]]
        if target in COLUMNS and target not in have
    )


NO_PARTITION = "__HIVE_DEFAULT_PARTITION__"
"""Value in the name of a folder whose rows have none."""


def note_unused(names: Iterable[str], rows: int, report: DropReport) -> None:
    """Tell in a report which columns of some rows are not used."""
    shown = ["".join(letter if letter.isprintable() else "?" for letter in name)[:MAX_NAME_LETTERS] for name in names]
    shown = [name or "(a column without a name, such as an index)" for name in shown]
    if not shown:
        return
    more = f" and {len(shown) - MAX_NOTED_COLUMNS} more" if len(shown) > MAX_NOTED_COLUMNS else ""
    report.note_of(UNUSED, f"{', '.join(shown[:MAX_NOTED_COLUMNS])}{more}", rows)


def check_named(columns: Mapping[str, str]) -> None:
    """Refuse names that no row has.

    Args:
        columns: Name in a row (:data:`~descentflow.surveillance.rows.schema.COLUMNS`) -> column of the user's tables.

    Raises:
        ConfigError: If a name is none of a row, or two stand for one column.

    Example:
        >>> check_named({"height": "alt_ft"})
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: a column for height; expected one of timestamp, ...
    """
    unknown = [name for name in columns if name not in (*COLUMNS, LEVELS)]
    if unknown:
        raise ConfigError(
            f"a column for {', '.join(unknown)}",
            expected=f"one of {', '.join(COLUMNS)}, or {LEVELS} for flight levels",
            mend="correct the name",
        )
    if len(set(columns.values())) < len(columns):
        raise ConfigError(
            f"one column for several of {', '.join(columns)}", expected="a column for each", mend="correct the names"
        )


def with_named(table: pl.DataFrame, columns: Mapping[str, str], path: Path | str, report: DropReport) -> pl.DataFrame:
    """A table whose columns have the names that the user gives; a column that had such a name before is left out."""
    parts = {ours: _factor(theirs, table.columns) for ours, theirs in columns.items()}
    lacking = [name for name, _ in parts.values() if name not in table.columns]
    if lacking:
        raise DataError(
            f"{path} has no column {', '.join(lacking)} (it has {listed(table.columns)})",
            expected="the columns that --column names",
            mend="correct the names, or prepare files of other columns by themselves",
        )
    taken = {name for name, _ in parts.values()}
    before = {ours for ours in columns if ours in table.columns and ours not in taken}
    before |= {"altitude"} & set(table.columns) - taken if LEVELS in columns else set()
    made = {ours: _multiplied(table[name], factor, ours, report) for ours, (name, factor) in parts.items()}
    return table.drop(before | taken).with_columns(**made)


def _factor(name: str, columns: Sequence[str]) -> tuple[str, float]:
    """Column and factor of `alt_m*3.2808`; a column that is called so is itself."""
    column, star, factor = name.rpartition("*")
    if star and name not in columns:
        with suppress(ValueError):
            return column.strip(), float(factor)
    return name, 1.0


def _multiplied(column: pl.Series, factor: float, name: str, report: DropReport) -> pl.Series:
    if factor == 1.0:
        return column
    if (name != LEVELS and COLUMNS[name] != pl.Float64) or column.dtype.is_nested() or column.dtype == pl.Binary:
        raise ConfigError(f"{name} times {factor:g}", expected="a column of numbers", mend="leave the factor out")
    if column.dtype == pl.String:
        column = column.str.strip_chars().replace("", None)
    numbers = column.cast(pl.Float64, strict=False) * factor
    report.note(f"values of {name} that could not be read", numbers.null_count() - column.null_count())
    return numbers


MAX_LISTED_COLUMNS = 20
"""Columns that are named; an OpenSky state vector has 17."""
STATE_VECTOR = "baroaltitude"
"""Column that only OpenSky's state vectors have; they are in SI units."""
OF_SAMPLES = {"sample_id", "level_fl"}
"""Columns by which a table of `descentflow sample` is known: it has levels and no reports."""
OF_DESCENTS = {"flight_id", "level_fl", "time_s"}
"""Columns by which prepared descents are known."""
COLUMNS_MEND = (
    "name yours, for instance --column altitude=alt_ft of `descentflow prepare`, or rename it; IAS comes with Mode S "
    "enhanced surveillance (BDS 6,0), not with ADS-B alone, and Mach with it; one of the two is computed from the "
    "other, and both from groundspeed, track and a weather field (--airspeeds-from)"
)
VECTORS_MEND = (
    "derive them by a weather field (--airspeeds-from FIELD of `descentflow prepare`), or take them from OpenSky's "
    "replies to Mode S radars (rawdata or the roll-call tables; docs: Sources of rows, Airspeeds from OpenSky), and "
    "pass these replies: state vectors have none"
)
GEOMETRIC_MEND = (
    "name the column of the pressure altitude (--column altitude=NAME); a geometric altitude is none: CAS of a Mach "
    "number follows from the pressure"
)
SAMPLES_MEND = (
    "pass the checkpoint itself in place of its samples, or export them as flights (descentflow export --to traffic)"
)
DESCENTS_MEND = (
    "these are prepared descents: pass the file that `descentflow prepare` wrote to fit, evaluate, diagnose, repair "
    "or predict-descent (saved again by another program it lacks how it was prepared: select flights among the rows, "
    "or in Python by read_descents, Descents and write_descents), and to prepare the rows that they were made of"
)


GPS_NAME = re.compile(r"gps.*(time|sec|week|tow)|(^|_)tow($|_)|time_of_week|week_sec")
"""Begin or part of the name of a column of GPS time."""
GPS_MEND = (
    "write a column timestamp: seconds of GPS time (1980-01-06, without leap seconds) plus 315964782 are seconds since "
    "1970, and a week number is 604800 of them"
)


def listed(names: Sequence[str]) -> str:
    """Names of columns for a message, not too many."""
    more = f" and {len(names) - MAX_LISTED_COLUMNS} more" if len(names) > MAX_LISTED_COLUMNS else ""
    return ", ".join(names[:MAX_LISTED_COLUMNS]) + more


def without_columns(path: Path | str, missing: Sequence[str], theirs: Sequence[str], named: Sequence[str]) -> DataError:
    """The error for a table without these columns."""
    mend = COLUMNS_MEND
    if set(named) >= OF_SAMPLES:
        mend = SAMPLES_MEND
    elif set(named) >= OF_DESCENTS:
        mend = DESCENTS_MEND
    elif STATE_VECTOR in theirs:
        mend = VECTORS_MEND
    elif "altitude" in missing and "geoaltitude" in named:
        mend = GEOMETRIC_MEND
    elif "timestamp" in missing and any(GPS_NAME.search(name.lower()) for name in theirs):
        mend = GPS_MEND
    return DataError(
        f"{path} has no column {', '.join(missing)} (it has {listed(theirs)})",
        expected=f"columns {', '.join(REQUIRED)}, named as the traffic library names them",
        mend=mend,
    )
