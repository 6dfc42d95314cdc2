"""The format of a file from its content, and the file's rows as that format names the columns."""

import itertools
from collections.abc import Iterator, Sequence

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.formats import mode_s_frames, tables
from descentflow.surveillance.formats.file_format import Columns, FileFormat, Format, JsonFormat, TextFormat
from descentflow.surveillance.formats.known_formats import ACCEPTED, FORMATS, HELD_TABLE, KNOWN
from descentflow.surveillance.formats.refused_files import BINARY, TEXT, refuse_known
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.json_documents import documents
from descentflow.surveillance.unpacking.streams import Input

SPLIT_MEND = "write the table of pandas with orient='records' or as Parquet; names and values apart are not read"
TRIED = sorted(KNOWN, key=lambda one: one.any_columns)
"""Formats in the order in which they are tried."""


def recognised(
    source: Input, report: DropReport, name: str | None, block_rows: int
) -> tuple[Format, Iterator[Columns]]:
    """Format of a file, and its rows in parts.

    Args:
        source: The file, without the gzip around it.
        report: Takes the counts of what could not be read.
        name: Name of the format; recognised from the content if None.
        block_rows: About the most rows in a part.

    Raises:
        DataError: If the file is of no known format or damaged.

    Example:
        >>> with Path("rows.parquet").open("rb") as file:
        ...     found, parts = recognised(Input(file, "rows.parquet"), DropReport(), None, block_rows=1000)
        ...     print(found.name, len(next(parts)))
        parquet 1000
    """
    head, source = source.head()
    if not head:
        mend = "check how it was written or copied, or take it out of what is read"
        raise DataError(f"{source.label} is empty", expected=ACCEPTED, mend=mend)
    found = FORMATS[name] if name else format_of_bytes(head, source.label)
    if isinstance(found, FileFormat):
        return _table_or_frames(found, found.read(source, report, block_rows), report)
    each = documents(source, report)
    begin: list[object] = []
    for document in each:  # to the first object: a list may begin with null
        begin.append(document)
        if isinstance(document, dict):
            break
    found = found or format_of_document(begin[-1] if begin else None, source.label)
    return found, found.read(itertools.chain(begin, each), source.label, report, block_rows)


def _table_or_frames(found: Format, parts: Iterator[Columns], report: DropReport) -> tuple[Format, Iterator[Columns]]:
    """The same, unless a table of any columns holds raw Mode S frames: then these are decoded."""
    if not found.any_columns:
        return found, parts
    first = next(parts)
    parts = itertools.chain([first], parts)
    if mode_s_frames.is_table(first):
        return FORMATS["modes-hex"], mode_s_frames.of_tables(parts, report)
    return found, parts


def held_parts(
    table: pl.DataFrame, label: str, report: DropReport, block_rows: int, columns: Sequence[str] = ()
) -> tuple[Format, Iterator[Columns]]:
    """As :func:`recognised`, of a table in memory.

    Args:
        table: Rows with the columns of any source.
        label: Its name in messages.
        report: Takes the counts of what could not be read.
        block_rows: About the most rows in a part.
        columns: Columns that are read besides those whose names are known.

    Raises:
        DataError: If a column cannot hold values of a row, or it holds frames and the decoder is not installed.

    Example:
        >>> found, parts = held_parts(pl.read_parquet("rows.parquet"), "a table", DropReport(), block_rows=1000)
        >>> len(next(parts))
        1000
    """
    return _table_or_frames(HELD_TABLE, tables.held(table, label, report, block_rows, columns), report)


def format_of_bytes(head: bytes, label: str) -> FileFormat | None:
    """Format of a file that begins with these bytes; None if it is JSON, whose first document has to be read.

    Raises:
        DataError: If it is of no known format.

    Example:
        >>> format_of_bytes(b"timestamp,icao24,altitude", "rows.csv").name
        'csv'
    """
    refuse_known(head, BINARY, label)
    for one in TRIED:
        if isinstance(one, FileFormat) and not isinstance(one, TextFormat) and one.recognise(head):
            return one
    text = _text(head, label)
    if text[:1] in (b"{", b"["):
        return None
    return next(one for one in TRIED if isinstance(one, TextFormat) and one.recognise(text))


def _text(head: bytes, label: str) -> bytes:
    """Begin of a text without byte order mark and blanks before it."""
    if b"\0" in head:
        raise DataError(
            f"{label}: neither text nor of a known binary kind", expected=ACCEPTED, mend="convert it to one of these"
        )
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not text:
        raise DataError(f"{label} holds no text", expected=ACCEPTED, mend="check how it was written")
    if not text.startswith((b"{", b"[")):
        refuse_known(text, TEXT, label)
    return text


def format_of_document(document: object, label: str) -> JsonFormat:
    """Format of a file whose first JSON document is this one.

    Raises:
        DataError: If it is of no known format.

    Example:
        >>> format_of_document({"now": 1.7e9, "aircraft": []}, "aircraft.json").name
        'aircraft-json'
    """
    for one in TRIED:
        if isinstance(one, JsonFormat) and one.recognise(document):
            return one
    names = list(document) if isinstance(document, dict) else []
    if "hex" in names:
        raise DataError(
            f"{label}: aircraft of a receiver without the time of each",
            expected="`now` beside `hex` or around the list `aircraft`, in seconds since 1970",
            mend="record whole snapshots (aircraft.json), or readsb's JSON output",
        )
    raise DataError(
        f"{label}: JSON of no known kind (it has {', '.join(map(str, names[:8])) or 'no object'})",
        expected=ACCEPTED,
        mend=SPLIT_MEND if {"columns", "data"} <= set(names) else "pass such a file",
    )
