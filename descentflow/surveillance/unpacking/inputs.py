"""Paths to streams of bytes: files of folders, parts of split archives, and members of tar archives.

Nothing is unpacked to disk. A file that cannot be read is an error alone, and a count where there are many.
"""

import re
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import IO

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.streams import (
    HEAD_BYTES,
    Chain,
    Input,
    opened,
    unpacked,
    whole_input,
)

COMPANION_FILE = re.compile(
    r"(^|/)(heatmap|acas)/"
    r"|(^|/)(readme|license|copying|notice|trace_recent_)[^/]*$"
    r"|(^|/)(receiver|stats|airspace|grib_meteo)\.json$"
    r"|(^|/)_(success|metadata|common_metadata|(committed|started)_[^/]*)$",
    re.IGNORECASE,
)
"""Names of what published archives and folders hold beside rows; `trace_recent` repeats the end of `trace_full`;
Spark and Trino leave `_SUCCESS` and the like."""
SPLIT_ARCHIVE = re.compile(
    r"(?P<whole>.+\.(?:tar|tgz|tar\.gz))\.(?!gz$|xz$|lz$|zst$|lzo$)(?P<number>[a-z]{2,3}|\d{2,3})$"
)


def files_of(paths: Sequence[str | Path], accepted: str = "files or folders of rows") -> list[Path]:
    """The files given, and all files of the folders given except hidden ones and companions of published archives."""
    files: list[Path] = []
    # A single name is a sequence, too: of letters.
    for path in map(Path, [paths] if isinstance(paths, str) else paths):
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
            files += [p for p in inside if not COMPANION_FILE.search(p.relative_to(path).as_posix())]
        elif path.is_file():
            files.append(path)
        else:
            raise DataError(f"no file or folder {path}", expected="one that is there", mend="check the path")
    if not files:
        raise DataError("no file in the folders given", expected=accepted, mend="pass files, or folders that hold some")
    return files


def with_parts(files: Sequence[Path]) -> list[tuple[str, list[Path]]]:
    """Files, with the parts of each split archive together (`split` names them .aa .ab ..., others .001 .002 ...)."""
    groups: dict[str, list[Path]] = {}
    for file in files:
        part = SPLIT_ARCHIVE.match(str(file))
        groups.setdefault(part["whole"] if part else str(file), []).append(file)
    found: list[tuple[str, list[Path]]] = []
    for name, together in groups.items():
        if not SPLIT_ARCHIVE.match(str(together[0])):
            found += [(name, [file]) for file in together]
            continue
        parts = [file for file, _ in groupby(sorted(together))]
        numbers = [_number(str(file)) for file in parts]
        first = 1 if str(parts[0])[-1].isdecimal() else 0
        if numbers[0] > first or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            raise DataError(
                f"parts {', '.join(file.name for file in parts)} of a split archive, but not those between or before",
                expected="all parts from the first",
                mend="pass the folder that holds them all",
            )
        found.append((name, parts))
    return found


def _number(part: str) -> int:
    suffix = part.rpartition(".")[2]
    if suffix.isdecimal():
        return int(suffix)
    number = 0
    for letter in suffix:
        number = 26 * number + ord(letter) - ord("a")
    return number


MAX_TAR_HEADER_BYTES = 1 << 20
"""Most bytes of the description of a member; a long name has a few hundred."""


def is_tar(head: bytes) -> bool:
    """Test for the first bytes of a tar archive (POSIX or GNU)."""
    return len(head) <= HEAD_BYTES and head[257:262] == b"ustar"


def members(source: Input, report: DropReport) -> Iterator[Input]:
    """Files of an archive; each must be read before the next is asked for.

    Links, devices, sparse files and names that lead out of the archive are left out and counted.
    """
    stream = _Forward(source.stream, source.label)
    try:
        archive = tarfile.open(fileobj=stream, mode="r:")  # type: ignore[call-overload]  # noqa: SIM115
        stream.at_header = True
        while (member := archive.next()) is not None:
            stream.at_header = False
            archive.members.clear()  # else it would remember all of them
            reason = _left_out(member)
            if reason:
                report.note(f"members of archives left out: {reason}", 1)
            elif not member.isdir():
                content = archive.extractfile(member)
                assert content is not None
                # It says that it can seek, but must not go back.
                yield Input(Chain([content]).buffered(), f"{source.label}: {member.name}", one_of_many=True)
            stream.at_header = True
    except (tarfile.TarError, ValueError, OverflowError, EOFError) as error:
        raise _damaged(source.label, str(error)) from error
    if stream.last.strip(b"\0"):
        # tarfile takes a damaged or missing header for the end.
        raise _damaged(source.label, "no end of archive")


def _damaged(label: str, reason: str) -> DataError:
    return DataError(
        f"{label}: damaged or cut archive ({reason})",
        expected="a whole tar archive",
        mend="copy it again; pass all parts (.tar.aa, .tar.ab, ...) if it is split",
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


class _Forward:
    """A stream that `tarfile` can skip ahead in, but not go back."""

    def __init__(self, stream: IO[bytes], label: str) -> None:
        self._stream, self._label = stream, label
        self._place = 0
        self.at_header = True
        self.last = b""
        """Bytes that were read last while at a header."""

    def read(self, size: int = -1) -> bytes:
        if self.at_header and not 0 <= size <= MAX_TAR_HEADER_BYTES:
            raise _damaged(self._label, f"a header of {size:,} bytes")
        content = self._stream.read(size)
        self._place += len(content)
        if self.at_header:
            self.last = content or b"nothing"
        return content

    def tell(self) -> int:
        return self._place

    def seek(self, place: int, whence: int = 0) -> int:
        if whence or place < self._place:
            raise _damaged(self._label, "it leads backwards")
        while self._place < place:
            skipped = len(self._stream.read(min(place - self._place, 1 << 20)))
            if not skipped:
                break
            self._place += skipped
        return self._place

    def seekable(self) -> bool:
        return True


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


EMPTY_FILES = "empty files (0 bytes) beside others, left out"
"""Note in the report."""


def inputs(files: Sequence[Path], report: DropReport, unreadable: Unreadable) -> Iterator[Input]:
    """Files one after the other, and the members of those that are archives.

    Each must be read before the next is asked for, and is closed then. An empty one of several is left out and counted.
    """
    sources = with_parts(files)
    for label, parts in sources:
        with opened(parts, label) as source:
            of_tree = len(sources) > 1 and parts[0].name.startswith("trace_full_")
            source = replace(source, one_of_many=of_tree)
            try:
                head, whole = unpacked(source).head()
            except DataError as error:
                unreadable.count(error, source)
                continue
            if not head and len(sources) > 1:
                report.note(EMPTY_FILES, 1)
                continue
            if is_tar(head):
                yield from members(whole, report)
            else:
                yield whole
