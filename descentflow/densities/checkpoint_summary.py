"""Summary of a checkpoint in a few lines, as `descentflow info` prints it."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from descentflow.densities.checkpoint import load_model
from descentflow.densities.density import Density
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint
from descentflow.surveillance.cleaning.thresholds import Cleaning


@dataclass(frozen=True, repr=False)
class CheckpointSummary:
    """A checkpoint's model, with where it came from and how good it was.

    Attributes:
        path: The file.
        density: The model.
        version: Version of descentflow that wrote the file.
        score: Name of what decided which epoch was the best, and its value there; None if the file does not say.
        epoch: The epoch, beginning at 1; None if the file does not say.

    Example:
        >>> found = checkpoint_summary("best.ckpt")
        >>> found.score[0], found.epoch
        ('val/nll', 1)
        >>> print(found)
        GaussianDensity of ... weights (... of drag, ... of CAS)
        aircraft: A320, ...
        ...
    """

    path: Path
    density: Density
    version: str
    score: tuple[str, float] | None
    epoch: int | None

    def __str__(self) -> str:
        """One line for each thing that a user of the model asks first."""
        parts = self.density.representation
        decoder, split = parts.decoder, parts.split
        levels, made = decoder.levels_fl, parts.provenance
        types = ", ".join(made.get("typecodes", [])) or "types unknown"
        added = parts.correction
        lines = {
            "aircraft": f"{decoder.aircraft.typecode}, {decoder.aircraft.source}",
            "levels": f"FL{levels[0]:.0f} to FL{levels[-1]:.0f}, {len(levels)} of them",
            "flights": f"{len(split.train):,} train, {len(split.validation):,} validation, {len(split.test):,} test",
            "descents": f"{made.get('descents', 'unknown')} ({types})",
            "context": "none" if parts.context is None else parts.context.describe(),
            "air": "standard" if parts.air is None else parts.air.describe(),
            "effects added": ", ".join(added.effects) if added is not None else "none",
            "cleaning": _cleaning(parts.cleaning),
            "score": self._score(),
            "written by": f"descentflow {self.version}",
        }
        sizes = decoder.sizes
        head = f"{type(self.density).__name__} of {decoder.dimension} weights ({sizes})"
        return "\n".join([head, *(f"{name}: {text}" for name, text in lines.items())])

    __repr__ = __str__

    def _score(self) -> str:
        if self.score is None:
            return "not in this file; `descentflow evaluate` scores it against any descents"
        name, value = self.score
        when = "" if self.epoch is None else f" in epoch {self.epoch}"
        return f"{name} {value:.4g}{when}; `descentflow test --ckpt_path {self.path}` scores its held-out flights"


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
    epoch = content.get("epoch")
    return CheckpointSummary(
        Path(path),
        load_model(path),
        str(content[SECTION].get("version", "unknown")),
        _score(content),
        epoch + 1 if isinstance(epoch, int) else None,
    )


def _score(content: dict[str, Any]) -> tuple[str, float] | None:
    """Best score that Lightning's ModelCheckpoint kept beside the weights."""
    for state in content.get("callbacks", {}).values():
        if isinstance(state, dict) and state.get("monitor") and state.get("current_score") is not None:
            return str(state["monitor"]), float(state["current_score"])
    return None


def _cleaning(kept: Cleaning | None) -> str:
    if kept is None:
        return "unknown"
    usual = asdict(Cleaning())
    changed = {name: value for name, value in asdict(kept).items() if value != usual[name]}
    return "the default thresholds" if not changed else ", ".join(f"{n}={v}" for n, v in changed.items())
