"""Bytes of files and of split archives, unpacked as they are read and never to disk."""

import gzip
import io
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tarfile import TarError
from typing import IO

import polars as pl

from descentflow.core.errors import DataError

HEAD_BYTES = 4096
"""First bytes of a file, from which its format is recognised."""
MAX_GZIP_RATIO = 250
"""Unpacked bytes per packed byte above which gzip is taken for a bomb: surveillance text packs to a tenth, repeated
lines to a fiftieth; deflate reaches 1,032 for one repeated byte."""
GZIP_CHECKED_BYTES = 16 << 20
"""Unpacked bytes below which the ratio is not checked: they fit in memory in any case."""
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

    stream: IO[bytes]
    label: str
    path: Path | None = None
    one_of_many: bool = False
    columns: tuple[str, ...] = ()

    def head(self) -> tuple[bytes, "Input"]:
        """The first bytes, and the input with them in place again."""
        head = self.stream.read(HEAD_BYTES)
        if self.stream.seekable():
            self.stream.seek(-len(head), io.SEEK_CUR)
            return head, self
        return head, replace(self, stream=Chain([io.BytesIO(head), self.stream]).buffered())

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


class Chain(io.RawIOBase):
    """Streams one after the other, read forwards.

    Example:
        >>> Chain([io.BytesIO(b"one "), io.BytesIO(b"archive")]).buffered().read()
        b'one archive'
    """

    def __init__(self, streams: Sequence[IO[bytes]]) -> None:
        self._streams = list(streams)
        self._place = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, buffer: object) -> int:
        """Fill a buffer from the first stream that has bytes left."""
        view = memoryview(buffer)  # type: ignore[arg-type]
        while self._streams:
            content = self._streams[0].read(len(view))
            if content:
                view[: len(content)] = content
                self._place += len(content)
                return len(content)
            self._streams.pop(0)
        return 0

    def buffered(self) -> io.BufferedReader:
        """With a buffer, for small reads."""
        return io.BufferedReader(self, 1 << 18)


class _Gunzip(io.RawIOBase):
    """Unpacked bytes of a gzip stream, refused if they are out of proportion to the packed ones."""

    def __init__(self, packed: IO[bytes], label: str) -> None:
        self._packed = _Counted(packed)
        self._unpacked = gzip.GzipFile(fileobj=self._packed)  # type: ignore[call-overload]
        self._label = label
        self._out = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, buffer: object) -> int:
        """Unpack into a buffer."""
        view = memoryview(buffer)  # type: ignore[arg-type]
        try:
            content: bytes = self._unpacked.read(len(view))
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise DataError(
                f"{self._label}: damaged gzip ({error})", expected="a whole file", mend="copy it again"
            ) from error
        view[: len(content)] = content
        self._out += len(content)
        if self._out > GZIP_CHECKED_BYTES and self._out > MAX_GZIP_RATIO * self._packed.count:
            raise DataError(
                f"{self._label}: gzip that unpacks to more than {MAX_GZIP_RATIO} times its size",
                expected="surveillance data, which packs to a tenth or so",
                mend="check where the file comes from; unpack it first if it is to be trusted",
            )
        return len(content)


class _Counted:
    """A stream that knows how many bytes were read from it."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self.count = 0

    def read(self, size: int = -1) -> bytes:
        content = self._stream.read(size)
        self.count += len(content)
        return content


@contextmanager
def opened(paths: Sequence[Path], label: str) -> Iterator[Input]:
    """Open a file, or the parts of a split one; closed when the block ends."""
    with ExitStack() as files:
        try:
            streams = [files.enter_context(path.open("rb")) for path in paths]
        except FileNotFoundError as error:
            raise DataError(f"no file {label}", expected="one that is there", mend="check the path") from error
        except OSError as error:
            raise DataError(f"{label}: {error}", expected="a readable file", mend="check its permissions") from error
        if len(streams) == 1:
            yield Input(streams[0], label, paths[0])
        else:
            yield Input(Chain(streams).buffered(), label)


def unpacked(packed: Input) -> Input:
    """Take the gzip away, if there is any."""
    head, packed = packed.head()
    if not head.startswith(b"\x1f\x8b"):
        return packed
    stream = io.BufferedReader(_Gunzip(packed.stream, packed.label), 1 << 18)
    head, plain = replace(packed, stream=stream, path=None).head()
    if head.startswith(b"\x1f\x8b"):
        raise DataError(f"{packed.label}: gzip inside gzip", expected="one layer", mend="unpack the outer one")
    return plain


@contextmanager
def whole_input(label: object, expected: str = "a whole, readable file", mend: str = "copy it again") -> Iterator[None]:
    """Read a file inside of this: what a library does not foresee becomes a DataError that names the file."""
    try:
        yield
    except (pl.exceptions.PolarsError, OSError, TarError) as error:
        raise _unreadable_file(label, error, expected, mend) from error
    except BaseException as error:
        # Polars and the decoder of Mode S panic on some damage; this is no Exception.
        if type(error).__name__ != "PanicException":
            raise
        raise _unreadable_file(label, error, expected, mend) from error


def _unreadable_file(label: object, error: BaseException, expected: str, mend: str) -> DataError:
    reason = (str(error).splitlines() or [type(error).__name__])[0][:300]
    return DataError(f"{label}: {reason}", expected=expected, mend=mend)
