"""The report of what cleaning dropped, by reason: every row is accounted for."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import polars as pl

from descentflow.core.arguments import checked_settings
from descentflow.reporting.in_notebook import InNotebook

if TYPE_CHECKING:
    from matplotlib.figure import Figure
import numpy as np

MAX_NAMED_STEPS, MAX_NOTED_CASES = 4, 10
"""Steps that a summary names."""


@checked_settings
@dataclass(frozen=True)
class Step:
    """Rows that one step dropped and left; flights are None before they are identified.

    Example:
        >>> Step("duplicate", rows_dropped=2, flights_dropped=None, rows_left=98, flights_left=None).rows_left
        98
    """

    step: str
    rows_dropped: int
    flights_dropped: int | None
    rows_left: int
    flights_left: int | None


@dataclass
class DropReport(InNotebook):
    """Number of rows and flights after every step of `prepare`.

    Example:
        >>> report = DropReport(by_flight=True)
        >>> rows = pl.DataFrame({"flight_id": ["a", "a", "b"]})
        >>> _ = report.count("duplicate", rows, rows.head(2))
        >>> report.steps[0].flights_dropped
        1
    """

    steps: list[Step] = field(default_factory=list)
    notes: dict[str, int] = field(default_factory=dict)
    """Counts of what was changed but not dropped (for instance rows put into time order)."""
    by_flight: bool = False
    """True if rows are sorted by flight, so that flights can be counted."""

    def count(self, step: str, before: pl.DataFrame, after: pl.DataFrame) -> pl.DataFrame:
        """Record what a step dropped.

        Args:
            step: Its name.
            before: Rows before the step.
            after: Rows after it.

        Returns:
            `after`.
        """
        before_flights, after_flights = self._flights(before), self._flights(after)
        gone = None if before_flights is None or after_flights is None else before_flights - after_flights
        self.steps.append(Step(step, len(before) - len(after), gone, len(after), after_flights))
        return after

    def extend(self, parts: "Sequence[DropReport]") -> None:
        """Add the reports of parts of the data (rows, or whole flights); a part's missing steps dropped nothing.

        Example:
            >>> report, part = DropReport(), DropReport([Step("read", 0, None, 9, None)])
            >>> report.extend([part, part])
            >>> report.steps[0].rows_left
            18
        """
        order = _in_order([[step.step for step in part.steps] for part in parts])
        for same in zip(*(part._through(order) for part in parts), strict=True):
            rows = sum(s.rows_dropped for s in same), sum(s.rows_left for s in same)
            flights = _sum(s.flights_dropped for s in same), _sum(s.flights_left for s in same)
            self.steps.append(Step(same[0].step, rows[0], flights[0], rows[1], flights[1]))
        for part in parts:
            for what, number in part.notes.items():
                self.note(what, number)

    def _through(self, order: Sequence[str]) -> Iterator[Step]:
        """The steps in this order, with those in between that are not the report's own, which left what was there."""
        own = {step.step: step for step in self.steps}
        rows = self.steps[0].rows_left + self.steps[0].rows_dropped if self.steps else 0
        flights: int | None = None
        for name in order:
            step = own.get(name, Step(name, 0, None if flights is None else 0, rows, flights))
            rows, flights = step.rows_left, step.flights_left
            yield step

    def note(self, what: str, number: int) -> None:
        """Add to a count of something that was changed."""
        if number:
            self.notes[what] = self.notes.get(what, 0) + number

    def note_of(self, what: str, which: str, number: int) -> None:
        """Add to a count that names a case; beyond the first ten cases all others have one count.

        Example:
            >>> report = DropReport()
            >>> report.note_of("lines left out of ", "a.json", 2)
            >>> report.notes
            {'lines left out of a.json': 2}
        """
        said = f"{what}{which}"
        lines = sum(note.startswith(what) for note in self.notes)
        self.note(said if said in self.notes or lines < MAX_NOTED_CASES else f"{what}others", number)

    def as_dict(self) -> dict[str, Any]:
        """The report as dictionaries and lists for JSON."""
        return {"steps": [asdict(step) for step in self.steps], "notes": dict(self.notes)}

    @classmethod
    def from_dict(cls, primitives: dict[str, Any]) -> "DropReport":
        """The report that :meth:`as_dict` wrote."""
        return cls([Step(**step) for step in primitives["steps"]], dict(primitives["notes"]))

    def left(self, step: str) -> int | None:
        """Number of rows that a step left; None if there was no such step."""
        return next((taken.rows_left for taken in self.steps if taken.step == step), None)

    def summary(self) -> list[str]:
        """Rows read, rows left and the steps that dropped most, in two lines; none if nothing is known.

        Example:
            >>> DropReport([Step("read", 0, None, 9, None), Step("not_descending", 3, 0, 6, 1)]).summary()
            ['  rows: 9 read, 6 left', '  dropped most by: not_descending 3']
        """
        if not self.steps:
            return []
        most = sorted((s for s in self.steps if s.rows_dropped), key=lambda s: -s.rows_dropped)[:MAX_NAMED_STEPS]
        dropped = ", ".join(f"{s.step} {s.rows_dropped:,}" for s in most) or "nothing"
        left = self.steps[-1].rows_left
        return [f"  rows: {self.steps[0].rows_left:,} read, {left:,} left", f"  dropped most by: {dropped}"]

    def notebook_figure(self) -> "Figure | None":
        """Rows that each step dropped; nothing where none was."""
        from descentflow.reporting.figure_style import BLUE, panels

        dropped = {step.step: step.rows_dropped for step in reversed(self.steps) if step.rows_dropped}
        if not dropped:
            return None
        figure, ((ax,),) = panels(8.4, 0.3 * len(dropped) + 0.9)
        ax.barh(list(dropped), list(dropped.values()), color=BLUE)
        ax.set_xlabel("Rows dropped")
        return figure

    def __str__(self) -> str:
        """The table for a terminal."""
        head = f"{'step':<26}{'rows dropped':>14}{'flights dropped':>17}{'rows left':>14}{'flights left':>14}"
        lines = [
            f"{s.step:<26}{s.rows_dropped:>14,}{_shown(s.flights_dropped):>17}{s.rows_left:>14,}"
            f"{_shown(s.flights_left):>14}"
            for s in self.steps
        ]
        return "\n".join([head, *lines, *(f"{what}: {number:,}" for what, number in self.notes.items())])

    def _flights(self, frame: pl.DataFrame) -> int | None:
        if not self.by_flight:
            return None
        name = frame["flight_id"]
        return int((name != name.shift()).fill_null(True).sum())


def _in_order(parts: Sequence[Sequence[str]]) -> list[str]:
    """All names of several sequences, each behind the one that it follows in the first sequence that has it."""
    order: list[str] = []
    for names in parts:
        place = 0
        for name in names:
            if name not in order:
                order.insert(place, name)
            place = order.index(name) + 1
    return order


def _sum(numbers: Iterable[int | None]) -> int | None:
    known = [number for number in numbers if number is not None]
    return sum(known) if known else None


def _shown(number: int | None) -> str:
    return "" if number is None else f"{number:,}"


ROW_NUMBER = "_row"
"""Column that numbers the rows of a batch while they are filtered."""
SHOWN_COLUMNS = ("flight_id", "typecode", "timestamp", "altitude", "vertical_rate", "IAS", "Mach")


@dataclass
class TracedReport(DropReport):
    """A report that also keeps the step by which each row of a batch was dropped."""

    rows: int = 0

    def __post_init__(self) -> None:
        self.step_of = np.full(self.rows, -1, dtype=np.int16)

    def count(self, step: str, before: pl.DataFrame, after: pl.DataFrame) -> pl.DataFrame:
        """See :meth:`DropReport.count`; rows are identified by :data:`ROW_NUMBER`."""
        kept = super().count(step, before, after)
        if ROW_NUMBER in before.columns and len(after) < len(before):
            gone = np.zeros(self.rows, dtype=bool)
            gone[before[ROW_NUMBER].to_numpy()] = True
            gone[after[ROW_NUMBER].to_numpy()] = False
            self.step_of[gone] = len(self.steps) - 1
        return kept

    def with_reasons(self, rows: pl.DataFrame, number: int) -> pl.DataFrame:
        """Some flights of the batch with the reason for which each row was dropped, null for rows that were kept."""
        names = np.array([step.step for step in self.steps] + [None], dtype=object)
        reason = pl.Series("reason", names[self.step_of].tolist(), dtype=pl.String)
        return some_flights(rows.select(SHOWN_COLUMNS).with_columns(reason), number)


def some_flights(rows: pl.DataFrame, number: int) -> pl.DataFrame:
    """All rows of a few flights: some random ones with rows that were kept, and for each reason the flight it hit most.

    From the flights chosen in each part of the data it chooses the same as from all flights at once.
    """
    counts = rows.group_by("flight_id", "reason").len()
    hit = counts.drop_nulls("reason").sort("len", "flight_id", descending=[True, False])
    most = hit.unique("reason", keep="first", maintain_order=True)["flight_id"]
    kept = counts.filter(pl.col("reason").is_null()).sort(pl.col("flight_id").hash(), "flight_id")["flight_id"]
    chosen = pl.concat([most, kept.head(number)]).unique()
    return rows.filter(pl.col("flight_id").is_in(chosen.implode()))
