"""Read a checkpoint without executing code, or say clearly why it cannot be read."""

import pickle
import re
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from descentflow.core.errors import CheckpointError, DescentflowError
from descentflow.representation.check_checkpoint import check_section

SECTION = "descentflow"
"""Key of a checkpoint under which everything is kept that Lightning does not save itself."""
HELD_OUT = "held_out"
"""Key of a final checkpoint that has the whole content of the held-out fit's."""
FORMAT = 2
"""Version of that section."""
ZIP = b"PK\x03\x04"
"""First bytes of every checkpoint: it is a zip archive."""
UNSAFE = re.compile(r"GLOBAL ([\w.]+)")
"""Name in torch's message of an object that the safe loader does not make."""
MEND = "pass a .ckpt file that `descentflow fit` wrote, for instance runs/.../checkpoints/best.ckpt"
OTHER_MEND = (
    "pass a .ckpt file that `descentflow fit` wrote; flights of a simulator, as rows or descents, are taken by "
    "`descentflow diagnose --simulator`, and `descentflow fit` learns from them"
)


def read_checkpoint(path: str | Path) -> dict[str, Any]:
    """Read a checkpoint's content with ``weights_only=True``, which unpickles nothing but tensors and primitives.

    Raises:
        CheckpointError: If the file is missing, truncated, not a checkpoint, not ours, of another format, or
            holds objects that would have to execute code.

    Example:
        >>> read_checkpoint("best.ckpt")["descentflow"]["model"]
        'GaussianDensity'
    """
    check_is_there(path)
    content = _unpickled(path)
    if not isinstance(content, dict) or SECTION not in content:
        raise CheckpointError(f"{path}: not a checkpoint of descentflow", expected=f"a {SECTION!r} section", mend=MEND)
    section = content[SECTION]
    if not isinstance(section, dict) or section.get("format") != FORMAT:
        known = section if isinstance(section, dict) else {}
        raise CheckpointError(
            f"{path}: checkpoint format {known.get('format')!r}",
            expected=f"format {FORMAT}",
            mend=f"fit again, or use the descentflow version that wrote it ({known.get('version')})",
        )
    with usable(path):
        check_section(section, content.get("state_dict"))
        if (scored := content.get(HELD_OUT)) is not None:
            check_section(scored[SECTION], scored["state_dict"])
    return content


def check_is_there(path: str | Path) -> None:
    """Refuse a path that is no file; of a run's folder, or of that of its versions, the error names the checkpoint.

    Raises:
        CheckpointError: If there is no file.

    Example:
        >>> check_is_there("best.ckpt")
        >>> check_is_there("nothere.ckpt")
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: no file nothere.ckpt; expected a checkpoint; to mend it, pass...
    """
    given = Path(path)
    if given.is_file():
        return
    inside = [
        path
        for run in (given, *sorted(given.glob("*/")))
        for name in ("best", "final")
        if (path := run / "checkpoints" / f"{name}.ckpt").is_file()
    ]
    raise CheckpointError(
        f"{given} is a folder" if given.is_dir() else f"no file {given}",
        expected="a checkpoint",
        mend=f"pass {inside[-1]}" if inside else MEND,
    )


def _unpickled(path: str | Path) -> Any:
    """Content of a .ckpt file by torch's safe loader."""
    with open(path, "rb") as file:
        begins = file.read(len(ZIP))
    if begins != ZIP:
        raise CheckpointError(
            f"{path} is {'no checkpoint' if begins else 'empty'}",
            expected="a checkpoint of descentflow",
            mend=OTHER_MEND,
        )
    try:
        with warnings.catch_warnings():
            # torch wonders aloud about pickle protocols that it then refuses.
            warnings.simplefilter("ignore", UserWarning)
            _check_sums(path)
            return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        # Not torch's own text: it advises to switch the safe loader off.
        named = UNSAFE.search(str(error))
        raise CheckpointError(
            f"{path} holds {named[1] if named else 'objects'}, which could execute code",
            expected="a checkpoint of tensors and primitives",
            mend=MEND,
        ) from error
    except Exception as error:
        # Whatever breaks the reader, the file is not whole: archives and pickles fail in many ways.
        raise CheckpointError(
            f"{path}: {str(error).splitlines()[0] if str(error) else type(error).__name__}",
            expected="a whole checkpoint file (this one is truncated or changed)",
            mend=MEND,
        ) from error


def _check_sums(path: str | Path) -> None:
    """Hold every member of the archive against its checksum, which torch does not.

    Raises:
        ValueError: If one differs, or is compressed: torch compresses none, and a small file could unpack to no end.
    """
    with zipfile.ZipFile(path) as archive:
        if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
            raise ValueError("a compressed archive")
        if (damaged := archive.testzip()) is not None:
            raise ValueError(f"{damaged} differs from its checksum")


@contextmanager
def usable(path: str | Path) -> Iterator[None]:
    """Turn whatever building from a checkpoint's content ends in into an error that names the file.

    Args:
        path: Of the checkpoint.

    Example:
        >>> with usable("best.ckpt"):
        ...     raise KeyError("decoder")
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: best.ckpt: KeyError: 'decoder'; expected ...
    """
    try:
        yield
    except CheckpointError as error:
        raise CheckpointError(f"{path}: {error.got}", expected=error.expected, mend=error.mend) from error
    except DescentflowError as error:
        raise CheckpointError(f"{path}: {error.got}", expected=error.expected, mend=MEND) from error
    except Exception as error:
        # Constructors that are given what they were never meant for fail in many ways; the file is what is wrong.
        reason = str(error).splitlines()[0] if str(error) else ""
        raise CheckpointError(
            f"{path}: {type(error).__name__}: {reason}", expected="all that a descentflow checkpoint holds", mend=MEND
        ) from error
