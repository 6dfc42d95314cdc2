"""Summary of a checkpoint in a few lines, as `descentflow info` prints it."""

from dataclasses import asdict, dataclass
from pathlib import Path

from descentflow.densities.checkpoint import load_model, outcome_of
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
        outcome: What decided which epoch was the best, its value, and the epoch; empty if the file does not say.

    Example:
        >>> found = checkpoint_summary("best.ckpt")
        >>> print(found.outcome)
        val/nll ... in epoch 1
        >>> print(found)
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
        parts = self.density.representation
        decoder, split = parts.decoder, parts.split
        levels, made = decoder.levels_fl, parts.provenance
        types = ", ".join(made.get("typecodes", [])) or "types unknown"
        added = parts.correction
        before = self.density.held_out_fit
        scored = {} if before is self.density else {"scored": f"the fit to {before.representation.split.describe()}"}
        lines = {
            "aircraft": f"{decoder.aircraft.typecode}, {decoder.aircraft.source}",
            "levels": f"FL{levels[0]:.0f} to FL{levels[-1]:.0f}, {len(levels)} of them",
            "flights": f"fitted to {split.describe()}",
            "descents": f"{made.get('descents', 'unknown')} ({types})",
            "context": "none" if parts.context is None else parts.context.describe(),
            "air": "standard" if parts.air is None else parts.air.describe(),
            "effects added": ", ".join(added.effects) if added is not None else "none",
            "cleaning": _cleaning(parts.cleaning),
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
        load_model(path),
        str(content[SECTION].get("version", "unknown")),
        outcome_of(content),
    )


def _cleaning(kept: Cleaning | None) -> str:
    if kept is None:
        return "unknown"
    usual = asdict(Cleaning())
    changed = {name: value for name, value in asdict(kept).items() if value != usual[name]}
    return "the default thresholds" if not changed else ", ".join(f"{n}={v}" for n, v in changed.items())
