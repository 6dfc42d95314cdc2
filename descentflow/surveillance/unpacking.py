"""Paths to streams of bytes: files of folders and members of tar archives.

Nothing is unpacked to disk. A file that cannot be read is an error alone, and a count where there are many.
"""

import gzip
import io
import os
import re
import tarfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tarfile import TarError
from typing import Any, NoReturn

import polars as pl

from descentflow.core.errors import DataError, check_utf8
from descentflow.surveillance.rows.drop_report import DropReport

HEAD_BYTES = 4096
"""First bytes of a file, from which its format is recognised."""
GZIP = b"\x1f\x8b"
"""First bytes of gzip."""
MAX_LINE_BYTES = 64 << 20
"""Most bytes of one line; a snapshot of all aircraft of the world has about 10 MB."""
MAX_BLANK_LINES = 1_000_000
"""Most blank lines in a row: 300 kB of gzip can hold 300 million."""
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
        number = last = 0
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
                last = number
            elif number - last > MAX_BLANK_LINES:
                raise DataError(
                    f"{self.label}, line {number}: more than {MAX_BLANK_LINES:,} blank lines in a row",
                    expected="one row or JSON document a line",
                    mend="check how the file was written",
                )


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


COMPANION_FILE = re.compile(
    r"(^|/)(heatmap|acas)/"
    r"|(^|/)(readme|license|copying|notice|trace_recent_)[^/]*$"
    r"|(^|/)(receiver|stats|airspace|grib_meteo)\.json$"
    r"|(^|/)_(success|metadata|common_metadata|(committed|started)_[^/]*)$",
    re.IGNORECASE,
)
"""Names of what published archives and folders hold next to rows; `trace_recent` repeats the end of `trace_full`;
Spark and Trino leave `_SUCCESS` and the like."""


def _unlisted(error: OSError) -> NoReturn:
    raise DataError(
        f"{error.filename}: {error.strerror}",
        expected="a folder whose files may be listed",
        mend="change its permissions, or pass the folders next to it",
    ) from error


def files_of(paths: Sequence[str | Path], accepted: str = "files or folders of rows") -> list[Path]:
    """The files given, and all files of the folders given except hidden ones and companions of published archives."""
    files: list[Path] = []
    # A single name is a sequence, too: of letters.
    for path in map(Path, [paths] if isinstance(paths, str) else paths):
        if path.is_dir():
            # Path.rglob leaves out a folder that may not be listed, without a word.
            walked = os.walk(path, onerror=_unlisted)
            inside = sorted(Path(folder, name) for folder, _, names in walked for name in names if name[0] != ".")
            inside = [p for p in inside if p.is_file()]
            files += [p for p in inside if not COMPANION_FILE.search(p.relative_to(path).as_posix())]
        elif path.is_file():
            files.append(path)
        else:
            raise DataError(f"no file or folder {path}", expected="one that is there", mend="check the path")
    if not files:
        raise DataError("no file in the folders given", expected=accepted, mend="pass files, or folders that hold some")
    check_utf8(map(str, files))
    return files


MAX_TAR_HEADER_BYTES = 1 << 20
"""Most bytes of the description of a member; a long name has a few hundred."""
DESCRIBING_MEMBERS = (
    tarfile.XHDTYPE,
    tarfile.XGLTYPE,
    tarfile.SOLARIS_XHDTYPE,
    tarfile.GNUTYPE_LONGNAME,
    tarfile.GNUTYPE_LONGLINK,
)
"""Types of members that describe the next one, and are held in memory."""


def is_tar(head: bytes) -> bool:
    """Test for the first bytes of a tar archive (POSIX or GNU)."""
    return len(head) <= HEAD_BYTES and head[257:262] == b"ustar"


class _Member(tarfile.TarInfo):
    """A member of an archive whose damage is an error: tarfile takes it for the end of the archive."""

    @classmethod
    def fromtarfile(cls, archive: tarfile.TarFile) -> "_Member":
        try:
            return super().fromtarfile(archive)
        except tarfile.EOFHeaderError:  # type: ignore[attr-defined]  # not in typeshed: the blocks of zeros at the end
            raise
        except tarfile.HeaderError as error:
            raise tarfile.ReadError(str(error)) from error

    @classmethod
    def frombuf(cls, header: bytes | bytearray, encoding: str, errors: str) -> "_Member":
        member = super().frombuf(header, encoding, errors)
        if member.type in DESCRIBING_MEMBERS and member.size > MAX_TAR_HEADER_BYTES:
            raise tarfile.ReadError(f"a header of {member.size:,} bytes")
        return member


def members(source: Input, report: DropReport) -> Iterator[Input]:
    """Files of an archive; each must be read before the next is asked for.

    Links, devices, sparse files and names that lead out of the archive are left out and counted.
    """
    try:
        archive = tarfile.open(fileobj=source.stream, mode="r|", bufsize=1 << 18, tarinfo=_Member)  # noqa: SIM115
        while member := archive.next():
            archive.members = []  # type: ignore[attr-defined]  # else it would remember all of them
            reason = _left_out(member)
            if reason:
                report.note(f"members of archives left out: {reason}", 1)
            elif content := archive.extractfile(member):
                yield Input(content, f"{source.label}: {member.name}", one_of_many=True)  # type: ignore[arg-type]
    except (tarfile.TarError, ValueError, OverflowError, EOFError) as error:
        raise _damaged(source.label, str(error)) from error


def _damaged(label: str, reason: str) -> DataError:
    return DataError(
        f"{label}: damaged or cut archive ({reason})",
        expected="a whole tar archive",
        mend="copy it again; put the parts of a split one together (cat NAME.tar.* > NAME.tar)",
    )


def _left_out(member: tarfile.TarInfo) -> str | None:
    """Reason to leave a member out."""
    if member.isdir():
        return None
    if not member.isreg() or member.issparse():
        return "link, device or sparse file"
    name = PurePosixPath(member.name)
    if name.is_absolute() or ".." in name.parts:
        return "name that leads out of the archive"
    if name.name.startswith("."):
        return "hidden file"
    return "no rows by its name" if COMPANION_FILE.search(member.name) else None


class Unreadable:
    """Counts the unreadable files of one reading, and keeps the first error in case nothing else is found."""

    def __init__(self, report: DropReport) -> None:
        self.first_error: DataError | None = None
        self._report = report

    def count(self, error: DataError, source: Input) -> None:
        """Count a file if it is one of many."""
        if not source.one_of_many:
            raise error
        self.first_error = self.first_error or error
        self._report.note("traces and members of archives that could not be read", 1)

    @contextmanager
    def watch(self, source: Input) -> Iterator[None]:
        """Read a file inside of this: what readers do not foresee becomes a DataError that names it and is counted."""
        try:
            with whole_input(source.label):
                yield
        except DataError as error:
            self.count(error, source)


EMPTY_FILES = "empty files (0 bytes) besides others, left out"
"""Note in the report."""


def inputs(files: Sequence[Path], report: DropReport, unreadable: Unreadable) -> Iterator[Input]:
    """Files one after the other, and the members of those that are archives.

    Each must be read before the next is asked for, and is closed then. An empty one of several is left out and counted.
    """
    for file in files:
        with opened(file) as source:
            source = replace(source, one_of_many=len(files) > 1 and file.name.startswith("trace_full_"))
            with unreadable.watch(source):
                plain = unpacked(source)
                head = plain.head()
                if not head and len(files) > 1:
                    report.note(EMPTY_FILES, 1)
                elif is_tar(head):
                    yield from members(plain, report)
                else:
                    yield plain
