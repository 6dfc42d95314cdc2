"""The folder next to an output in which an unfinished `prepare` keeps its parts, so that a rerun resumes from them."""

import hashlib
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError, DescentflowError
from descentflow.core.files import Claim, write_whole

DESCRIPTION, ROWS, PARTS = "job.json", "rows", "parts"


def fingerprint(facts: dict[str, Any]) -> str:
    """Hash of inputs and settings: two runs of the same fingerprint make the same descents.

    Example:
        >>> fingerprint({"bottom_fl": 150})[:8]
        'd0a19bc3'
    """
    return hashlib.sha256(json.dumps(facts, sort_keys=True, default=str).encode()).hexdigest()


def work_folder(out: Path) -> Path:
    """Folder of the unfinished work for an output.

    Example:
        >>> work_folder(Path("descents.parquet"))
        PosixPath('descents.parquet.work')
    """
    return out.with_name(f"{out.name}.work")


@contextmanager
def job_folder(out: Path, facts: dict[str, Any]) -> Iterator[Path]:
    """The folder of work for an output, made or found again; removed after success or a typed error.

    A killed run leaves the folder with the finished parts; so does any other failure if there are some.

    Args:
        out: The output; the folder's name is this and ``.work``.
        facts: Inputs and settings.

    Raises:
        ConfigError: If another run is at work on the same output, or left parts made of other inputs or settings.

    Example:
        >>> with job_folder(Path("made.parquet"), {"bottom_fl": 150}) as folder:
        ...     print(folder.name, folder.exists())
        made.parquet.work True
        >>> folder.exists()
        False
    """
    folder = work_folder(out)
    with _alone(folder, out):
        folder.mkdir(exist_ok=True)
        _describe(folder, facts, out)
        try:
            yield folder
        except DescentflowError:
            _remove(folder)
            raise
        except BaseException:
            if not _has_parts(folder):
                _remove(folder)
            raise
        _remove(folder)


def remove_work(out: Path) -> None:
    """Remove the work for an output that is finished, which a run leaves that is killed at its end.

    Args:
        out: The output; another run that is at work on it keeps its folder.

    Example:
        >>> (work_folder(Path("made")) / "parts").mkdir(parents=True)
        >>> _ = Path(".made.work.lock").write_text("")
        >>> remove_work(Path("made"))
        >>> work_folder(Path("made")).exists(), Path(".made.work.lock").exists()
        (False, False)
    """
    folder = work_folder(out)
    if folder.is_dir() or _lock_of(folder).exists():
        with suppress(ConfigError), _alone(folder, out):
            _remove(folder)


def _lock_of(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.lock")


@contextmanager
def _alone(folder: Path, out: Path) -> Iterator[None]:
    """Hold the lock of the work, which lies next to its folder."""
    claim = Claim(_lock_of(folder))
    if not claim.take():
        raise ConfigError(
            f"another run is at work on {out}",
            expected="one at a time",
            mend="wait for it, or choose another --out",
        )
    try:
        yield
    finally:
        claim.let_go()


def _remove(folder: Path) -> None:
    """Remove the folder, its description first: without it, what is left is no work that a rerun can go on with."""
    with suppress(OSError):
        (folder / DESCRIPTION).unlink()
    shutil.rmtree(folder, ignore_errors=True)


def _describe(folder: Path, facts: dict[str, Any], out: Path) -> None:
    """Write the description of the work, or check that an earlier run wrote the same."""
    description, mark = folder / DESCRIPTION, fingerprint(facts)
    try:
        left = json.loads(description.read_text())["fingerprint"] if description.is_file() else None
    except (ValueError, KeyError, TypeError, OSError):
        left = "unreadable"
    if left == mark:
        return
    if left and _has_parts(folder):
        raise ConfigError(
            f"an unfinished run in {folder} was made of other inputs or settings",
            expected=f"those of {description}, with which it goes on",
            mend=f"name the same, or delete {folder}, or choose another --out than {out}",
        )
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
    write_whole(description, json.dumps({"fingerprint": mark, **facts}, indent=1, default=str))


def _has_parts(folder: Path) -> bool:
    """True where the folder has finished parts that a rerun can use."""
    return any(not path.name.startswith(".") for name in (ROWS, PARTS) for path in (folder / name).glob("*"))
