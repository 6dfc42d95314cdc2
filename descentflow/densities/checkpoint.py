"""A density in a checkpoint: loaded ready to sample without any trainer, written, and summed up in a few lines."""

from dataclasses import asdict, dataclass
from hashlib import file_digest
from inspect import signature
from pathlib import Path
from threading import Lock
from typing import Any

import torch

from descentflow import densities
from descentflow.core.arguments import checked_arguments
from descentflow.core.errors import CheckpointError, ConfigError
from descentflow.core.version import __version__
from descentflow.densities import MODULES
from descentflow.densities.density import Density
from descentflow.representation.check_checkpoint import check_flies
from descentflow.representation.read_checkpoint import FORMAT, HELD_OUT, SECTION, read_checkpoint, usable
from descentflow.representation.representation import Representation
from descentflow.surveillance.cleaning.thresholds import Cleaning

PREFIX = "_density."
"""Prefix of the names of the density's parameters in a checkpoint."""
OUTCOME = "outcome"
"""Key of a checkpoint that is written after a fit: how good its best epoch was."""
_BUILDING = Lock()


@checked_arguments
def load_model(path: str | Path) -> Density:
    """Load a latent density with its representation, ready to sample; no trainer is imported.

    Torch's global generator is left as it was.

    Args:
        path: Checkpoint that ``descentflow fit`` wrote.

    Returns:
        The density in evaluation mode on the CPU: of a checkpoint with a final fit that one, which knows the other
        (:attr:`.Density.held_out_fit`).

    Raises:
        CheckpointError: If the file cannot be used; the message has the reason.

    Example:
        >>> model = load_model("best.ckpt")
        >>> len(model.sample(10, seed=0))
        10
    """
    return _model_of(path, read_checkpoint(path))


def _model_of(path: str | Path, content: dict[str, Any]) -> Density:
    with usable(path):
        density = density_in(content)
        if HELD_OUT in content:
            density.refitted_from(density_in(content[HELD_OUT]))
        with Path(path).open("rb") as file:
            density.file = {"checkpoint": Path(path).name, "checkpoint_sha256": file_digest(file, "sha256").hexdigest()}
    return density.eval()


def density_in(content: dict[str, Any]) -> Density:
    """The density of a checkpoint's content with its parameters, without the one inside.

    Example:
        >>> from descentflow.representation.read_checkpoint import read_checkpoint
        >>> density_in(read_checkpoint("best.ckpt")).dimension
        4
    """
    density = density_of(content[SECTION])
    saved = {k.removeprefix(PREFIX): v for k, v in content["state_dict"].items() if k.startswith(PREFIX)}
    density.load_state_dict(saved)
    check_flies(density.representation.decoder, density.representation.plausibility)
    return density.eval()


def as_density(model: object) -> Density:
    """The density that a caller means by a path, a density, or a fitted model of :mod:`descentflow.training.models`.

    Of a model that was fitted again to all flights it is the final one; that knows the held-out fit
    (:attr:`.Density.held_out_fit`).

    Args:
        model: Path of a checkpoint; a density; or anything with a public attribute ``density`` that is one, and maybe
            another, ``final``.

    Returns:
        The density with its representation: loaded from the path in evaluation mode on the CPU, or the very object
        that was passed, as it is.

    Raises:
        CheckpointError: If the path is no checkpoint that can be used.
        ConfigError: If the model has not been fitted, or is none of these.

    Example:
        >>> density = as_density("best.ckpt")
        >>> as_density(density) is density
        True
    """
    if isinstance(model, str | Path):
        return load_model(model)
    density = model if isinstance(model, Density) else getattr(model, "final", None) or getattr(model, "density", None)
    if not isinstance(density, Density):
        raise ConfigError(
            f"a model of type {type(model).__name__}",
            expected="the path of a checkpoint, a Density, or a fitted model such as descentflow.training.fit returns",
            mend="pass one of these",
        )
    density.representation  # noqa: B018 - raises where there is none
    return density


def outcome_of(content: dict[str, Any]) -> str:
    """Score of the best epoch; empty where the checkpoint has none.

    Example:
        >>> from descentflow.representation.read_checkpoint import read_checkpoint
        >>> print(outcome_of(read_checkpoint("best.ckpt")))
        val/nll ... in epoch 1
    """
    for state in content.get("callbacks", {}).values():
        if isinstance(state, dict) and state.get("monitor") and state.get("current_score") is not None:
            return f"{state['monitor']} {float(state['current_score']):.4g} in epoch {content['epoch'] + 1}"
    return str(content.get(OUTCOME, ""))


def section_of(density: Density) -> dict[str, Any]:
    """The part of a checkpoint that describes a density and its representation: tensors and primitives.

    Example:
        >>> section = section_of(load_model("best.ckpt"))
        >>> section["model"], section["format"]
        ('GaussianDensity', 2)
    """
    return {
        "format": FORMAT,
        "version": __version__,
        "model": type(density).__name__,
        "settings": density.settings(),
        "representation": density.representation.to_state(),
    }


def content_of(density: Density) -> dict[str, Any]:
    """A checkpoint of a density and of its held-out fit, from which :func:`load_model` rebuilds both.

    Example:
        >>> torch.save(content_of(load_model("best.ckpt")), "copy.ckpt")
        >>> load_model("copy.ckpt").dimension == load_model("best.ckpt").dimension
        True
    """
    content = {
        "state_dict": {f"{PREFIX}{name}": value for name, value in density.state_dict().items()},
        SECTION: section_of(density),
    }
    before = density.held_out_fit
    return content if before is density else {**content, HELD_OUT: content_of(before)}


def density_of(section: dict[str, Any]) -> Density:
    """The density that a checkpoint's section describes; its parameters are still to be loaded.

    Raises:
        CheckpointError: If no such density is known.

    Example:
        >>> from descentflow.representation.read_checkpoint import read_checkpoint
        >>> type(density_of(read_checkpoint("best.ckpt")["descentflow"])).__name__
        'GaussianDensity'
    """
    name = section["model"]
    if name not in Density.kinds and name not in MODULES:
        raise CheckpointError(
            f"density {name!r}",
            expected=f"one of {', '.join(sorted({*Density.kinds, *MODULES} - {'Density'}))}",
            mend="name the Python file that defines it (--model FILE.py); one that is no longer here: fit a mixture",
        )
    kind = Density.kinds[name] if name in Density.kinds else getattr(densities, name)
    unknown = section["settings"].keys() - signature(kind).parameters.keys()
    if unknown:
        raise CheckpointError(
            f"a {name} of another version, with {', '.join(sorted(unknown))}",
            expected=f"settings among {', '.join(signature(kind).parameters)}",
            mend="fit again, or use the descentflow version that wrote it",
        )
    representation = Representation.from_state(section["representation"])
    # Networks draw their first parameters, which are overwritten, from torch's global generator. It is the caller's:
    # one at a time, for what another thread puts back would be a state of while this one drew.
    with _BUILDING, torch.random.fork_rng(devices=[]):
        density: Density = kind(representation.decoder.dimension, **section["settings"])
    density.attach(representation)
    return density


@dataclass(frozen=True, repr=False)
class CheckpointSummary:
    """A checkpoint's model, with where it came from and how good it was.

    Attributes:
        path: The file.
        density: The model.
        version: Version of descentflow that wrote the file.
        outcome: What decided which epoch was the best, its value, and the epoch; empty if the file does not say.

    Example:
        >>> summary = checkpoint_summary("best.ckpt")
        >>> print(summary.outcome)
        val/nll ... in epoch 1
        >>> print(summary)
        GaussianDensity of ... weights (... of drag, ... of CAS)
        aircraft: A320, ...
        ...
    """

    path: Path
    density: Density
    version: str
    outcome: str

    def __str__(self) -> str:
        """One line for each thing that a user of the model asks first."""
        representation = self.density.representation
        decoder, split = representation.decoder, representation.split
        levels, made = decoder.levels_fl, representation.provenance
        types = ", ".join(made.get("typecodes", [])) or "types unknown"
        added = representation.correction
        before = self.density.held_out_fit
        scored = {} if before is self.density else {"scored": f"the fit to {before.representation.split.describe()}"}
        lines = {
            "aircraft": f"{decoder.aircraft.typecode}, {decoder.aircraft.source}",
            "levels": f"FL{levels[0]:.0f} to FL{levels[-1]:.0f}, {len(levels)} of them",
            "flights": f"fitted to {split.describe()}",
            "descents": f"{made.get('descents', 'unknown')} ({types})",
            "context": representation.context.describe(),
            "air": "standard" if representation.air is None else representation.air.describe(),
            "effects added": ", ".join(added.effects) if added is not None else "none",
            "cleaning": _cleaning(representation.cleaning),
            **scored,
            "score": self._score(),
            "written by": f"descentflow {self.version}",
        }
        sizes = decoder.sizes
        head = f"{type(self.density).__name__} of {decoder.dimension} weights ({sizes})"
        return "\n".join([head, *(f"{name}: {text}" for name, text in lines.items())])

    __repr__ = __str__

    def _score(self) -> str:
        known = self.outcome or "not in this file"
        return f"{known}; `descentflow evaluate {self.path} --real FILE` scores it against flights that it has not seen"


def checkpoint_summary(path: str | Path) -> CheckpointSummary:
    """Read what a checkpoint holds; nothing in it is executed.

    Args:
        path: Checkpoint that ``descentflow fit`` or ``descentflow diagnose`` wrote.

    Raises:
        CheckpointError: If the file cannot be used.

    Example:
        >>> checkpoint_summary("best.ckpt").density.representation.decoder.aircraft.typecode
        'A320'
    """
    content = read_checkpoint(path)
    return CheckpointSummary(
        Path(path),
        _model_of(path, content),
        str(content[SECTION].get("version", "unknown")),
        outcome_of(content),
    )


def _cleaning(kept: Cleaning | None) -> str:
    if kept is None:
        return "unknown"
    usual = asdict(Cleaning())
    changed = {name: value for name, value in asdict(kept).items() if value != usual[name]}
    return "the default thresholds" if not changed else ", ".join(f"{n}={v}" for n, v in changed.items())
