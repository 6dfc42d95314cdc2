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
TRUE, FALSE, BYTE, SHORT, INT, LONG, DOUBLE, BINARY, LIST, SET, _, STRUCT = range(1, 13)
"""Types of Thrift's compact protocol, in which Parquet describes its data; it has no maps."""
DEEPEST = 32
"""Structures and lists inside each other; Parquet's own are six deep."""

Bytes = bytes | mmap.mmap
Fields = dict[int, Any]


def check_pages(source: Path | bytes) -> None:
    """Refuse a Parquet file in which a page has a negative number of values or bytes.

    Polars (2.1 too) takes such a number for one near 2^64, asks for so much memory and ends the process by a signal,
    which no caller can catch. pyarrow raises an error in its place and reads as fast, but is 170 MB for this
    alone. Only the headers of the pages are read, some 100 bytes of each megabyte; the format is that of
    `parquet.thrift` in Apache Parquet.
    """
    with _content(source) as content:
        if len(content) < len(MAGIC) + TAIL or content[-len(MAGIC) :] != MAGIC:
            raise DamagedParquetError("Parquet without its end")
        footer = len(content) - TAIL - int.from_bytes(content[-TAIL : -len(MAGIC)], "little")
        try:
            if footer < len(MAGIC):
                raise DamagedParquetError("a footer longer than the file")
            for group in _Thrift(content, footer).value()[4]:
                for chunk in group[1]:
                    if 3 in chunk:
                        _check_column(content, chunk[3])
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise DamagedParquetError("a part of it that describes its pages cannot be read") from error


class DamagedParquetError(OSError):
    """A Parquet file that cannot be read as one."""


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


def _check_column(content: Bytes, column: Fields) -> None:
    """Go from page to page until all values of the column have been seen."""
    values, size = column[5], column[7]
    places = [place for place in (column[9], column.get(11, 0)) if place > 0]
    if values < 0 or size < 0 or not places:
        raise DamagedParquetError("a column with a negative number of values or bytes")
    place = min(places)
    end, seen = place + size, 0
    while seen < values and place < end:
        reader = _Thrift(content, place)
        header = reader.value()
        counts = [
            header[kind][field] for kind, fields in COUNTS_OF_A_PAGE.items() if kind in header for field in fields
        ]
        if min((*counts, *(header[field] for field in SIZES_OF_A_PAGE))) < 0:
            raise DamagedParquetError(f"the page at byte {place} has a negative number of values or bytes")
        seen += sum(header[kind][1] for kind in (5, 8) if kind in header)
        place = reader.place + header[3]


class _Thrift:
    """Reader of Thrift's compact protocol, from a place in the content on."""

    def __init__(self, content: Bytes, place: int) -> None:
        self.content, self.place = content, place

    def value(self, kind: int = STRUCT, depth: int = 0) -> Any:
        """A value of a kind: of a structure its fields by their numbers."""
        if depth > DEEPEST:
            raise ValueError
        if kind in (SHORT, INT, LONG):
            return _signed(self._varint())
        if kind in (LIST, SET):
            head = self._byte()
            values = []
            for _ in range(head >> 4 if head >> 4 < 15 else self._varint()):
                if self.place >= len(self.content):
                    raise IndexError
                values.append(self.value(head & 15, depth + 1))
            return values
        if kind == STRUCT:
            fields: Fields = {}
            number = 0
            while head := self._byte():
                own = head & 15
                number = number + (head >> 4) if head >> 4 else _signed(self._varint())
                fields[number] = own == TRUE if own in (TRUE, FALSE) else self.value(own, depth + 1)
            return fields
        # Names, statistics and flags are of no interest here.
        length = self._varint() if kind == BINARY else {TRUE: 1, FALSE: 1, BYTE: 1, DOUBLE: 8}[kind]
        self.place += length
        return None

    def _varint(self) -> int:
        value = shift = 0
        while (byte := self._byte()) & 128:
            value |= (byte & 127) << shift
            shift += 7
            if shift > 63:
                raise ValueError
        return value | byte << shift

    def _byte(self) -> int:
        self.place += 1
        return self.content[self.place - 1]


def _signed(value: int) -> int:
    """A signed number, written as 0, -1, 1, -2 and so on."""
    return (value >> 1) ^ -(value & 1)
