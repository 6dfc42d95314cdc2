"""Format of files: its name, the test that recognises it, and its reader."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

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
        >>> from descentflow.surveillance.formats.known_formats import FORMATS
        >>> FORMATS["parquet"].recognise(b"PAR1"), FORMATS["parquet"].recognise(b"timestamp,icao24")
        (True, False)
    """

    recognise: Callable[[bytes], bool]
    read: Callable[[Input, DropReport, int], Iterator[Columns]]


@dataclass(frozen=True, kw_only=True)
class TextFormat(FileFormat):
    """A format of text that is no JSON; it is recognised without byte order mark and blanks before it.

    Example:
        >>> from descentflow.surveillance.formats.known_formats import FORMATS
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
        >>> from descentflow.surveillance.formats.known_formats import FORMATS
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
        label: Name of the file in messages.
        first: Whether it is the first part of its file.

    Example:
        >>> Part(pl.DataFrame({"IAS": [250.0]}), Format("my-format"), "rows.dat", first=True).label
        'rows.dat'
    """

    rows: Columns
    format: Format
    label: str
    first: bool
