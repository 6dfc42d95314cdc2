"""The table of formats: to add a source of rows, write its file in this folder and enter it here."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError
from descentflow.surveillance.formats import aircraft_json, asterix, json_rows, mode_s, readsb_trace, scat, tables
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.streams import Input

Columns = Any
"""A polars table with the columns as the format names them, or something that :attr:`Format.join` makes one of."""


@dataclass(frozen=True)
class Format:
    """A format of surveillance rows.

    Attributes:
        name: As `--format` takes it.
        any_columns: Whether anybody may have made such tables, so that the names and units of every file have to be
            checked. Other formats have fixed columns, and their small files are put together.
        join: Makes one table of several parts, where :func:`polars.concat` does not.

    Example:
        >>> Format("my-format").any_columns
        False
    """

    name: str
    any_columns: bool = False
    join: Callable[[Sequence[Columns], DropReport], pl.DataFrame] | None = None


@dataclass(frozen=True, kw_only=True)
class FileFormat(Format):
    """A format that is recognised by its first bytes.

    Attributes:
        recognise: Whether a file that begins with these bytes is of the format.
        read: Tables of about so many rows from a stream; what cannot be read is counted in the report.

    Example:
        >>> FORMATS["parquet"].recognise(b"PAR1"), FORMATS["parquet"].recognise(b"timestamp,icao24")
        (True, False)
    """

    recognise: Callable[[bytes], bool]
    read: Callable[[Input, DropReport, int], Iterator[Columns]]


@dataclass(frozen=True, kw_only=True)
class TextFormat(FileFormat):
    """A format of text that is no JSON; it is recognised without byte order mark and blanks before it.

    Example:
        >>> lines = FORMATS["modes-hex"]
        >>> isinstance(lines, TextFormat), lines.recognise(b"1700000000.5 a00004128f39f91a7e27c46adc21")
        (True, True)
    """


@dataclass(frozen=True, kw_only=True)
class JsonFormat(Format):
    """A format of JSON documents, recognised by the first of them.

    Attributes:
        recognise: Whether a file whose first document is this one is of the format.
        read: Tables of about so many rows from the documents of a file with that label.

    Example:
        >>> FORMATS["aircraft-json"].recognise({"now": 1.7e9, "aircraft": []})
        True
    """

    recognise: Callable[[object], bool]
    read: Callable[[Iterator[object], str, DropReport, int], Iterator[Columns]]


@dataclass(frozen=True)
class Part:
    """Some rows of one file, with the columns as its format names them.

    Attributes:
        rows: A table, or what the format's `join` makes one of.
        format: Of the file.
        label: Name of the (first) file in messages.
        first: Whether it is the first part of its file.
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
    FileFormat("parquet", any_columns=True, recognise=tables.is_parquet, read=tables.parquet),
    FileFormat("feather", any_columns=True, recognise=tables.is_feather, read=tables.feather),
    TextFormat("csv", any_columns=True, recognise=bool, read=tables.csv),
    JsonFormat("json-rows", any_columns=True, recognise=json_rows.is_rows, read=json_rows.rows),
    JsonFormat("readsb-trace", join=readsb_trace.joined, recognise=readsb_trace.is_trace, read=readsb_trace.rows),
    JsonFormat("aircraft-json", recognise=aircraft_json.is_snapshot, read=aircraft_json.rows),
    JsonFormat("jet1090", recognise=mode_s.is_message, read=mode_s.jet1090),
    TextFormat("modes-hex", recognise=mode_s.begins_with_frames, read=mode_s.lines),
    JsonFormat("scat", recognise=scat.is_flight, read=scat.rows),
    FileFormat("asterix", recognise=asterix.is_asterix, read=asterix.rows),
)
"""The formats. They are tried in this order, but those of any columns after all others: what they recognise is least
specific."""
FORMATS = {one.name: one for one in KNOWN_FORMATS}
"""Name -> format; each is also read from gzip and tar archives."""
HELD_TABLE = Format("table", any_columns=True)
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


def put_together(parts: Iterator[Part], report: DropReport, block_rows: int) -> Iterator[Part]:
    """Tables of the parts, in their order: one for each part of any columns, else one for many small parts."""
    waiting: list[Part] = []
    for part in parts:
        if waiting and (part.format.any_columns or not _belongs(part, waiting, block_rows)):
            table, waiting = _joined(waiting, report), []
            yield table
        if part.format.any_columns:
            yield part
        else:
            waiting.append(part)
    if waiting:
        yield _joined(waiting, report)


def _joined(parts: Sequence[Part], report: DropReport) -> Part:
    rows: list[Columns] = [part.rows for part in parts]
    join = parts[0].format.join
    return replace(parts[0], rows=join(rows, report) if join else pl.concat(rows), first=True)


def _belongs(part: Part, waiting: Sequence[Part], block_rows: int) -> bool:
    """Test for a part that can be joined with those that wait, by format and number of rows."""
    count = sum(len(one.rows) for one in waiting)
    if part.format.join is not waiting[0].format.join:
        return False
    if part.format.join:
        return count < MAX_HELD_POINTS
    return part.rows.schema == waiting[0].rows.schema and count < block_rows and len(waiting) < MAX_JOINED_TABLES
