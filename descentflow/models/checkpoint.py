"""Load a checkpoint without executing code, or say clearly why it cannot be loaded."""

import pickle
import warnings
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import torch

from descentflow import models
from descentflow.data.representation import Representation
from descentflow.errors import CheckpointError
from descentflow.models import MODULES
from descentflow.models.base import FORMAT, SECTION, LatentModel

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


def load_model(path: str | Path) -> LatentModel:
    """Load a latent model with its representation, ready to sample.

    Args:
        path: Checkpoint that ``descentflow fit`` wrote.

    Returns:
        The model in evaluation mode on the CPU.

    Raises:
        CheckpointError: If the file cannot be used; the message says why.

    Example:
        >>> model = load_model("runs/quickstart/checkpoints/best.ckpt")
        >>> model.sample(10, seed=0).shape
        torch.Size([10, 12])
    """
    content = read_checkpoint(path)
    name = content[SECTION]["model"]
    if name not in LatentModel.models and name not in MODULES:
        raise CheckpointError(
            f"{path}: model {name!r}",
            expected=f"one of {', '.join(sorted({*LatentModel.models, *MODULES}))}",
            mend="import the module that defines this model before loading",
        )
    kind = LatentModel.models[name] if name in LatentModel.models else getattr(models, name)
    try:
        # LightningCLI adds notes of its own, which begin with an underscore.
        settings = {k: v for k, v in content.get("hyper_parameters", {}).items() if not k.startswith("_")}
        model = kind(**settings)
        model.on_load_checkpoint(content)
        model.load_state_dict(content["state_dict"])
    except (KeyError, TypeError, RuntimeError) as error:
        raise _incomplete(path, error) from error
    return model.eval()
