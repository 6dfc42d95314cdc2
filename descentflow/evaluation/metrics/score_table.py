"""The table of scores: for the eye, for a CSV file and for a logger."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from math import isnan, nan
from textwrap import wrap

import polars as pl
from torch import Tensor

_HEADINGS = ("quantity", "statistic", "unit")
_NUMBERS = {
    "score": "score",
    "matched": "equal_size",
    "floor": "floor",
    "ratio": "over_floor",
    "excess": "excess",
    "nominal": "nominal",
    "worst FL": "worst_fl",
}
"""Heading -> field."""


@dataclass(frozen=True)
class Score:
    """One statistic of one quantity; NaN where ``note`` has the reason for no number.

    ``score``: all samples against all flights, as in the paper. ``equal_size`` (matched size): ``n_each`` samples
    against as many flights; ``floor`` and ``floor_high`` (noise floor): as many other flights against the same
    flights, mean and 95th percentile over random splits. ``over_floor``: their ratio, ``equal_size / floor``;
    ``excess``: the part above the floor, in standard deviations of the flights
    (:meth:`~descentflow.evaluation.metrics.statistic_kinds.Statistic.excess`). ``nominal``: nominal BADA, where one
    descent has the statistic; ``n_samples`` and ``n_real``: descents observed anywhere in the part of the grid (of
    whole profiles, flights that were scored); ``n_levels``: levels that ``score`` averages; ``worst_fl``: the level
    with the largest distance.

    Only ``equal_size`` compares with ``floor``: ``score`` is of larger sets, whose distance is smaller by chance. The
    ratio compares between types, and with a goal, where ``n_each`` is the same.

    Example:
        >>> row = Score("cas_below_transition", "wasserstein", "kt", equal_size=2.6, floor=2.4, floor_high=3.5)
        >>> row.equal_size < row.floor_high  # no further from the flights than flights may be by chance
        True
    """

    quantity: str
    statistic: str
    unit: str
    score: float = nan
    equal_size: float = nan
    floor: float = nan
    floor_high: float = nan
    over_floor: float = nan
    excess: float = nan
    nominal: float = nan
    n_samples: int = 0
    n_real: int = 0
    n_each: int = 0
    n_levels: int = 0
    worst_fl: float = nan
    note: str = ""


@dataclass(frozen=True, eq=False)
class LevelScores:
    """One statistic of CAS or rate by level, all (L,); NaN where there are too few values.

    ``equal_size`` is at matched size; ``floor_low`` and ``floor_high`` are the 5th and 95th percentile over the splits.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> levels = evaluate("best.ckpt", "descents.parquet", n=100, n_splits=2).scores.levels
        >>> levels[0].quantity, levels[0].statistic, levels[0].score.shape == levels[0].levels_fl.shape
        ('cas', 'ks', True)
    """

    quantity: str
    statistic: str
    unit: str
    levels_fl: Tensor
    score: Tensor
    equal_size: Tensor
    floor: Tensor
    floor_low: Tensor
    floor_high: Tensor


@dataclass(frozen=True)
class ScoreTable:
    """Scores in the order of the paper's tables, and CAS and rate by level behind them.

    Attributes:
        rows: The scores.
        levels: CAS and rate by level.
        by_flight: Quantity and statistic of whole profiles and descents -> the score (m,) of each flight, NaN without.

    Example:
        >>> table = ScoreTable((Score("cas_below_transition", "wasserstein", "kt", score=2.1, floor=2.4),))
        >>> table.get("cas_below_transition", "wasserstein").floor
        2.4
        >>> table.scalars()
        {'cas_below_transition/wasserstein': 2.1, 'cas_below_transition/wasserstein_floor': 2.4}
    """

    rows: tuple[Score, ...]
    levels: tuple[LevelScores, ...] = ()
    by_flight: Mapping[tuple[str, str], Tensor] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Score]:
        """Row by row."""
        return iter(self.rows)

    def get(self, quantity: str, statistic: str) -> Score:
        """The row of a quantity and a statistic.

        Raises:
            KeyError: If there is none.
        """
        for row in self.rows:
            if (row.quantity, row.statistic) == (quantity, statistic):
                return row
        raise KeyError((quantity, statistic))

    def frame(self) -> pl.DataFrame:
        """A row for each score, columns as the fields of :class:`Score`; absent numbers are null."""
        return pl.DataFrame([asdict(row) for row in self.rows]).fill_nan(None)

    def scalars(self) -> dict[str, float]:
        """Names and values for a logger: ``quantity/statistic``, with ``_equal_size``, ``_floor``, ``_over_floor``."""
        named = {f"{r.quantity}/{r.statistic}": r.score for r in self.rows}
        for column in ("equal_size", "floor", "over_floor"):
            named |= {f"{r.quantity}/{r.statistic}_{column}": getattr(r, column) for r in self.rows}
        return {name: value for name, value in named.items() if not isnan(value)}

    def __str__(self) -> str:
        """The scores that have a noise floor, as a table for a terminal; then what has none, and why."""
        heading = _line((*_HEADINGS, *_NUMBERS))
        lines = [heading, "-" * len(heading)]
        notes: dict[str, int] = {}
        without: dict[str, list[str]] = {}
        for row in self.rows:
            if row.note and isnan(row.floor):
                without.setdefault(row.note, []).append(f"{row.quantity} {row.statistic}")
                continue
            numbers = (_number(getattr(row, field)) for field in _NUMBERS.values())
            mark = f" [{notes.setdefault(row.note, len(notes) + 1)}]" if row.note else ""
            lines.append(_line((row.quantity, row.statistic, row.unit, *numbers)) + mark)
        sizes = "; ".join(f"{n} in {', '.join(names)}" for n, names in self.sizes().items())
        sentence = (
            f"score: all samples against all flights; matched size and noise floor, flights on each side: {sizes or 0}"
        )
        lines += wrap(sentence, len(heading), subsequent_indent="  ")
        lines.append("ratio: matched size over noise floor; excess: above the noise floor, in spreads of the flights")
        lines += [f"[{number}] {note}" for note, number in notes.items()]
        for note, names in without.items():
            lines += wrap(f"not compared, {note}: {', '.join(names)}", len(heading), subsequent_indent="  ")
        return "\n".join(lines)

    def sizes(self) -> dict[int, list[str]]:
        """Flights on each side of a matched comparison -> the quantities that were compared at that size.

        Example:
            >>> rows = (Score("time_to_bottom_of_descent", "ks", "1", n_each=53), Score("cas_profile", "energy", "kt"))
            >>> ScoreTable(rows).sizes()
            {53: ['time_to_bottom_of_descent']}
        """
        by_size: dict[int, list[str]] = {}
        for quantity, n in dict.fromkeys((row.quantity, row.n_each) for row in self.rows if row.n_each):
            by_size.setdefault(n, []).append(quantity)
        return by_size


def _line(cells: tuple[str, ...]) -> str:
    return f"{cells[0]:<26}{cells[1]:<13}{cells[2]:<7}" + "".join(f"{cell:>10}" for cell in cells[3:])


def _number(value: float) -> str:
    """Three digits, never in powers of ten."""
    if isnan(value):
        return "-"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}" if abs(value) >= 1e-4 else f"{value:.4f}"
