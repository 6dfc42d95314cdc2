"""Files are written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from descentflow.core.errors import DataError


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary name beside ``path`` to write to; rename it when the block ends well, else remove it.

    Raises:
        DataError: As :func:`check_output`.

    Example:
        >>> with whole_file("note.txt") as temporary:
        ...     _ = temporary.write_text("all of it")
        ...     Path("note.txt").exists()
        False
        >>> Path("note.txt").read_text()
        'all of it'
    """
    target = check_output(path)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes the file private; give it the permissions that open() would have.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def check_output(path: str | Path) -> Path:
    """Refuse an output that cannot be written, before minutes of work go into it.

    Raises:
        DataError: If its folder does not exist or it is itself a folder.

    Example:
        >>> check_output("nowhere/samples.parquet")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: output nowhere/samples.parquet in a folder that does not exist; ...
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise DataError(
            f"output {target} in a folder that does not exist",
            expected=f"an existing folder {target.parent}",
            mend="create the folder or choose another output",
        )
    if target.is_dir():
        raise DataError(f"output {target} is a folder", expected="a file name", mend="add a file name to it")
    return target
