"""Columns of values from JSON: numbers where they are numbers, missing where they are anything else."""

from collections.abc import Sequence
from typing import Any

import polars as pl


def numbers(values: Sequence[Any]) -> pl.Series:
    """Floats; words, lists, true and false, and integers of hundreds of digits become missing.

    Example:
        >>> numbers([1, 2.5, "ground", None, True, 10**400]).to_list()
        [1.0, 2.5, None, None, None, None]
    """
    kinds = set(map(type, values))
    if not kinds <= {int, float, type(None)}:
        values = [value if type(value) in (int, float) else None for value in values]
    try:
        return pl.Series(values, dtype=pl.Float64, strict=False)
    except (OverflowError, pl.exceptions.PolarsError):
        return pl.Series([_float(value) for value in values], dtype=pl.Float64)


def _float(value: float | None) -> float | None:
    try:
        return None if value is None else float(value)
    except OverflowError:
        return None


def texts(values: Sequence[Any]) -> pl.Series:
    """Text without blanks around it; anything else becomes missing.

    JSON may escape half a surrogate pair, which is no text that could be stored: it becomes a question mark.
    """
    kept = [value if type(value) is str else None for value in values]
    try:
        column = pl.Series(kept, dtype=pl.String)
    except UnicodeEncodeError:
        column = pl.Series([v and v.encode(errors="replace").decode() for v in kept], dtype=pl.String)
    return column.str.strip_chars().replace("", None)


def is_number(value: object) -> bool:
    """Whether a value from JSON is a finite number that a float can hold.

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
    if str not in set(map(type, values)):
        return numbers(values)
    return texts([str(value) if type(value) in (int, float) else value for value in values])
