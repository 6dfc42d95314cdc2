"""Paths to streams of bytes: files of folders and members of tar archives.

Nothing is unpacked to disk. A file that cannot be read is an error alone, and a count where there are many.
"""

import re
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.streams import (
    HEAD_BYTES,
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


EMPTY_FILES = "empty files (0 bytes) beside others, left out"
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
