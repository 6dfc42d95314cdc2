"""A density in a checkpoint: loaded ready to sample without any trainer, and written."""

from pathlib import Path
from typing import Any

from descentflow import densities
from descentflow.core.errors import CheckpointError
from descentflow.core.version import __version__
from descentflow.densities import MODULES
from descentflow.densities.density import Density
from descentflow.representation.checkpoint import FORMAT, SECTION, incomplete, read_checkpoint
from descentflow.representation.representation import Representation

PREFIX = "_density."
"""What the names of the density's parameters begin with in a checkpoint."""


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
        raise incomplete(path, error) from error
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
