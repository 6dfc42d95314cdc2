"""JSON: the documents of a file, their values in columns, and rows as `traffic` and pandas write them."""

import itertools
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import orjson
import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking import Input

BLANKS = re.compile(r"\s*")
DECODER = json.JSONDecoder()


DAMAGED = "JSON lines that are cut or damaged, left out (the first of each file: "
"""Begin of the notes in the report."""


def documents(source: Input, report: DropReport) -> Iterator[object]:
    """Documents of a file, read one at a time where they stand one a line; of a list each element is one.

    A last document that ends before its end, as where a recording was stopped, is left out and counted. So are lines
    that are no JSON among others, unless they are half of them.
    """
    whole, damaged = 0, list[DataError]()
    for number, line in source.lines():
        try:
            documents_read = [orjson.loads(line)]
        except orjson.JSONDecodeError:
            # One that the faster parser does not take, several, or the first line of a document of many.
            try:
                documents_read = list(_one_after_the_other(line, number, source.label))
            except DataError as error:
                if not isinstance(error.__cause__, json.JSONDecodeError | UnicodeDecodeError):
                    raise
                if not whole and not damaged:
                    rest = Input(source.stream, source.label).whole()
                    yield from _elements(_of_many_lines(line + rest, number, source.label, report))
                    return
                damaged.append(error)
                continue
        whole += 1
        yield from _elements(documents_read)
    _judge_damaged(damaged, whole, report)


def _elements(documents_read: Iterable[object]) -> Iterator[object]:
    for document in documents_read:
        yield from document if isinstance(document, list) else [document]


def _of_many_lines(text: bytes, first_line: int, label: str, report: DropReport) -> list[object]:
    """Documents of many lines each; or one a line where the first line is damaged."""
    try:
        return list(_one_after_the_other(text, first_line, label, report))
    except DataError as error:
        read, damaged = [], list[DataError]()
        for number, line in enumerate(text.splitlines(), first_line):
            try:
                read += list(_one_after_the_other(line, number, label))
            except DataError as wrong:
                damaged.append(wrong)
        if len(damaged) >= len(read):
            raise error from error.__cause__
        _judge_damaged(damaged, len(read), report)
        return read


def _judge_damaged(damaged: Sequence[DataError], whole: int, report: DropReport) -> None:
    """Count damaged lines among whole ones; refuse a file of which they are half."""
    if damaged and len(damaged) >= whole:
        raise damaged[0]
    if damaged:
        report.note_of(DAMAGED, f"{damaged[0].got})", len(damaged))


def _one_after_the_other(
    text: bytes, first_line: int, label: str, report: DropReport | None = None
) -> Iterator[object]:
    """Documents of a text, with NaN, infinity and numbers of any length; the last may be cut where it is counted."""
    place, letters, where = 0, "", f"{label}, line {first_line}"
    try:
        letters = text.decode("utf-8-sig")
        while (place := BLANKS.match(letters, place).end()) < len(letters):  # type: ignore[union-attr] # it always fits
            document, place = DECODER.raw_decode(letters, place)
            yield document
    except RecursionError as error:
        raise DataError(
            f"{where}: JSON nested too deeply", expected="surveillance data", mend="pass another file"
        ) from error
    except UnicodeDecodeError as error:
        raise DataError(
            f"{where}: not UTF-8 at byte {error.start}", expected="JSON in UTF-8", mend="save it as UTF-8"
        ) from error
    except json.JSONDecodeError as error:
        if report and place and not text.endswith(b"\n") and "}" not in letters[error.pos :]:
            report.note("JSON documents cut at the end of a file", 1)
            return
        raise DataError(
            f"{label}, line {first_line - 1 + error.lineno}: not JSON ({error.msg})",
            expected="one JSON document, or one a line",
            mend="remove the damaged line, or copy the file again",
        ) from error
    except ValueError as error:  # a number of thousands of digits
        raise DataError(f"{where}: {error}", expected="surveillance data", mend="pass another file") from error


Kinds = dict[str, pl.DataType]


def table(objects: Sequence[dict[str, Any]], kinds: Kinds) -> pl.DataFrame:
    """Columns of the values that objects have under some names; what is no such value becomes missing."""
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
    """Floats, of numbers in quotes too; words, lists, and integers of hundreds of digits become missing."""
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
    """
    kept = [value if type(value) is str else str(value) if type(value) in (int, float) else None for value in values]
    try:
        column = pl.Series(kept, dtype=pl.String)
    except UnicodeEncodeError:
        column = pl.Series([v and v.encode(errors="replace").decode() for v in kept], dtype=pl.String)
    return column.str.strip_chars().replace("", None)


def is_number(value: object) -> bool:
    """Test for a value from JSON that is a finite number and fits a float."""
    return type(value) in (int, float) and -1e300 < value < 1e300  # type: ignore[operator]


def mixed(values: Sequence[Any]) -> pl.Series:
    """Numbers, or text if there is any text; lists and objects become missing."""
    return texts(values) if str in set(map(type, values)) else numbers(values)


TIME_NAMES = frozenset({"timestamp", "time"})
ADDRESS_NAMES = frozenset({"icao24", "hex"})
MAX_HELD_ROWS = 50_000
"""Rows that are held as JSON at a time."""
ROWS_THAT_NAME_COLUMNS = 1000
"""Rows whose keys name the columns; later rows have no others."""


def rows(documents: Iterator[object], label: str, report: DropReport, block_rows: int) -> Iterator[pl.DataFrame]:
    """Rows as they are, numbers as floats and the rest as text."""
    first = next(documents, None)
    stream = itertools.chain([first], documents)
    if isinstance(first, dict) and _of_columns(first):
        for document in stream:
            yield _table_of_columns(document if isinstance(document, dict) else {}, label)
        return
    names: list[str] | None = None
    while batch := list(itertools.islice(stream, min(block_rows, MAX_HELD_ROWS))):
        objects = [row for row in batch if type(row) is dict]
        report.note("JSON values that are no row", len(batch) - len(objects))
        if names is None:
            names = list(dict.fromkeys(name for row in objects[:ROWS_THAT_NAME_COLUMNS] for name in row))
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
    return all(type(document.get(name)) is dict for name in TIME_NAMES & document.keys())


def is_rows(document: object) -> bool:
    """Test for a JSON document of rows, recognised by the names of time and address."""
    return isinstance(document, dict) and bool(TIME_NAMES & document.keys()) and bool(ADDRESS_NAMES & document.keys())
