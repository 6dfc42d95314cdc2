"""What was logged while a run trained: numbers by epoch, from TensorBoard's events."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SCORE, FLOOR = "equal_size", "floor"
"""Ends of the names of a score at matched size, and of its noise floor."""


@dataclass(frozen=True)
class RunHistory:
    """Numbers by epoch.

    Attributes:
        series: Name -> epochs (beginning at 1) and values, both (n,).

    Example:
        >>> history = RunHistory({"val/nll": (np.array([1.0, 2.0, 3.0]), np.array([5.0, 4.0, 4.5]))})
        >>> history.best("val/nll")
        (2, 4.0)
    """

    series: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def best(self, name: str) -> tuple[int, float] | None:
        """Epoch and value of the least finite value of a series; None if it has none."""
        epochs, values = self.series.get(name, (np.array([]), np.array([])))
        finite = np.isfinite(values)
        if not finite.any():
            return None
        place = int(np.argmin(np.where(finite, values, np.inf)))
        return int(epochs[place]), float(values[place])

    def scored(self) -> dict[str, str]:
        """Name of each score at matched size -> name of its noise floor, those that were logged with one.

        Example:
            >>> both = dict.fromkeys(("val/score/cas/ks_equal_size", "val/score/cas/ks_floor"), ())
            >>> RunHistory(both).scored()
            {'val/score/cas/ks_equal_size': 'val/score/cas/ks_floor'}
        """
        pairs = {name: name.removesuffix(SCORE) + FLOOR for name in self.series if name.endswith(f"_{SCORE}")}
        return {name: floor for name, floor in pairs.items() if floor in self.series}


def run_history(folder: Path) -> RunHistory:
    """Read the events of a run's folder, those of folders in it left out; empty if there are none.

    Args:
        folder: Of the run.

    Example:
        >>> run_history(Path(".")).series
        {}
    """
    if not any(folder.glob("events.out.tfevents.*")):
        return RunHistory()
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    # Every scalar, and no more than one of each picture, which are not asked for.
    events = EventAccumulator(str(folder), size_guidance={"scalars": 0, "images": 1, "tensors": 1})
    events.Reload()
    logged = {
        name: (np.array([e.step for e in events.Scalars(name)]), np.array([e.value for e in events.Scalars(name)]))
        for name in events.Tags()["scalars"]
    }
    steps, epochs = logged.pop("epoch", (np.array([]), np.array([])))
    if not len(steps):
        return RunHistory(logged)
    order = np.argsort(steps, kind="stable")
    steps, epochs = steps[order], epochs[order]
    # Lightning counts steps; the epoch that it logs with them begins at zero.
    return RunHistory({n: (np.interp(at, steps, epochs + 1).round(), values) for n, (at, values) in logged.items()})
