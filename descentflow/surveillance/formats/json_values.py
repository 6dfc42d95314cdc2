"""Columns of values from JSON: numbers where they are numbers, missing where they are anything else."""

from collections.abc import Sequence
from typing import Any

import polars as pl

Kinds = dict[str, pl.DataType]


def table(objects: Sequence[dict[str, Any]], kinds: Kinds) -> pl.DataFrame:
    """Columns of the values that objects have under some names; what is no such value becomes missing.

    Args:
        objects: As they come from JSON.
        kinds: Name -> Float64, String, or Struct of such for an object within.

    Example:
        >>> table([{"ias": 250, "flight": "TST1"}, {"ias": [3]}], {"ias": pl.Float64(), "flight": pl.String()}).rows()
        [(250.0, 'TST1'), (None, None)]
    """
    if not objects:
        return pl.DataFrame(schema=kinds)
    try:
        return pl.from_dicts(objects, schema=kinds, strict=False)
    except (pl.exceptions.PolarsError, ValueError, TypeError, OverflowError):
        # Something that the fast way does not take; look at every value.
        return pl.DataFrame({name: _careful([thing.get(name) for thing in objects], kinds[name]) for name in kinds})


def _careful(values: list[Any], kind: pl.DataType) -> pl.Series:
    if isinstance(kind, pl.Struct):
        kinds: Any = kind.to_schema()
        inner = table([value if type(value) is dict else {} for value in values], kinds)
        return inner.to_struct()
    return numbers(values) if kind == pl.Float64 else texts(values)


def numbers(values: Sequence[Any]) -> pl.Series:
    """Floats, of numbers in quotes too; words, lists, and integers of hundreds of digits become missing.

    Example:
        >>> numbers([1, 2.5, "ground", None, "3", 10**400]).to_list()
        [1.0, 2.5, None, None, 3.0, None]
    """
    if not set(map(type, values)) <= {int, float, type(None)}:
        values = [_float(value) for value in values]
    try:
        return pl.Series(values, dtype=pl.Float64, strict=False)
    except (OverflowError, pl.exceptions.PolarsError):
        return pl.Series([_float(value) for value in values], dtype=pl.Float64)


def _float(value: Any) -> float | None:
    try:
        return float(value) if type(value) in (int, float, str, bool) else None
    except (ValueError, OverflowError):
        return None


def texts(values: Sequence[Any]) -> pl.Series:
    """Text without blanks around it, of numbers too; anything else becomes missing.

    JSON may escape half a surrogate pair, which is no text that could be stored: it becomes a question mark.

    Example:
        >>> texts([" A320 ", 7, ["A320"], ""]).to_list()
        ['A320', '7', None, None]
    """
    kept = [value if type(value) is str else str(value) if type(value) in (int, float) else None for value in values]
    try:
        column = pl.Series(kept, dtype=pl.String)
    except UnicodeEncodeError:
        column = pl.Series([v and v.encode(errors="replace").decode() for v in kept], dtype=pl.String)
    return column.str.strip_chars().replace("", None)


def is_number(value: object) -> bool:
    """Test for a value from JSON that is a finite number and fits a float.

    Example:
        >>> is_number(3), is_number(True), is_number(10**400)
        (True, False, False)
    """
    return type(value) in (int, float) and -1e300 < value < 1e300  # type: ignore[operator]


def mixed(values: Sequence[Any]) -> pl.Series:
    """Numbers, or text if there is any text; lists and objects become missing.

    Example:
        >>> mixed([1, "2.5", [3]]).to_list()
        ['1', '2.5', None]
    """
    return texts(values) if str in set(map(type, values)) else numbers(values)
