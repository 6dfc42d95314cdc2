"""Small parts of a format with fixed columns are put together: columns of many rows cost less than of a few."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import polars as pl

from descentflow.surveillance.formats.file_format import Columns, Part
from descentflow.surveillance.rows.drop_report import DropReport

MAX_POINTS = 50_000
"""Points of traces that are held as JSON."""
MAX_TABLES = 2000
"""Tables that are put together at once."""


@dataclass(frozen=True)
class SourceTable:
    """Rows with the columns as their format names them.

    Attributes:
        columns: The table.
        label: Name of the (first) file in messages.
        any_columns: Whether names and units have to be checked.
        first: Whether it is the first of its file.

    Example:
        >>> SourceTable(pl.DataFrame({"IAS": [250.0]}), "rows.csv", any_columns=True).first
        True
    """

    columns: pl.DataFrame
    label: str
    any_columns: bool
    first: bool = True


def put_together(parts: Iterator[Part], report: DropReport, block_rows: int) -> Iterator[SourceTable]:
    """Tables of the parts, in their order: one for each part of any columns, else one for many small parts.

    Args:
        parts: Of any files.
        report: Takes the counts of what could not be read.
        block_rows: Rows from which parts do not wait for others.

    Example:
        >>> from descentflow.surveillance.formats.known_formats import FORMATS
        >>> rows = pl.DataFrame({"IAS": [250.0]})
        >>> parts = (Part(rows, FORMATS["aircraft-json"], f"{number}.json", first=True) for number in range(3))
        >>> [len(table.columns) for table in put_together(parts, DropReport(), 100)]
        [3]
    """
    waiting: list[Part] = []
    for part in parts:
        if waiting and (part.format.any_columns or not _belongs(part, waiting, block_rows)):
            table, waiting = _joined(waiting, report), []
            yield table
        if part.format.any_columns:
            yield SourceTable(part.rows, part.label, any_columns=True, first=part.first)
        else:
            waiting.append(part)
    if waiting:
        yield _joined(waiting, report)


def _joined(parts: Sequence[Part], report: DropReport) -> SourceTable:
    rows: list[Columns] = [part.rows for part in parts]
    join = parts[0].format.join
    return SourceTable(join(rows, report) if join else pl.concat(rows), parts[0].label, any_columns=False)


def _belongs(part: Part, waiting: Sequence[Part], block_rows: int) -> bool:
    """Test for a part that can be joined with those that wait, by format and number of rows."""
    count = sum(len(one.rows) for one in waiting)
    if part.format.join is not waiting[0].format.join:
        return False
    if part.format.join:
        return count < MAX_POINTS
    return part.rows.schema == waiting[0].rows.schema and count < block_rows and len(waiting) < MAX_TABLES
