"""Rows as JSON: a list of objects, one object a line, or an object of columns, as `traffic` and pandas write them."""

import itertools
from collections.abc import Iterator
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.formats.json_values import mixed
from descentflow.surveillance.rows.drop_report import DropReport

TIME = frozenset({"timestamp", "time"})
ADDRESS = frozenset({"icao24", "hex"})
MAX_ROWS = 50_000
"""Rows that are held as JSON at a time."""
NAMES_LOOKED_AT = 1000
"""Rows whose keys name the columns; later rows have no others."""


def rows(documents: Iterator[object], label: str, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows as they are, numbers as floats and the rest as text.

    Args:
        documents: JSON documents of the file.
        label: Name of the file in messages.
        report: Takes the counts of what could not be read.
        block_rows: About the most rows in a part.

    Raises:
        DataError: If the JSON has no rows.

    Example:
        >>> objects = [{"time": 1.7e9, "hex": "4ca001", "ias": 250}, {"time": 1.7e9, "hex": "4ca002"}]
        >>> next(rows(iter(objects), "rows.json", DropReport(), 100)).rows()
        [(1700000000.0, '4ca001', 250.0), (1700000000.0, '4ca002', None)]
    """
    first = next(documents, None)
    stream = itertools.chain([first], documents)
    if isinstance(first, dict) and _of_columns(first):
        for document in stream:
            yield _table_of_columns(document if isinstance(document, dict) else {}, label)
        return
    names: list[str] | None = None
    while batch := list(itertools.islice(stream, min(block_rows, MAX_ROWS))):
        objects = [row for row in batch if type(row) is dict]
        report.note("JSON values that are no row", len(batch) - len(objects))
        if names is None:
            names = list(dict.fromkeys(name for row in objects[:NAMES_LOOKED_AT] for name in row))
        yield pl.DataFrame({name: mixed([row.get(name) for row in objects]) for name in names})


def _table_of_columns(columns: dict[str, Any], label: str) -> pl.DataFrame:
    values = {name: list(column.values()) for name, column in columns.items() if type(column) is dict}
    if len({len(column) for column in values.values()}) > 1:
        raise DataError(
            f"{label}: columns of different lengths",
            expected="as many values in each",
            mend="write the table again, for instance as Parquet",
        )
    return pl.DataFrame({name: mixed(column) for name, column in values.items()})


def _of_columns(document: dict[str, Any]) -> bool:
    return all(type(document.get(name)) is dict for name in TIME & document.keys())


def is_rows(document: object) -> bool:
    """Test for a JSON document of rows, recognised by the names of time and address.

    Example:
        >>> is_rows({"time": 1.7e9, "hex": "4ca001"}), is_rows({"now": 1.7e9, "aircraft": []})
        (True, False)
    """
    return isinstance(document, dict) and bool(TIME & document.keys()) and bool(ADDRESS & document.keys())
