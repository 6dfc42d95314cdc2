"""Pages of Parquet files, looked at before Polars reads them: a damaged count in one would end the whole process."""

import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

MAGIC = b"PAR1"
TAIL = 8
"""Bytes behind the footer: its length (4) and the magic word."""
COUNTS_OF_A_PAGE = {5: (1,), 7: (1,), 8: (1, 2, 3, 5, 6)}
"""Kind of page by its field in the page header (data, dictionary, data of version 2) -> its fields that count."""
SIZES_OF_A_PAGE = (2, 3)
TRUE, FALSE, BYTE, SHORT, INT, LONG, DOUBLE, BINARY, LIST, SET, MAP, STRUCT = range(1, 13)
"""Types of Thrift's compact protocol, in which Parquet writes what describes its data."""
DEEPEST = 32
"""Structures and lists inside each other; Parquet's own are six deep."""

Bytes = bytes | mmap.mmap
Fields = dict[int, Any]


def check_pages(source: Path | bytes) -> None:
    """Refuse a Parquet file in which a page has a negative number of values or bytes.

    Polars takes such a number for one near 2^64, asks for so much memory and ends the process by a signal, which no
    caller can catch. Only the headers of the pages are read, some 100 bytes of each megabyte; the format is that of
    `parquet.thrift` in Apache Parquet.

    Args:
        source: The file, or its content.

    Raises:
        DamagedParquetError: If the file is damaged there, or is no Parquet file; as an OSError, which
            :func:`~descentflow.surveillance.unpacking.unreadable.whole_input` makes a message of.

    Example:
        >>> check_pages(Path("rows.parquet"))
        >>> check_pages(Path("rows.parquet").read_bytes()[:1000])
        Traceback (most recent call last):
        ...
        descentflow.core.parquet_pages.DamagedParquetError: Parquet without its end
    """
    with _content(source) as content:
        if len(content) < len(MAGIC) + TAIL or content[-len(MAGIC) :] != MAGIC:
            raise DamagedParquetError("Parquet without its end")
        footer = len(content) - TAIL - int.from_bytes(content[-TAIL : -len(MAGIC)], "little")
        try:
            for column in _columns(content, footer):
                _check_column(content, column)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise DamagedParquetError("a part of it that describes its pages cannot be read") from error


class DamagedParquetError(OSError):
    """A Parquet file that cannot be read as one.

    Example:
        >>> check_pages(b"PAR1")
        Traceback (most recent call last):
        ...
        descentflow.core.parquet_pages.DamagedParquetError: Parquet without its end
    """


@contextmanager
def _content(source: Path | bytes) -> Iterator[Bytes]:
    if isinstance(source, bytes):
        yield source
        return
    with source.open("rb") as file:
        if source.stat().st_size == 0:
            raise DamagedParquetError("an empty file")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            yield content


def _columns(content: Bytes, footer: int) -> Iterator[Fields]:
    """Description of each column of each group of rows."""
    if footer < len(MAGIC):
        raise DamagedParquetError("a footer longer than the file")
    about, _ = _struct(content, footer)
    for group in about[4]:
        for chunk in group[1]:
            if 3 in chunk:
                yield chunk[3]


def _check_column(content: Bytes, column: Fields) -> None:
    """Go from page to page until all values of the column have been seen."""
    values, size = column[5], column[7]
    places = [place for place in (column[9], column.get(11, 0)) if place > 0]
    if values < 0 or size < 0 or not places:
        raise DamagedParquetError("a column with a negative number of values or bytes")
    place = min(places)
    end, seen = place + size, 0
    while seen < values and place < end:
        header, behind = _struct(content, place)
        counts = [
            (header[kind][field]) for kind, fields in COUNTS_OF_A_PAGE.items() if kind in header for field in fields
        ]
        if min((*counts, *(header[field] for field in SIZES_OF_A_PAGE))) < 0:
            raise DamagedParquetError(f"the page at byte {place} has a negative number of values or bytes")
        seen += sum(header[kind][1] for kind in (5, 8) if kind in header)
        place = behind + header[3]


def _struct(content: Bytes, place: int, depth: int = 0) -> tuple[Fields, int]:
    """Fields of a structure by their numbers, and the place behind it."""
    fields: Fields = {}
    number = 0
    while head := content[place]:
        place += 1
        kind = head & 15
        if head >> 4:
            number += head >> 4
        else:
            number, place = _integer(content, place)
        if kind in (TRUE, FALSE):
            fields[number] = kind == TRUE
        else:
            fields[number], place = _value(content, place, kind, depth)
    return fields, place + 1


def _value(content: Bytes, place: int, kind: int, depth: int) -> tuple[Any, int]:
    if depth > DEEPEST:
        raise ValueError
    if kind in (SHORT, INT, LONG):
        return _integer(content, place)
    if kind == BINARY:  # names and statistics: of no interest here
        length, place = _varint(content, place)
        return None, place + length
    if kind in (LIST, SET):
        return _list(content, place, depth + 1)
    if kind == STRUCT:
        return _struct(content, place, depth + 1)
    if kind in (TRUE, FALSE, BYTE):  # elements of lists; a field that is true or false has no value
        return None, place + 1
    if kind == DOUBLE:
        return None, place + 8
    raise ValueError  # Parquet has no maps


def _list(content: Bytes, place: int, depth: int) -> tuple[list[Any], int]:
    head = content[place]
    length, place = (head >> 4, place + 1) if head >> 4 < 15 else _varint(content, place + 1)
    found = []
    for _ in range(length):
        if place >= len(content):
            raise IndexError
        value, place = _value(content, place, head & 15, depth)
        found.append(value)
    return found, place


def _varint(content: Bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while (byte := content[place]) & 128:
        value |= (byte & 127) << shift
        shift += 7
        place += 1
        if shift > 63:
            raise ValueError
    return value | byte << shift, place + 1


def _integer(content: Bytes, place: int) -> tuple[int, int]:
    """A signed number, written as 0, -1, 1, -2, ..."""
    value, place = _varint(content, place)
    return (value >> 1) ^ -(value & 1), place
