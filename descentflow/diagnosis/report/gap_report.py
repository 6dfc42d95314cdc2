"""The answer of a diagnosis: where, which effect, how far; as JSON, as a page, and as a corrected simulator."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from descentflow.core.files import whole_file
from descentflow.diagnosis.report.gap_page import page
from descentflow.diagnosis.report.text import summary

SCHEMA_VERSION = 1
KEYS = (
    "schema_version",
    "verdict",
    "p_value",
    "floor",
    "gap_before",
    "where",
    "stages",
    "causes",
    "gap_after",
    "remaining",
    "would_split",
    "dropped",
)
"""Keys of `gap.json` that readers may rely on; `details` holds the rest."""


@dataclass(frozen=True)
class GapReport:
    """What a diagnosis found.

    Attributes:
        verdict: ``none``, ``effect`` or ``unknown``.
        p_value: Probability of a gap as large as this between flights of one population.
        floor: Gap that two samples of one population of these sizes show.
        gap_before: Gap between simulator and flights (mean over the affected quantities of the Wasserstein distance in
            standard deviations between flights).
        where: Cells, largest share first.
        stages: Share of the simulator's own loss by stage, in seconds of the time down the grid.
        causes: Effects in the order in which they were selected.
        gap_after: Gap once the causes are in the simulator.
        remaining: What is left, and where.
        would_split: Channels or slices that would separate what these data cannot.
        dropped: Counts of flights and rows left out, by reason.
        details: Everything else: settings, contest, curves behind the figures.

    Example:
        >>> report = diagnose("flights.parquet", "best.ckpt")
        >>> report.verdict, [cause["effect"] for cause in report.causes]
        ('effect', ['temperature'])
    """

    verdict: str
    p_value: float
    floor: float
    gap_before: float
    where: list[dict[str, Any]]
    stages: dict[str, Any]
    causes: list[dict[str, Any]]
    gap_after: float
    remaining: dict[str, Any]
    would_split: list[dict[str, Any]]
    dropped: dict[str, Any]
    details: dict[str, Any] = field(default_factory=dict)
    write_corrected: Callable[[Path], None] | None = field(default=None, repr=False, compare=False)
    """Writes the simulator with the causes added; None where there is no checkpoint to correct."""

    def __str__(self) -> str:
        """The answer in a few lines."""
        return summary(self)

    def as_dict(self) -> dict[str, Any]:
        """Primitives for `gap.json`, the keys of :data:`KEYS` first."""
        named: dict[str, Any] = {key: getattr(self, key) for key in KEYS if key != "schema_version"}
        return {"schema_version": SCHEMA_VERSION, **named, "details": self.details}

    def write(self, folder: str | Path) -> None:
        """Write `gap.json`, `gap.html` and, for a checkpoint with a cause, `corrected.ckpt`."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        with whole_file(target / "gap.json") as temporary:
            temporary.write_text(json.dumps(self.as_dict(), indent=1, allow_nan=False))
        with whole_file(target / "gap.html") as temporary:
            temporary.write_text(page(self), encoding="utf-8")
        if self.write_corrected is not None:
            with whole_file(target / "corrected.ckpt") as temporary:
                self.write_corrected(temporary)
