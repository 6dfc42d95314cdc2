"""Load a checkpoint without executing code, or say clearly why it cannot be loaded."""

import pickle
import warnings
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import torch

from descentflow import __version__, densities
from descentflow.data.representation import Representation
from descentflow.densities import MODULES
from descentflow.densities.base import Density
from descentflow.errors import CheckpointError

SECTION = "descentflow"
"""Key of a checkpoint under which everything stands that Lightning does not save itself."""
FORMAT = 2
"""Version of that section."""
PREFIX = "_density."
"""What the names of the density's parameters begin with in a checkpoint."""
MEND = "pass a .ckpt file that `descentflow fit` wrote, for instance runs/.../checkpoints/best.ckpt"


def read_checkpoint(path: str | Path) -> dict[str, Any]:
    """Read a checkpoint's content with ``weights_only=True``, which unpickles nothing but tensors and primitives.

    Raises:
        CheckpointError: If the file is missing, truncated, not a checkpoint, not ours, of another format, or
            holds objects that would have to execute code.
    """
    if not Path(path).is_file():
        raise CheckpointError(f"no file {path}", expected="a checkpoint", mend=MEND)
    try:
        with warnings.catch_warnings():
            # torch wonders aloud about pickle protocols that it then refuses.
            warnings.simplefilter("ignore", UserWarning)
            content = torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        raise CheckpointError(
            f"{path}: {str(error).splitlines()[0]}", expected="a checkpoint of tensors and primitives", mend=MEND
        ) from error
    except (RuntimeError, EOFError, BadZipFile, OSError, ValueError, KeyError) as error:
        raise CheckpointError(
            f"{path}: {str(error).splitlines()[0] if str(error) else type(error).__name__}",
            expected="a whole checkpoint file (this one is truncated or something else)",
            mend=MEND,
        ) from error
    if not isinstance(content, dict) or SECTION not in content:
        raise CheckpointError(f"{path}: not a checkpoint of descentflow", expected=f"a {SECTION!r} section", mend=MEND)
    if content[SECTION].get("format") != FORMAT:
        raise CheckpointError(
            f"{path}: checkpoint format {content[SECTION].get('format')!r}",
            expected=f"format {FORMAT}",
            mend=f"fit again, or use the descentflow version that wrote it ({content[SECTION].get('version')})",
        )
    return content


def load_representation(path: str | Path) -> Representation:
    """Load bases, scaler, bounds and split of a checkpoint without its density.

    Raises:
        CheckpointError: As :func:`read_checkpoint`.
    """
    content = read_checkpoint(path)
    try:
        return Representation.from_state(content[SECTION]["representation"])
    except (KeyError, TypeError) as error:
        raise _incomplete(path, error) from error


def _incomplete(path: str | Path, error: Exception) -> CheckpointError:
    return CheckpointError(
        f"{path}: {str(error).splitlines()[0]}", expected="all that a descentflow checkpoint holds", mend=MEND
    )


def load_model(path: str | Path) -> Density:
    """Load a latent density with its representation, ready to sample; no trainer is imported.

    Args:
        path: Checkpoint that ``descentflow fit`` wrote.

    Returns:
        The density in evaluation mode on the CPU.

    Raises:
        CheckpointError: If the file cannot be used; the message says why.

    Example:
        >>> model = load_model("runs/quickstart/checkpoints/best.ckpt")
        >>> model.sample(10, seed=0).shape
        torch.Size([10, 12])
    """
    content = read_checkpoint(path)
    try:
        density = density_of(content[SECTION])
        saved = {k.removeprefix(PREFIX): v for k, v in content["state_dict"].items() if k.startswith(PREFIX)}
        density.load_state_dict(saved)
    except CheckpointError as error:
        raise CheckpointError(f"{path}: {error.got}", expected=error.expected, mend=error.mend) from error
    except (KeyError, TypeError, RuntimeError) as error:
        raise _incomplete(path, error) from error
    return density.eval()


def section_of(density: Density) -> dict[str, Any]:
    """What a checkpoint says of a density and its representation: tensors and primitives."""
    return {
        "format": FORMAT,
        "version": __version__,
        "model": type(density).__name__,
        "settings": density.settings(),
        "representation": density.representation.to_state(),
    }


def content_of(density: Density) -> dict[str, Any]:
    """A checkpoint of a density alone, from which :func:`load_model` rebuilds it."""
    return {
        "state_dict": {f"{PREFIX}{name}": value for name, value in density.state_dict().items()},
        SECTION: section_of(density),
    }


def density_of(section: dict[str, Any]) -> Density:
    """The density that a checkpoint's section describes, its parameters not yet those of the checkpoint.

    Raises:
        CheckpointError: If no such density is known.
    """
    name = section["model"]
    if name not in Density.kinds and name not in MODULES:
        raise CheckpointError(
            f"density {name!r}",
            expected=f"one of {', '.join(sorted({*Density.kinds, *MODULES} - {'Density'}))}",
            mend="import the module that defines this density before loading",
        )
    kind = Density.kinds[name] if name in Density.kinds else getattr(densities, name)
    representation = Representation.from_state(section["representation"])
    density: Density = kind(representation.decoder.dimension, **section["settings"])
    density.attach(representation)
    return density
