"""The account of what cleaning dropped, by reason; nothing is lost in silence."""

from dataclasses import asdict, dataclass, field
from typing import Any

import polars as pl


@dataclass(frozen=True)
class Step:
    """What one step left out and what it left."""

    step: str
    rows_dropped: int
    flights_dropped: int
    rows_left: int
    flights_left: int


@dataclass
class DropReport:
    """Rows and flights through the stages of `prepare`.

    Example:
        >>> report = DropReport()
        >>> frame = report.count("duplicate", before, after)
        >>> print(report)
    """

    steps: list[Step] = field(default_factory=list)
    notes: dict[str, int] = field(default_factory=dict)
    """Counts of what was changed but not dropped (for instance rows put into time order)."""
    _last: tuple[pl.DataFrame | None, int] = (None, 0)

    def count(self, step: str, before: pl.DataFrame, after: pl.DataFrame) -> pl.DataFrame:
        """Record the difference of two frames and return the second."""
        # Counting flights costs more than many a filter: the frame before is mostly the one that the last step left.
        known, number = self._last
        before_flights = number if known is before else _flights(before)
        after_flights = before_flights if len(after) == len(before) else _flights(after)
        dropped = len(before) - len(after), before_flights - after_flights
        self.steps.append(Step(step, *dropped, len(after), after_flights))
        self._last = after, after_flights
        return after

    def note(self, what: str, number: int) -> None:
        """Add to a count of something that was changed."""
        if number:
            self.notes[what] = self.notes.get(what, 0) + number

    def as_dict(self) -> dict[str, Any]:
        """Primitives for JSON."""
        return {"steps": [asdict(step) for step in self.steps], "notes": dict(self.notes)}

    def __str__(self) -> str:
        """The table for a terminal."""
        head = f"{'step':<26}{'rows dropped':>14}{'flights dropped':>17}{'rows left':>14}{'flights left':>14}"
        lines = [
            f"{s.step:<26}{s.rows_dropped:>14,}{s.flights_dropped:>17,}{s.rows_left:>14,}{s.flights_left:>14,}"
            for s in self.steps
        ]
        return "\n".join([head, *lines, *(f"{what}: {number:,}" for what, number in self.notes.items())])


def _flights(frame: pl.DataFrame) -> int:
    key = "flight_id" if "flight_id" in frame.columns else "icao24"
    return frame[key].n_unique() if key in frame.columns and len(frame) else 0
