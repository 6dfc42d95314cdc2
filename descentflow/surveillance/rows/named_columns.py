"""Columns that the user names, and the one column that can be computed from others."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.column_names import LEVELS
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.missing_columns import listed
from descentflow.surveillance.rows.schema import COLUMNS, POSSIBLE

MACH_COMPUTED = "values of Mach computed from IAS and altitude"
"""Note in the report of rows whose source has no Mach."""
IAS_COMPUTED = "values of IAS computed from Mach and altitude"
"""Note in the report of rows whose source has no IAS."""
MACH_MISSING = 0.25
"""Share of rows with a Mach number below which the others' is computed: the source hardly reports it."""


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
    """A table whose columns have the names that the user gives; a column that had such a name before is left out.

    Args:
        table: As its source names the columns.
        columns: As for :func:`check_named`; a column may be multiplied, `"alt_m*3.2808"`.
        path: Named in errors.
        report: Takes the number of values that could not be multiplied.

    Raises:
        DataError: If the table lacks one of the user's columns.

    Example:
        >>> table = pl.DataFrame({"alt_ft": [300.0], "ias": [100.0]})
        >>> with_named(table, {"altitude": "alt_ft", "IAS": "ias*1.9438"}, "rows.csv", DropReport()).row(0)
        (300.0, 194.38)
    """
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


def computable(names: Iterable[str]) -> set[str]:
    """The airspeed that columns can stand without, because it follows from the other one and altitude.

    Example:
        >>> computable(["altitude", "IAS"]), computable(["altitude", "Mach"]), computable(["altitude"])
        ({'Mach'}, {'IAS'}, set())
    """
    lacking = {"IAS", "Mach"} - set(names)
    return lacking if "altitude" in names and len(lacking) == 1 else set()


def with_ias(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows with IAS computed from Mach and pressure altitude, if no row has any.

    Args:
        rows: In names, types and units of a row.
        report: Takes the number of values that were computed.

    Example:
        >>> rows = with_ias(pl.DataFrame({"altitude": [35000.0], "Mach": [0.78]}), DropReport())
        >>> round(rows["IAS"][0])
        264
    """
    if "Mach" not in rows.columns or ("IAS" in rows.columns and rows["IAS"].count()):
        return rows
    possible = rows.select(
        pl.when(pl.col(name).is_between(*POSSIBLE[name])).then(pl.col(name)).alias(name)
        for name in ("Mach", "altitude")
    )
    ias = pl.Series(cas_of_mach_kt(possible["Mach"].to_numpy(), possible["altitude"].to_numpy())).fill_nan(None)
    report.note(IAS_COMPUTED, ias.count())
    return rows.with_columns(IAS=ias).select(name for name in COLUMNS if name == "IAS" or name in rows.columns)


def mach_reported(rows: pl.DataFrame) -> float:
    """Share of the rows with IAS and altitude that have a Mach number too; 1 if there are none.

    Example:
        >>> mach_reported(pl.DataFrame({"altitude": [35000.0, 35000.0], "IAS": [266.0, 266.0], "Mach": [0.78, None]}))
        0.5
    """
    if not {"altitude", "IAS"} <= set(rows.columns):
        return 1.0
    usable = rows.drop_nulls(["altitude", "IAS"])
    if "Mach" not in usable.columns:
        return 0.0
    return usable["Mach"].count() / len(usable) if len(usable) else 1.0


def with_mach(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows with Mach computed from IAS and pressure altitude, where they have none.

    Instrument and position errors are neglected (IAS is CAS, as everywhere); the relation is that of
    :func:`~descentflow.surveillance.rows.air_data.mach_of_cas`. IAS and altitude cannot be checked against Mach then.

    Args:
        rows: In names, types and units of a row, with Mach or without.
        report: Takes the number of values that were computed.

    Example:
        >>> rows = with_mach(pl.DataFrame({"altitude": [35000.0], "IAS": [266.0]}), DropReport())
        >>> round(rows["Mach"][0], 2)
        0.78
    """
    possible = rows.select(
        pl.when(pl.col(name).is_between(*POSSIBLE[name])).then(pl.col(name)).alias(name) for name in ("IAS", "altitude")
    )
    mach = pl.Series("Mach", mach_of_cas(possible["IAS"].to_numpy(), possible["altitude"].to_numpy())).fill_nan(None)
    given = rows["Mach"] if "Mach" in rows.columns else pl.repeat(None, len(rows), dtype=pl.Float64, eager=True)
    rows = rows.with_columns(Mach=given.fill_null(mach))
    report.note(MACH_COMPUTED, rows["Mach"].count() - given.count())
    return rows.select(name for name in COLUMNS if name in rows.columns)
