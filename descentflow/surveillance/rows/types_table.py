"""Tables that say which aircraft is of which type: `icao24,typecode`."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.tabular import held_table
from descentflow.surveillance.rows.addresses import six_digits
from descentflow.surveillance.rows.column_names import row_names
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.missing_columns import listed
from descentflow.surveillance.rows.normalise import check_types


def types_held(types: Any) -> pl.DataFrame:
    """A table of types that is no file: of polars or pandas, or a dictionary address -> type.

    Raises:
        ConfigError: If it is none of these.
        DataError: If it lacks a column.

    Example:
        >>> types_held({"4CA001": "A320"}).rows()
        [('4ca001', 'A320')]
    """
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

    Addresses are six hexadecimal digits, as in rows.

    Args:
        types: Table of a user.
        source: What it is called in the error.

    Raises:
        DataError: If it lacks a column.

    Example:
        >>> named_types(pl.DataFrame({"MODE_S": ["4CA001"], "actype": ["A320"]}), "types.csv").rows()
        [('4ca001', 'A320')]
    """
    names = row_names(types.columns)
    absent = [name for name in ("icao24", "typecode") if name not in names.values()]
    if absent:
        raise DataError(
            f"{source}: a types table without {', '.join(absent)} (it has {listed(types.columns)})",
            expected="columns icao24,typecode",
            mend="rename its columns",
        )
    found = {ours: next(name for name, target in names.items() if target == ours) for ours in ("icao24", "typecode")}
    named = types.rename({theirs: ours for ours, theirs in found.items() if ours not in types.columns})
    check_types({name: named[name].dtype for name in found}, str(source), "text")
    return named.with_columns(six_digits(named["icao24"], source, DropReport()))
