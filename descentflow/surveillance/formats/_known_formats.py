"""The table of formats: to add a source of rows, write its file in this folder and enter it here."""

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import table_beside
from descentflow.surveillance.formats import _asterix, _mode_s, _readsb_trace, _scat, _tables, aircraft_json, json_rows
from descentflow.surveillance.formats.json_rows import documents
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking import Input

Columns = Any
"""A polars table with the columns as the format names them, or something that :attr:`Format.join` makes one of."""


@dataclass(frozen=True)
class Format:
    """A format of surveillance rows.

    Attributes:
        name: As `--format` takes it.
        kind: What it is recognised by: first bytes, first bytes of a text without byte order mark and blanks before
            it, or the first document of JSON.
        recognise: Whether a file that begins so is of the format.
        read: Tables of about so many rows from a stream, or from the documents of a file with that label; what cannot
            be read is counted in the report.
        any_columns: Whether anybody may have made such tables, so that the names and units of every file have to be
            checked. Other formats have fixed columns, and their small files are put together.
        join: Makes one table of several parts, where :func:`polars.concat` does not.

    Example:
        >>> FORMATS["parquet"].recognise(b"PAR1"), FORMATS["parquet"].recognise(b"timestamp,icao24")
        (True, False)
        >>> FORMATS["aircraft-json"].recognise({"now": 1.7e9, "aircraft": []})
        True
    """

    name: str
    kind: Literal["bytes", "text", "JSON"]
    recognise: Callable[[Any], bool]
    read: Callable[..., Iterator[Columns]]
    any_columns: bool = False
    join: Callable[[Sequence[Columns], DropReport], pl.DataFrame] | None = None


@dataclass(frozen=True)
class RowBlock:
    """Some rows of one file, with the columns as its format names them.

    Attributes:
        rows: A table, or what the format's `join` makes one of.
        format: Of the file.
        label: Name of the (first) file in messages.
        first: Whether it is the first block of its file.
    """

    rows: Columns
    format: Format
    label: str
    first: bool


MAX_HELD_POINTS = 50_000
"""Points of traces that are held as JSON."""
MAX_JOINED_TABLES = 2000
"""Tables that are put together at once."""
KNOWN_FORMATS = (
    Format("parquet", "bytes", _tables.is_parquet, _tables.parquet, any_columns=True),
    Format("feather", "bytes", _tables.is_feather, _tables.feather, any_columns=True),
    Format("csv", "text", bool, _tables.csv, any_columns=True),
    Format("json-rows", "JSON", json_rows.is_rows, json_rows.rows, any_columns=True),
    Format("readsb-trace", "JSON", _readsb_trace.is_trace, _readsb_trace.rows, join=_readsb_trace.joined),
    Format("aircraft-json", "JSON", aircraft_json.is_snapshot, aircraft_json.rows),
    Format("jet1090", "JSON", _mode_s.is_message, _mode_s.jet1090),
    Format("modes-hex", "text", _mode_s.begins_with_frames, _mode_s.lines),
    Format("scat", "JSON", _scat.is_flight, _scat.rows),
    Format("asterix", "bytes", _asterix.is_asterix, _asterix.rows),
)
"""The formats. They are tried in this order, but those of any columns after all others: what they recognise is least
specific."""
FORMATS = {known.name: known for known in KNOWN_FORMATS}
"""Name -> format; each is also read from gzip and tar archives."""
HELD_TABLE = Format("table", "bytes", bool, _tables.held, any_columns=True)
"""Rows that are no file."""
ACCEPTED = f"one of {', '.join(FORMATS)} (docs: Sources of rows)"
"""List of accepted files, for messages."""


def check_format(name: str | None) -> None:
    """Refuse the name of an unknown format."""
    if name is not None and name not in FORMATS:
        raise ConfigError(
            f"no format {name!r}",
            expected=f"one of {', '.join(FORMATS)}",
            mend="name one of these, or none so that the format is recognised from the content",
        )


def put_together(parts: Iterator[RowBlock], report: DropReport, block_rows: int) -> Iterator[RowBlock]:
    """Tables of the parts, in their order: one for each part of any columns, else one for many small parts."""
    waiting: list[RowBlock] = []
    for part in parts:
        if waiting and (part.format.any_columns or not _belongs(part, waiting, block_rows)):
            yield _joined(waiting, report)
            waiting = []
        if part.format.any_columns:
            yield part
        else:
            waiting.append(part)
    if waiting:
        yield _joined(waiting, report)


def _joined(parts: Sequence[RowBlock], report: DropReport) -> RowBlock:
    rows: list[Columns] = [part.rows for part in parts]
    join = parts[0].format.join
    return replace(parts[0], rows=join(rows, report) if join else pl.concat(rows))


def _belongs(part: RowBlock, waiting: Sequence[RowBlock], block_rows: int) -> bool:
    """Test for a part that can be joined with those that wait, by format and number of rows."""
    count = sum(len(one.rows) for one in waiting)
    if part.format.join is not waiting[0].format.join:
        return False
    if part.format.join:
        return count < MAX_HELD_POINTS
    return part.rows.schema == waiting[0].rows.schema and count < block_rows and len(waiting) < MAX_JOINED_TABLES


REFUSED = table_beside(__file__)
"""Kinds of files, `binary` and `text`, that are not read: how they begin, what they are, and what the user can do."""


def refuse_known(begin: bytes, kind: Literal["binary", "text"], label: str) -> None:
    """Refuse a file that begins as one of these kinds."""
    for refused in REFUSED[kind]:
        if re.match(refused["begins"].encode(), begin, re.DOTALL):
            raise DataError(f"{label} is {refused['what']}", expected=ACCEPTED, mend=refused["mend"])


SPLIT_MEND = "write the table of pandas with orient='records' or as Parquet; names and values apart are not read"
TRIED = sorted(KNOWN_FORMATS, key=lambda known: known.any_columns)
"""Formats in the order in which they are tried."""


def recognised(
    source: Input, report: DropReport, name: str | None, block_rows: int
) -> tuple[Format, Iterator[Columns]]:
    """Format of a file, and its rows in parts."""
    head = source.head()
    if not head:
        mend = "check how it was written or copied, or take it out of what is read"
        raise DataError(f"{source.label} is empty", expected=ACCEPTED, mend=mend)
    known = FORMATS[name] if name else format_of_bytes(head, source.label)
    if known and known.kind != "JSON":
        return _table_or_frames(known, known.read(source, report, block_rows), report)
    each = documents(source, report)
    begin: list[object] = []
    for document in each:  # to the first object: a list may begin with null
        begin.append(document)
        if isinstance(document, dict):
            break
    known = known or format_of_document(begin[-1] if begin else None, source.label)
    return known, known.read(itertools.chain(begin, each), source.label, report, block_rows)


def _table_or_frames(known: Format, parts: Iterator[Columns], report: DropReport) -> tuple[Format, Iterator[Columns]]:
    """The same, unless a table of any columns holds raw Mode S frames: then these are decoded."""
    if not known.any_columns:
        return known, parts
    first = next(parts)
    parts = itertools.chain([first], parts)
    if _mode_s.is_table(first):
        return FORMATS["modes-hex"], _mode_s.of_tables(parts, report)
    return known, parts


def held_parts(
    table: pl.DataFrame, label: str, report: DropReport, block_rows: int, columns: Sequence[str] = ()
) -> tuple[Format, Iterator[Columns]]:
    """As :func:`recognised`, of a table in memory."""
    return _table_or_frames(HELD_TABLE, _tables.held(table, label, report, block_rows, columns), report)


def format_of_bytes(head: bytes, label: str) -> Format | None:
    """Format of a file that begins with these bytes; None if it is JSON, whose first document has to be read."""
    refuse_known(head, "binary", label)
    for known in TRIED:
        if known.kind == "bytes" and known.recognise(head):
            return known
    text = _text(head, label)
    if text[:1] in (b"{", b"["):
        return None
    return next(known for known in TRIED if known.kind == "text" and known.recognise(text))


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
        refuse_known(text, "text", label)
    return text


def format_of_document(document: object, label: str) -> Format:
    """Format of a file whose first JSON document is this one."""
    for known in TRIED:
        if known.kind == "JSON" and known.recognise(document):
            return known
    names = list(document) if isinstance(document, dict) else []
    if "hex" in names:
        raise DataError(
            f"{label}: aircraft of a receiver without the time of each",
            expected="`now` next to `hex` or around the list `aircraft`, in seconds since 1970",
            mend="record whole snapshots (aircraft.json), or readsb's JSON output",
        )
    raise DataError(
        f"{label}: JSON of no known kind (it has {', '.join(map(str, names[:8])) or 'no object'})",
        expected=ACCEPTED,
        mend=SPLIT_MEND if {"columns", "data"} <= set(names) else "pass such a file",
    )
