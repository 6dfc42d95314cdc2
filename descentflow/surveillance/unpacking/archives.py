"""Members of tar archives, read one after the other inside the archive: nothing is written to disk."""

import tarfile
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import IO

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.source_files import COMPANION
from descentflow.surveillance.unpacking.streams import HEAD, Chain, Input

LARGEST_HEADER = 1 << 20
"""Most bytes of the description of a member; a long name has a few hundred."""


def is_tar(head: bytes) -> bool:
    """Test for the first bytes of a tar archive (POSIX or GNU).

    Example:
        >>> is_tar(bytes(257) + b"ustar"), is_tar(b"PAR1")
        (True, False)
    """
    return len(head) <= HEAD and head[257:262] == b"ustar"


def members(source: Input, report: DropReport) -> Iterator[Input]:
    """Files of an archive; each must be read before the next is asked for.

    Links, devices, sparse files and names that lead out of the archive are left out and counted.

    Raises:
        DataError: If the archive is damaged or ends before its end.

    Example:
        >>> with tarfile.open("rows.tar", "w") as archive:
        ...     archive.add("rows.parquet")
        >>> with Path("rows.tar").open("rb") as file:
        ...     print([member.label for member in members(Input(file, "rows.tar"), DropReport())])
        ['rows.tar: rows.parquet']
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
    return "no rows by its name" if COMPANION.search(member.name) else None


class _Forward:
    """A stream that `tarfile` can skip ahead in, but not go back."""

    def __init__(self, stream: IO[bytes], label: str) -> None:
        self._stream, self._label = stream, label
        self._place = 0
        self.at_header = True
        self.last = b""
        """Bytes that were read last while at a header."""

    def read(self, size: int = -1) -> bytes:
        if self.at_header and not 0 <= size <= LARGEST_HEADER:
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
