"""The answer of a diagnosis: printed, as JSON, as a page, and as a corrected simulator."""

import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from descentflow.core.files import whole_file, write_whole
from descentflow.core.threads import one_thread
from descentflow.diagnosis.findings.correction_found import CHECKPOINT, FLIGHTS
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.plain_values import NOT_WRITTEN, primitives
from descentflow.diagnosis.findings.read_gap import SCHEMA_VERSION
from descentflow.diagnosis.report.page import next_command, page, summary
from descentflow.reporting.in_notebook import WithTable

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

FILES = ("gap.json", "gap.html", FLIGHTS, CHECKPOINT)
"""Files that may be written."""
KEYS = ("schema_version", *(item.name for item in fields(Findings) if item.name not in ("details", "corrections")))
"""Keys of `gap.json` that readers may rely on; `details` holds the rest."""


@dataclass(frozen=True, repr=False)
class GapReport(Findings, WithTable):
    """Report of a diagnosis, see :class:`~descentflow.diagnosis.findings.findings.Findings` for its parts.

    Attributes:
        folder: Where the diagnosis wrote it; empty where it wrote nothing.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> report.verdict, [cause.effect for cause in report.causes]
        ('effect', ['mass'])
        >>> report.to_polars().columns[:3]
        ['quantity', 'level_low_fl', 'level_high_fl']
        >>> report.write("nominal-gap")
        >>> sorted(path.name for path in Path("nominal-gap").iterdir())
        ['gap.html', 'gap.json']
    """

    folder: str = field(default="", compare=False, metadata=NOT_WRITTEN)

    def notebook_figure(self) -> "Figure | None":
        """The first cost; nothing where none is known."""
        from descentflow.diagnosis.report.figures import cost_figure

        return cost_figure(self.costs, self.costs[0].name) if self.costs else None

    def __str__(self) -> str:
        """The answer in a few lines."""
        return summary(self, next_command(self, self.folder or "gap"), written=bool(self.folder))

    __repr__ = __str__

    def as_dict(self) -> dict[str, Any]:
        """Primitives for `gap.json`, the keys of :data:`KEYS` first."""
        return {"schema_version": SCHEMA_VERSION, **primitives(self)}

    def to_polars(self) -> "pl.DataFrame":
        """Table of the gap: a row for each cell, largest share first."""
        import polars as pl

        return pl.DataFrame([primitives(cell) for cell in self.where])

    def write(self, folder: str | Path) -> None:
        """Write `gap.json`, `gap.html` and, with a cause, the corrected simulator (:attr:`corrected_file`).

        Args:
            folder: Made if absent.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write_whole(target / "gap.json", json.dumps(self.as_dict(), indent=1, allow_nan=False))
        with one_thread():
            write_whole(target / "gap.html", page(self, target))
        for name, write in self.corrections.items():
            with whole_file(target / name) as temporary:
                write(temporary)
