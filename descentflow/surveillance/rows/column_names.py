"""Columns of a table by their own names, by other known names, and by those of the trade."""

from collections.abc import Iterable, Sequence

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import ALIASES, COLUMNS, TRADE

OF_ROWS = {name.lower(): name for name in COLUMNS}
"""The rows' own names in small letters: `ALTITUDE` is no other column."""
LEVELS = "FL"
"""Name of a column of flight levels, of which altitudes are made; also `flight_level`, and either in any case."""
LEVEL_NAMES = ("fl", "flight_level")
HIGHEST_LEVEL = 1000.0
"""A median above this is no flight level but feet."""
MOST_NAMED, LONGEST_NAME, MOST_LINES = 12, 40, 10
"""Columns that a line of the report names, letters of a name, and lines about other tables."""
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
    found = {name: ALIASES.get(name, ALIASES.get(name.lower(), name)) for name in names}
    taken = set(found.values())
    for name in names:
        target = TRADE.get(name.lower(), OF_ROWS.get(name.lower()))
        target = LEVELS if name.lower() in LEVEL_NAMES and "altitude" not in taken else target
        if target is not None and found[name] == name and target not in taken - {name}:
            found[name] = target
            # Altitudes in feet are surer than levels, whichever comes first.
            taken |= {target}
    if LEVELS in taken and "altitude" in taken:
        found = {name: name if target == LEVELS and name != LEVELS else target for name, target in found.items()}
    return found


def with_altitude(table: pl.DataFrame, path: object, report: DropReport) -> pl.DataFrame:
    """A table with altitudes in feet, of its flight levels if it has no altitude.

    Args:
        table: In names of a row.
        path: Named in errors.
        report: Takes the number of altitudes that were made.

    Raises:
        DataError: If the column of flight levels holds feet.

    Example:
        >>> with_altitude(pl.DataFrame({"FL": [350.0]}), "rows.csv", DropReport())["altitude"][0]
        35000.0
    """
    if LEVELS not in table.columns or "altitude" in table.columns:
        return table.drop(LEVELS, strict=False)
    levels = table[LEVELS]
    if levels.dtype == pl.String:
        levels = levels.str.strip_chars().replace("", None)
    numbers = levels.cast(pl.Float64, strict=False) if not levels.dtype.is_nested() else levels
    if numbers.dtype != pl.Float64:
        raise DataError(f"{path}: column FL of type {levels.dtype}", expected="numbers", mend="convert the column FL")
    report.note("values of FL that could not be read", numbers.null_count() - levels.null_count())
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


def note_unused(names: Iterable[str], rows: int, report: DropReport) -> None:
    """Tell in a report which columns of some rows are not used.

    Example:
        >>> report = DropReport()
        >>> note_unused(["squawk", "alert"], 9, report)
        >>> report.notes
        {'rows whose columns are not used: squawk, alert': 9}
    """
    shown = ["".join(letter if letter.isprintable() else "?" for letter in name)[:LONGEST_NAME] for name in names]
    shown = [name or "(a column without a name, such as an index)" for name in shown]
    if not shown:
        return
    more = f" and {len(shown) - MOST_NAMED} more" if len(shown) > MOST_NAMED else ""
    said = f"{UNUSED}{', '.join(shown[:MOST_NAMED])}{more}"
    lines = sum(note.startswith(UNUSED) for note in report.notes)
    report.note(said if said in report.notes or lines < MOST_LINES else f"{UNUSED}other tables' columns", rows)
