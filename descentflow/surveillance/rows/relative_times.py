"""Times that count from the begin of a flight or a simulation, which begin anew in each file or flight."""

from dataclasses import dataclass, field
from typing import Any

import polars as pl

from descentflow.core.errors import DataError

FIRST_S = 631_152_000.0
"""1990-01-01: before it there was no Mode S enhanced surveillance, so that such times count from something else."""
BACKWARDS_S = 60.0
"""Step back in time within the rows of a flight that is no disorder of reports."""
MOST_BACKWARDS = 0.1
"""Share of steps back in time up to which rows are in order: a table in no order has a half of them."""
EXPECTED = "dates with time, or seconds since 1970: rows of an aircraft are put into the order of their times"
MEND = (
    "add the time at which each count began to the column timestamp (for a simulator any day will do, another for each "
    "file, such as 1704067200 for 2024-01-01), or give each flight a flight_id and an icao24 of its own"
)


@dataclass
class RelativeTimes:
    """Refuses rows of before 1990 whose times begin anew: flights of an aircraft would be shuffled into each other.

    One clock for all rows, as a simulator's, is taken as it is.

    Example:
        >>> rows = pl.DataFrame({"icao24": "4ca001", "timestamp": pl.from_epoch(pl.Series(range(0, 300, 4)))})
        >>> times = RelativeTimes()
        >>> times.check(rows, "flight_1.csv", first=True)
        >>> times.check(rows, "flight_2.csv", first=True)
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: flight_2.csv: times from 0 to 296 s after the begin of 1970, ...
    """

    _number: int = 0
    _seen: dict[tuple[Any, ...], tuple[int, str, float, float]] = field(default_factory=dict)
    """Address and name of a flight -> number and label of its table, first and last second."""

    def check(self, rows: pl.DataFrame, label: str, first: bool) -> None:
        """Look at a table, or a part of it.

        Args:
            rows: In names and types of a row.
            label: Its name in messages.
            first: Whether it is the first part of its table.

        Raises:
            DataError: If its times begin anew within an aircraft's rows, or meet those of another table.
        """
        self._number += first
        latest = rows.select(pl.col("timestamp").dt.epoch("ms").max() / 1e3).item()
        if latest is None or latest >= FIRST_S:
            return
        keys: list[str] = [name for name in ("icao24", "flight_id") if name in rows.columns]
        clock = rows.select(*keys, (pl.col("timestamp").dt.epoch("us") / 1e6).alias("s")).drop_nulls(["icao24", "s"])
        self._check_order(clock, keys, label)
        spans = clock.group_by(*keys, maintain_order=True).agg(
            pl.col("s").min().alias("from"), pl.col("s").max().alias("to")
        )
        for *key, begin, end in spans.iter_rows():
            number, other, since, until = self._seen.get(tuple(key), (self._number, label, begin, end))
            if number != self._number and begin <= until and since <= end:
                raise DataError(
                    f"{label}: times from {begin:.10g} to {end:.10g} s after the begin of 1970, as are those of the "
                    f"same {' and '.join(keys)} ({', '.join(map(str, key))}) in {other}: they count from the begin of "
                    "something",
                    expected=EXPECTED,
                    mend=MEND,
                )
            self._seen[tuple(key)] = (self._number, label, min(begin, since), max(end, until))

    def _check_order(self, clock: pl.DataFrame, keys: list[str], label: str) -> None:
        """Refuse rows in order whose clock is set back."""
        steps = clock.select(pl.col("s").diff().over(*keys)).to_series().drop_nulls()
        back = int((steps < -BACKWARDS_S).sum())
        if back and int((steps < 0).sum()) <= MOST_BACKWARDS * len(steps):
            raise DataError(
                f"{label}: times before 1990 that begin anew {back:,} times within the rows of one "
                f"{' and '.join(keys)}: they count from the begin of each flight",
                expected=EXPECTED,
                mend=MEND,
            )
