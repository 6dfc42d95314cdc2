"""ICAO addresses in one spelling, however a table writes them, and tables of the type of each address."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DataError, warn
from descentflow.core.tabular import held_table
from descentflow.surveillance.rows._column_names import listed, row_names
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import check_types

SIX_HEX_DIGITS = r"^[0-9a-f]{6}$"
HEX_DIGITS = re.compile(r"[0-9a-f]{1,6}", re.ASCII)
DECIMAL_NUMBER = re.compile(r"\d{1,8}", re.ASCII)
MAX_ADDRESS = 0xFFFFFF
"""Largest address of 24 bits: 16777215, of eight decimal digits."""
MAX_SIX_DIGITS = 999_999
"""A larger number has more digits than an address has hexadecimal ones: it is the value of an address."""
SPELT_ANEW = "addresses (icao24) written with six hexadecimal digits, which they had not"
KEPT_ADDRESSES = "addresses (icao24) of seven or eight digits among hexadecimal ones, kept as they are"
"""Notes in the report."""


def six_digits(column: pl.Series, source: object, report: DropReport) -> pl.Series:
    """Addresses as six hexadecimal digits in small letters; `0x`, capitals, blanks and the `~` of TIS-B go.

    Up to six hexadecimal digits have lost zeros, as spreadsheets and pandas take them from `008014`. Whole numbers of
    which one has seven digits or more are values of addresses. Where none has, they are taken for digits that were read
    as a number, with a warning, for they may be values: unless they number aircraft (1, 2, 3, ...). What is no address
    is a name of an aircraft and stays as it is.

    Args:
        column: Texts or numbers.
        source: Begin of warnings.
        report: Takes the number of rows whose address was written otherwise.

    Example:
        >>> six_digits(pl.Series(["4CA001", "0x4ca001", "8014"]), "rows.csv", DropReport()).to_list()
        ['4ca001', '4ca001', '008014']
        >>> six_digits(pl.Series([16323968, 32788]), "rows.parquet", DropReport()).to_list()
        ['f91580', '008014']
    """
    numbers = column.dtype.is_numeric()
    if column.dtype.is_float():
        whole = column.cast(pl.Int64, strict=False)
        numbers = bool((whole == column).fill_null(True).all())
        column = whole if numbers else column
    if column.dtype == pl.String and column.unique().str.contains(SIX_HEX_DIGITS).all():
        return column
    text = column.cast(pl.String).str.strip_chars(" \t~").str.to_lowercase().replace("", None)
    distinct = text.drop_nulls().unique().sort().to_list()
    # pandas writes whole numbers next to a missing one as 8014.0.
    bare = {name: name.removeprefix("0x").removesuffix(".0") for name in distinct}
    spelt = _spelt(bare, numbers or not any(name.startswith("0x") for name in distinct), source)
    changed = {name: new for name, new in spelt.items() if new != name}
    if changed:
        report.note(SPELT_ANEW, int(text.is_in(list(changed)).sum()))
        text = text.replace(changed)
    if any(map(_has_letters, bare.values())):
        _tell_kept(text, spelt.values(), source, report)
    return text


def _spelt(bare: dict[str, str], may_be_values: bool, source: object) -> dict[str, str]:
    """Name as given -> as six digits, if it is an address."""
    numbers = [int(name) for name in bare.values() if DECIMAL_NUMBER.fullmatch(name)]
    only_numbers = len(numbers) == len(bare) and may_be_values
    if only_numbers and numbers and MAX_SIX_DIGITS < max(numbers) <= MAX_ADDRESS:
        return {given: f"{int(name):06x}" for given, name in bare.items()}
    if only_numbers and numbers and max(numbers) <= MAX_SIX_DIGITS:
        _tell_ambiguous(bare, numbers, source)
    return {given: name.zfill(6) if HEX_DIGITS.fullmatch(name) else given for given, name in bare.items()}


def _tell_ambiguous(bare: dict[str, str], numbers: list[int], source: object) -> None:
    """Warn of numbers that may be digits of addresses or values of them: both are of the same few countries."""
    lost = [name for name in bare.values() if len(name) < 6]
    if not lost or max(numbers) < 2 * len(numbers):
        return
    one = lost[0]
    warn(
        f"{source}: icao24 holds numbers of at most six digits ({', '.join(list(bare.values())[:3])}), taken for "
        f"hexadecimal digits that lost zeros ({one} for {one.zfill(6)}); if they are decimal values of addresses "
        f"({one} for {int(one):06x}), write them as six hexadecimal digits"
    )


def _has_letters(name: str) -> bool:
    return HEX_DIGITS.fullmatch(name) is not None and not name.isdecimal()


def _tell_kept(text: pl.Series, names: Iterable[str], source: object, report: DropReport) -> None:
    """Count numbers too long for six hexadecimal digits, where other rows have these: of two tables, perhaps."""
    long = [name for name in names if len(name) > 6 and DECIMAL_NUMBER.fullmatch(name)]
    if not long:
        return
    rows = int(text.is_in(long).sum())
    report.note(KEPT_ADDRESSES, rows)
    warn(
        f"{source}: {rows:,} rows have an icao24 of seven or eight digits ({long[0]}) and others hexadecimal ones; "
        "they are kept as aircraft of their own: write all addresses as six hexadecimal digits"
    )


def types_held(types: Any) -> pl.DataFrame:
    """A table of types that is no file: of polars or pandas, or a dictionary address -> type."""
    types = held_table(types)
    if isinstance(types, Mapping):
        names = {"icao24": map(str, types), "typecode": map(str, types.values())}
        types = pl.DataFrame(
            {name: list(values) for name, values in names.items()}, schema=dict.fromkeys(names, pl.String)
        )
    if not isinstance(types, pl.DataFrame):
        raise ConfigError(
            f"types of type {type(types).__name__}",
            expected="a file or table of icao24,typecode, or a dictionary address -> type",
            mend='pass one, for instance types={"4ca001": "A320"}',
        )
    return named_types(types, "a types table")


def named_types(types: pl.DataFrame, source: object) -> pl.DataFrame:
    """A table of types with its columns named icao24 and typecode; other known names of these are taken, too.

    Addresses are six hexadecimal digits, as in rows. A list of flights without addresses has flight_id in their place.
    """
    names = row_names(types.columns)
    key = "flight_id" if "icao24" not in names.values() and "flight_id" in names.values() else "icao24"
    absent = [name for name in (key, "typecode") if name not in names.values()]
    if absent:
        raise DataError(
            f"{source}: a types table without {', '.join(absent)} (it has {listed(types.columns)})",
            expected="columns icao24,typecode, or flight_id,typecode",
            mend="rename its columns",
        )
    columns = {ours: next(name for name, target in names.items() if target == ours) for ours in (key, "typecode")}
    named = types.rename({theirs: ours for ours, theirs in columns.items() if ours not in types.columns})
    check_types({name: named[name].dtype for name in columns}, str(source), "text")
    if key == "flight_id":
        return named.select(pl.col(key, "typecode").cast(pl.String).str.strip_chars())
    return named.with_columns(six_digits(named["icao24"], source, DropReport()))
