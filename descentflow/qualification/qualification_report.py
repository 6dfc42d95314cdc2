"""Qualification of a simulator: its record printed, as JSON, and as a page to sign."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from descentflow.core.files import whole_file
from descentflow.core.threads import one_thread
from descentflow.diagnosis.findings.plain_values import primitives
from descentflow.qualification._record_page import limits_figure, page, summary
from descentflow.qualification.record import Record
from descentflow.reporting.in_notebook import InNotebook

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FILES = ("qualification.json", "qualification.html")
"""Files that are written."""


@dataclass(frozen=True, repr=False)
class Qualification(Record, InNotebook):
    """Qualification of a simulator, see :class:`~descentflow.qualification.record.Record` for its parts.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> qualification = qualify("descents.parquet", "A320")
        >>> qualification.verdict
        'inside'
        >>> qualification.write("qualified")
        >>> sorted(path.name for path in Path("qualified").iterdir())
        ['qualification.html', 'qualification.json']
    """

    def notebook_figure(self) -> "Figure | None":
        """Differences in units of their limits; None where nothing is judged."""
        return limits_figure(self)

    def __str__(self) -> str:
        """The answer in a few lines."""
        return summary(self)

    __repr__ = __str__

    def to_polars(self) -> "pl.DataFrame":
        """Table with a line for each row."""
        import polars as pl

        flat = []
        for row in self.rows:
            values = primitives(row)
            for name in ("difference", "share_inside", "corrected"):
                ends = values.pop(name) or {}
                values |= {name: ends.get("estimate"), f"{name}_low": ends.get("low"), f"{name}_high": ends.get("high")}
            flat.append(values)
        return pl.DataFrame(flat, infer_schema_length=None)

    def as_dict(self) -> dict[str, Any]:
        """Primitives for `qualification.json`, whose form is `qualification.schema.json` next to this module."""
        return {
            "schema_version": SCHEMA_VERSION,
            **primitives(self),
            "gap": {"verdict": self.gap.verdict, "causes": [cause.effect for cause in self.gap.causes]},
            "pedigree": {**primitives(self.gap.provenance), "left_out": dict(self.gap.dropped)},
        }

    def write(self, folder: str | Path) -> None:
        """Write `qualification.json` and `qualification.html`.

        Args:
            folder: Made if absent.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        with whole_file(target / FILES[0]) as temporary:
            temporary.write_text(json.dumps(self.as_dict(), indent=1, allow_nan=False))
        with whole_file(target / FILES[1]) as temporary, one_thread():
            temporary.write_text(page(self), encoding="utf-8")
