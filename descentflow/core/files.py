"""Files are written whole or not at all, and what a killed run left half done is taken up by the next one."""

import errno
import os
import re
import shutil
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from descentflow.core.errors import ConfigError, DataError, DescentflowError

LONGEST_NAME = 255
"""Bytes of the longest name of a file that the usual file systems take."""
MAX_WRITERS = 100
"""Runs that may write the same file at the same time."""
LEAST_ROOM = 1 << 16
"""Bytes left on a disk below which a library that could not write is taken to have found it full."""
OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.EFBIG)
"""Error numbers of the system for a file that cannot be written."""
TEMPORARY = re.compile(r"\..+\.descentflow-part\d+(\.|$)", re.DOTALL)
LOCK = ".lock"
"""Ending of the name of a temporary file's lock."""
OF_RUST = re.compile(r"\(os error (\d+)\)")


class Claim:
    """A name that one run has at a time: the lock of another file, which goes when it is let go."""

    def __init__(self, path: Path) -> None:
        self._lock = FileLock(path, is_singleton=False)

    def take(self) -> bool:
        """Lock the file; False if another run has it. A run that is killed lets it go."""
        try:
            self._lock.acquire(blocking=False)
        except Timeout:
            return False
        return True

    def let_go(self) -> None:
        """Remove the file and unlock it, if it is locked."""
        if self._lock.is_locked:
            with suppress(OSError):  # Windows cannot remove it before, and filelock does so after
                Path(self._lock.lock_file).unlink()
            self._lock.release()


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary name in the folder of ``path`` to write to; rename it when the block ends well, else remove it.

    The temporary file is claimed while it is written. A run that is killed leaves it behind, and the next one that
    writes ``path`` removes it; runs that write ``path`` at the same time have one each, and the last one to end is
    what stays.

    Raises:
        DataError: As :func:`check_output`, or if the disk is full or cannot be written.

    Example:
        >>> with whole_file("note.txt") as temporary:
        ...     _ = temporary.write_text("all of it")
        ...     Path("note.txt").exists()
        False
        >>> Path("note.txt").read_text()
        'all of it'
    """
    target = check_output(path)
    if target.is_symlink():
        target = check_output(target.resolve())
    mine = _Temporary(target)
    with _told(target):
        try:
            temporary = mine.begin()
            yield temporary
            temporary.replace(target)
        except BaseException as error:
            is_full = not isinstance(error, OSError) and shutil.disk_usage(target.parent).free < LEAST_ROOM
            if is_full and isinstance(error, Exception):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
            raise
        finally:
            try:
                mine.end()
            finally:  # an interruption may fall into the first
                mine.end()


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write bytes, or a text in UTF-8, to a file, whole or not at all; see :func:`whole_file`.

    Example:
        >>> write_whole("note.txt", "all of it")
        >>> Path("note.txt").read_text()
        'all of it'
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(content if isinstance(content, bytes) else content.encode())


def table_beside(module: str) -> dict[str, Any]:
    """The TOML table that a module has in a file of its own name: texts and numbers that are no code.

    Args:
        module: Its ``__file__``.

    Example:
        >>> from descentflow.measurements import quantity_registry
        >>> table_beside(quantity_registry.__file__)["cas"]["unit"]
        'kt'
    """
    return tomllib.loads(Path(module).with_suffix(".toml").read_text(encoding="utf-8"))


def remove_left(folder: Path, pattern: str = "**/*") -> None:
    """Remove temporary files that killed runs left, and that no run writes again; one that is being written stays."""
    for path in folder.glob(pattern):
        if TEMPORARY.match(path.name):
            _remove_unclaimed(path.with_name(path.name.removesuffix(LOCK)))


class _Temporary:
    """A claimed file in the folder of the target, known step by step: an interruption may fall between any two."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self.path: Path | None = None
        self.claim: Claim | None = None

    def begin(self) -> Path:
        """Name of an empty, claimed file."""
        for number in range(MAX_WRITERS):
            self.path = _temporary(self.target, number)
            self.claim = _claim(self.path)
            if self.claim.take():
                self.path.unlink(missing_ok=True)
                self.path.touch(exist_ok=False)  # a new file, and never what a link planted there points to
                self._remove_others(number + 1)
                return self.path
        self.claim = None
        raise DataError(
            f"{MAX_WRITERS} runs that write {self.target}",
            expected="a few at a time",
            mend="wait, or choose another output",
        )

    def end(self) -> None:
        """Remove what has not been renamed, and let the name go."""
        if self.path is not None and self.claim is not None:
            if self.claim.take():
                self.path.unlink(missing_ok=True)
            self.claim.let_go()
            self.claim = None

    def _remove_others(self, number: int) -> None:
        """Remove what killed runs left that wrote the same file at the same time."""
        while number < MAX_WRITERS:
            path = _temporary(self.target, number)
            if not path.exists() and not path.with_name(path.name + LOCK).exists():
                break
            _remove_unclaimed(path)
            number += 1


def _claim(path: Path) -> Claim:
    return Claim(path.with_name(path.name + LOCK))


def _remove_unclaimed(path: Path) -> None:
    claim = _claim(path)
    if claim.take():
        path.unlink(missing_ok=True)
        claim.let_go()


def _temporary(target: Path, number: int) -> Path:
    """Hidden, and with the target's suffix, from which libraries know the format."""
    mark = f"descentflow-part{number}"
    name = f".{target.stem}.{mark}{target.suffix}"
    if len(os.fsencode(name + LOCK)) > LONGEST_NAME:
        name = f".{sha256(os.fsencode(target.name)).hexdigest()[:16]}.{mark}{target.suffix[:100]}"
    return target.with_name(name)


@contextmanager
def _told(target: Path) -> Iterator[None]:
    """Say of which output the system's answer is."""
    try:
        yield
    except DescentflowError:
        raise
    except Exception as error:  # libraries written in Rust have errors of their own
        place = getattr(error, "filename", None)
        own = not isinstance(place, str) or Path(place).parent == target.parent
        number = system_number(error)
        if number not in OF_THE_DISK or not own:
            raise
        raise DataError(
            f"{target} cannot be written: {os.strerror(number)}",
            expected="room and permission to write there",
            mend="free the disk, or choose another output",
        ) from error


def system_number(error: BaseException) -> int:
    """The system's number of an error, which Polars gives in the text only, and not always as an `OSError`; else 0."""
    named = OF_RUST.search(str(error))
    return (isinstance(error, OSError) and error.errno) or (int(named[1]) if named else 0)


def check_output(path: str | Path) -> Path:
    """Refuse an output that cannot be written, before minutes of work go into it."""
    target = Path(path)
    _check_name(target)
    if not target.parent.is_dir():
        raise DataError(
            f"output {target} in a folder that does not exist",
            expected=f"an existing folder {target.parent}",
            mend="create the folder or choose another output",
        )
    if target.is_dir():
        raise DataError(f"output {target} is a folder", expected="a file name", mend="add a file name to it")
    if target.exists() and not target.is_file():
        raise DataError(f"output {target} is no plain file", expected="a file name", mend="choose another output")
    _check_writable(target, target.resolve().parent, target)
    return target


def check_separate(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """Refuse outputs that are also inputs, or each other."""
    places = [path.resolve() for path in (*outputs, *inputs)]
    if any(places.count(path) > 1 for path in places[: len(outputs)]):
        raise ConfigError(
            f"an output that is also an input or the other output ({', '.join(map(str, outputs))})",
            expected="names of their own for all outputs",
            mend="choose other names",
        )


def check_folder(path: str | Path, *names: str) -> Path:
    """Refuse a folder of outputs that cannot be made or written, before minutes of work go into it."""
    target = Path(path)
    _check_name(target)
    there = next(place for place in (target, *target.absolute().parents) if place.exists())
    if not there.is_dir():
        raise DataError(f"output {there} is a file", expected="a folder", mend="choose another output")
    _check_writable(target, there)
    for name in names if target.is_dir() else ():
        check_output(target / name)
    return target


def _check_writable(target: Path, *places: Path) -> None:
    for place in places:
        if place.exists() and not os.access(place, os.W_OK):
            raise DataError(
                f"output {target}, but {place} may not be written",
                expected="permission to write there",
                mend="change its permissions or choose another output",
            )


def _check_name(target: Path) -> None:
    try:
        str(target).encode()
    except UnicodeEncodeError:
        raise DataError(
            f"output {str(target)!a}", expected="a name in UTF-8", mend="choose a name of letters"
        ) from None
    if not is_name(target):
        raise DataError(
            f"output {str(target)[:40]!r}...",
            expected=f"a name of at most {LONGEST_NAME} bytes without zero bytes",
            mend="choose another name",
        )


def is_name(path: str | os.PathLike[str]) -> bool:
    """Test for a name that the usual file systems can hold; an empty text would be the working directory."""
    try:
        parts = [os.fsencode(part) for part in Path(path).parts] if path != "" else [b"\0"]
    except (TypeError, UnicodeEncodeError):
        return False
    return not any(b"\0" in part or len(part) > LONGEST_NAME for part in parts)
