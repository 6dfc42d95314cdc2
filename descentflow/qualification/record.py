"""Record of a qualification: rows of judgements, and what assurance asks for beside them."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from descentflow.core.files import whole_file
from descentflow.core.threads import one_thread
from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.plain_values import NOT_WRITTEN, primitives
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.qualification.equivalence import Verdict
from descentflow.reporting.in_notebook import InNotebook

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FILES = ("qualification.json", "qualification.html")
"""Files that are written."""


@dataclass(frozen=True)
class Row:
    """Judgement of one quantity at some levels, or after some minutes.

    Attributes:
        quantity: See :data:`descentflow.qualification.limits.UNITS`.
        unit: Of the numbers.
        low_fl: Lowest flight level.
        high_fl: Highest one.
        minutes: Time for which a prediction was made; None for others.
        limit: Size of the limit; None where the quantity is measured and not judged.
        flights: Real flights that show it.
        difference: Mean of the real flights minus the simulator's, with its 90 % interval; None of no flight.
        share_inside: Share of the real flights within the limit of the simulator's mean, with its 90 % interval.
        verdict: ``inside``, ``outside``, ``not enough flights`` or ``not judged``.
        more_flights: Further flights that would decide, of further aircraft and days alike; None where it is decided,
            or no such number would.
        decides: What would decide, in words; empty where it is decided.
        by_air: Part of the difference by the air that each flight measured; None where that is not known.
        corrected: The difference once the causes that were found are in the simulator; None where there is none.
        source: Of the limit.

    Example:
        >>> row = Row("rate", "ft/min", 200.0, 210.0, None, 200.0, 80, Measured(50.0, 20.0, 80.0), None, "inside")
        >>> row.of_limit
        0.25
    """

    quantity: str
    unit: str
    low_fl: float
    high_fl: float
    minutes: float | None
    limit: float | None
    flights: int
    difference: Measured | None
    share_inside: Measured | None
    verdict: Verdict
    more_flights: int | None = None
    decides: str = ""
    by_air: float | None = None
    corrected: Measured | None = None
    source: str = ""

    @property
    def of_limit(self) -> float | None:
        """Mean difference in units of the limit."""
        return None if not self.limit or self.difference is None else self.difference.estimate / self.limit


@dataclass(frozen=True, repr=False)
class Qualification(InNotebook):
    """Qualification of a simulator, see :func:`descentflow.qualification.qualify.qualify`: printed, JSON, and a page.

    Attributes:
        verdict: ``inside`` if every row is; ``outside`` if one surely is; else ``not enough flights``; ``not judged``
            without limits.
        limits: Name of the limits.
        source: Where they come from.
        rows: Judgements: airspeed and rate by level from below, each with all levels last; then predictions.
        domain: Where the answer holds: types, levels, days, places, weather.
        independence: Whether the flights that judge were used to make the simulator.
        budget: What makes the numbers unsure, and how much.
        factors: The factors of NASA-STD-7009 (2008), and where the evidence of each stands.
        gap: Diagnosis of the same flights.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> found = qualify("descents.parquet", "A320")
        >>> found.verdict
        'outside'
        >>> found.write("qualified")
        >>> sorted(path.name for path in Path("qualified").iterdir())
        ['qualification.html', 'qualification.json']
    """

    verdict: Verdict
    limits: str
    source: str
    rows: list[Row]
    domain: dict[str, str]
    independence: str
    budget: dict[str, str]
    factors: dict[str, str]
    gap: GapReport = field(metadata=NOT_WRITTEN)

    def notebook_figure(self) -> "Figure | None":
        """Differences in units of their limits; None where nothing is judged."""
        from descentflow.qualification.page import limits_figure

        return limits_figure(self)

    def __str__(self) -> str:
        """The answer in a few lines."""
        from descentflow.qualification.page import summary

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
        """Primitives for `qualification.json`, whose form is `qualification.schema.json` beside this module."""
        made = {"gap": {"verdict": self.gap.verdict, "causes": [cause.effect for cause in self.gap.causes]}}
        pedigree = primitives(self.gap.provenance)
        return {
            "schema_version": SCHEMA_VERSION,
            **primitives(self),
            **made,
            "pedigree": {**pedigree, "left_out": dict(self.gap.dropped)},
        }

    def write(self, folder: str | Path) -> None:
        """Write `qualification.json` and `qualification.html`.

        Args:
            folder: Made if absent.
        """
        from descentflow.qualification.page import page

        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        with whole_file(target / FILES[0]) as temporary:
            temporary.write_text(json.dumps(self.as_dict(), indent=1, allow_nan=False))
        with whole_file(target / FILES[1]) as temporary, one_thread():
            temporary.write_text(page(self), encoding="utf-8")
