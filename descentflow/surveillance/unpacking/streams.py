"""Bytes of files, unpacked as they are read and never to disk."""

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tarfile import TarError
from typing import Any

import polars as pl

from descentflow.core.errors import DataError

HEAD_BYTES = 4096
"""First bytes of a file, from which its format is recognised."""
GZIP = b"\x1f\x8b"
"""First bytes of gzip."""
MAX_LINE_BYTES = 64 << 20
"""Most bytes of one line; a snapshot of all aircraft of the world has about 10 MB."""
MAX_DOCUMENT_BYTES = 128 << 20
"""Most bytes of what has to be read as a whole: a JSON document of many lines, a table inside an archive."""


@dataclass(frozen=True)
class Input:
    """One file or member of an archive, as readers get it.

    Attributes:
        stream: Its bytes, without the gzip around them.
        label: Its name in messages.
        path: The file, where it is one on disk that can be read at any place.
        one_of_many: Whether it is a member of an archive or one of many traces: then a damaged one is counted and no
            error, as users cannot be asked to remove it.
        columns: Columns that are read besides those whose names are known, for the user has named them.
    """

    stream: io.BufferedReader
    label: str
    path: Path | None = None
    one_of_many: bool = False
    columns: tuple[str, ...] = ()

    def head(self) -> bytes:
        """The first bytes, which stay to be read."""
        return self.stream.peek(HEAD_BYTES)[:HEAD_BYTES]

    def whole(self) -> bytes:
        """All bytes, if they are not too many to be held."""
        content = self.stream.read(MAX_DOCUMENT_BYTES + 1)
        if len(content) > MAX_DOCUMENT_BYTES:
            raise DataError(
                f"{self.label}: more than {MAX_DOCUMENT_BYTES >> 20} MiB that have to be read as a whole",
                expected="a smaller document, or one document a line",
                mend="split the file, or unpack the archive that it is in",
            )
        return content

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """Lines that are not blank, with their numbers."""
        number = 0
        while line := self.stream.readline(MAX_LINE_BYTES + 1):
            number += 1
            if len(line) > MAX_LINE_BYTES:
                raise DataError(
                    f"{self.label}, line {number}: longer than {MAX_LINE_BYTES >> 20} MiB",
                    expected="one row or JSON document a line",
                    mend="check how the file was written",
                )
            if line.strip():
                yield number, line


@contextmanager
def opened(path: Path) -> Iterator[Input]:
    """Open a file; closed when the block ends."""
    try:
        stream = path.open("rb")
    except FileNotFoundError as error:
        raise DataError(f"no file {path}", expected="one that is there", mend="check the path") from error
    except OSError as error:
        raise DataError(f"{path}: {error}", expected="a readable file", mend="check its permissions") from error
    with stream:
        yield Input(stream, str(path), path)


def unpacked(packed: Input) -> Input:
    """Take the gzip away, if there is any."""
    if not packed.head().startswith(GZIP):
        return packed
    stream: Any = io.BufferedReader(gzip.GzipFile(fileobj=packed.stream), 1 << 18)
    plain = replace(packed, stream=stream, path=None)
    if plain.head().startswith(GZIP):
        raise DataError(f"{packed.label}: gzip inside gzip", expected="one layer", mend="unpack the outer one")
    return plain


@contextmanager
def whole_input(label: object, expected: str = "a whole, readable file", mend: str = "copy it again") -> Iterator[None]:
    """Read a file inside of this: what a library does not foresee becomes a DataError that names the file."""
    try:
        yield
    except (pl.exceptions.PolarsError, OSError, EOFError, zlib.error, TarError) as error:
        raise _unreadable_file(label, error, expected, mend) from error
    except BaseException as error:
        # Polars and the decoder of Mode S panic on some damage; this is no Exception.
        if type(error).__name__ != "PanicException":
            raise
        raise _unreadable_file(label, error, expected, mend) from error


def _unreadable_file(label: object, error: BaseException, expected: str, mend: str) -> DataError:
    reason = (str(error).splitlines() or [type(error).__name__])[0][:300]
    return DataError(f"{label}: {reason}", expected=expected, mend=mend)
