"""Files elsewhere by fsspec (`s3://`, `gs://`, `https://`): copies of inputs are read, outputs are written and sent."""

import re
import shutil
import weakref
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from descentflow.core.errors import ConfigError, DataError

R = TypeVar("R")
ADDRESS = re.compile(r"([a-z][a-z0-9+]+):/+(?=[^/])")
"""Begin of an address; a `Path` of one has a single slash."""
COPIES_FOLDER = ".descentflow-remote"
"""Folder in the working directory for copies; all workers of a cluster must see it."""


def address(value: object) -> str | None:
    """The address that a text or path is, by a protocol that fsspec knows; None for a file of this machine.

    Example:
        >>> address(Path("s3://flights/rows.parquet")), address("rows.parquet"), address("tcp://host:8786")
        ('s3://flights/rows.parquet', None, None)
    """
    text = str(value) if isinstance(value, str | Path) else ""
    match = ADDRESS.match(text)
    if match is None:
        return None
    from fsspec import available_protocols

    return f"{match[1]}://{text[match.end() :]}" if match[1] in available_protocols() else None


def has_address(arguments: Mapping[str, Any]) -> bool:
    """True if an argument is an address, or a list with one."""
    return any(address(part) for value in arguments.values() for part in _each(value))


def with_local_files(
    function: Callable[[Mapping[str, Any]], R], arguments: Mapping[str, Any], outputs: Collection[str]
) -> R:
    """Call a function with files of this machine in place of addresses; what it writes is sent when it has ended well.

    What it wrote stays while its result is used, which may read it later. After an error or a kill it stays for the
    same call, which goes on with it. A folder that is there already is fetched before, as a finished store.

    Args:
        function: Takes the arguments by name.
        arguments: Some of them addresses, or lists with addresses.
        outputs: Names of those that are written to; other files written there are sent, too.

    Raises:
        ConfigError: If a library for the protocol is missing.
        DataError: If there is no such file, or it cannot be read or written.

    Example:
        >>> import fsspec
        >>> fsspec.filesystem("memory").pipe("/place/note.txt", b"one")
        >>> def copy(given):
        ...     Path(given["out"]).write_text(Path(given["rows"]).read_text() + " more")
        >>> with_local_files(copy, {"rows": "memory://place/note.txt", "out": "memory://place/copy.txt"}, ["out"])
        >>> fsspec.filesystem("memory").cat("/place/copy.txt")
        b'one more'
    """
    if not has_address(arguments):
        return function(arguments)
    here = Path.cwd() / COPIES_FOLDER
    here.mkdir(exist_ok=True)
    sent: dict[Path, str] = {}
    try:
        with TemporaryDirectory(dir=here) as copies:

            def local(name: str, value: Any) -> Any:
                if isinstance(value, list | tuple):
                    return [local(name, part) for part in value]
                url = address(value)
                if url is None:
                    return value
                parent, _, last = url.rstrip("/").rpartition("/")
                folder = (here if name in outputs else Path(copies)) / sha256(url.encode()).hexdigest()[:12]
                if name in outputs:
                    sent[folder] = parent
                if not folder.exists():
                    folder.mkdir()
                    _fetch(url, folder / last, needed=name not in outputs)
                return folder / last

            result = function({name: local(name, value) for name, value in arguments.items()})
        for folder, parent in sent.items():
            _send(folder, parent)
            try:
                weakref.finalize(result, _remove, folder)
            except TypeError:  # a number or a text, which reads nothing later
                _remove(folder)
    finally:
        _remove_empty(*sent, here)
    return result


def _each(value: Any) -> Any:
    return value if isinstance(value, list | tuple) else [value]


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    _remove_empty(folder.parent)


def _remove_empty(*folders: Path) -> None:
    for folder in folders:
        with suppress(OSError):  # something is left in it
            folder.rmdir()


def _fetch(url: str, place: Path, *, needed: bool) -> None:
    """Copy a file, or all files of a folder; of an output, only a folder that is there."""
    with _opened(url) as (files, path):
        if files.isdir(path):
            files.get(path.rstrip("/") + "/", f"{place}/", recursive=True)
        elif needed:
            files.get_file(path, str(place))


def _send(folder: Path, url: str) -> None:
    """Copy all files of a folder, those that describe others (`_descentflow.json`) last."""
    with _opened(url) as (files, path):
        for file in sorted(folder.rglob("*"), key=lambda file: (file.name.startswith("_"), file)):
            if file.is_file():
                target = f"{path.rstrip('/')}/{file.relative_to(folder).as_posix()}"
                files.makedirs(target.rpartition("/")[0], exist_ok=True)
                files.put_file(str(file), target)


@contextmanager
def _opened(url: str) -> Iterator[tuple[Any, str]]:
    """The file system of an address, and its path there; whatever its library raises becomes a line."""
    import fsspec

    try:
        yield fsspec.core.url_to_fs(url)
    except ImportError as error:
        raise ConfigError(
            f"{url}: {error}", expected="the library of its protocol", mend="install it, for s3:// pip install s3fs"
        ) from error
    except Exception as error:
        raise DataError(
            f"{url}: {' '.join(f'{type(error).__name__}: {error}'.split())}",
            expected="a file or folder there, and permission to read or write it",
            mend="check the address, and the credentials of its protocol",
        ) from error
