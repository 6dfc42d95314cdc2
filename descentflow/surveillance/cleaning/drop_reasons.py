"""The reason for which each row was dropped, and a few flights in which a person can judge it."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.rates import with_rate
from descentflow.surveillance.rows.drop_report import DropReport

ROW = "_row"
"""Column that numbers the rows of a batch while they are filtered."""
SHOWN = ("flight_id", "typecode", "timestamp", "altitude", "vertical_rate", "IAS", "Mach")


@dataclass
class TracedReport(DropReport):
    """A report that also keeps the step by which each row of a batch was dropped."""

    rows: int = 0

    def __post_init__(self) -> None:
        self.step_of = np.full(self.rows, -1, dtype=np.int16)

    def count(self, step: str, before: pl.DataFrame, after: pl.DataFrame) -> pl.DataFrame:
        """See :meth:`DropReport.count`; rows are identified by :data:`ROW`."""
        kept = super().count(step, before, after)
        if ROW in before.columns and len(after) < len(before):
            gone = np.zeros(self.rows, dtype=bool)
            gone[before[ROW].to_numpy()] = True
            gone[after[ROW].to_numpy()] = False
            self.step_of[gone] = len(self.steps) - 1
        return kept

    def with_reasons(self, rows: pl.DataFrame, number: int) -> pl.DataFrame:
        """Some flights of the batch with the reason for which each row was dropped, null for rows that were kept."""
        names = np.array([step.step for step in self.steps] + [None], dtype=object)
        reason = pl.Series("reason", names[self.step_of].tolist(), dtype=pl.String)
        judged = rows.select(name for name in SHOWN if name in rows.columns).with_columns(reason)
        return some_flights(with_rate(judged), number).select(*SHOWN, "reason")


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
