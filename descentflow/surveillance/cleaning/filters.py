"""Filters of rows: small classes, applied in order; each counts what it drops under its reason.

A filter gets rows sorted by flight and time and returns those to keep. Windows of time
around the rows of each flight are computed for all rows at once.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.surveillance.rows.air_data import Array
from descentflow.surveillance.rows.drop_report import DropReport

Index = NDArray[np.int64]

PAUSE_S = 1e6
"""Time between two flights on the common clock; longer than any window."""
SLACK_S = 1e-6
"""Added to both ends of a window, so that a row exactly at an end is inside in spite of rounding."""


def clock_of(flight: Index, seconds: Array) -> Array:
    """One ascending clock for all flights, with a long time between two, so that no window has rows of both.

    Args:
        flight: (n,) number of the flight, equal for the rows of one flight, which are neighbours.
        seconds: (n,) ascending within a flight.
    """
    step = np.diff(seconds, prepend=seconds[:1])
    return np.cumsum(np.where(np.diff(flight, prepend=flight[:1] - 1) != 0, PAUSE_S, step))


def windows(clock: Array, start_s: float, stop_s: float) -> tuple[Index, Index]:
    """First row, and one after the last, of the window from `start_s` to `stop_s` after each row.

    Args:
        clock: (n,) as :func:`clock_of`.
        start_s: Begin of the window, negative before the row.
        stop_s: End of the window.

    Returns:
        (n,) first rows, and (n,) rows after the last.
    """
    first = np.searchsorted(clock, clock + (start_s - SLACK_S))
    return first, np.searchsorted(clock, clock + (stop_s + SLACK_S), side="right")


def window_sum(values: Array, first: Index, last: Index) -> Array:
    """Sum of values[first:last] for every window.

    Each window is summed by itself: differences of running sums over millions of rows would lose the digits that a
    variance needs. The time therefore grows with the windows' length, and they should be sorted.
    """
    return np.where(last > first, _reduced(np.add, values, first, last), 0.0)


def window_max(values: Array, first: Index, last: Index) -> Array:
    """Largest of values[first:last] for every window, none of which may be empty."""
    return _reduced(np.maximum, values, first, last)


def _reduced(operation: np.ufunc, values: Array, first: Index, last: Index) -> Array:
    ends = np.empty(2 * len(first), dtype=np.int64)
    ends[::2], ends[1::2] = first, last
    return np.asarray(operation.reduceat(np.append(values, 0.0), ends)[::2])


FLIGHT = "flight_id"
SEGMENT = "_segment"
"""Column that numbers the segments of uninterrupted free descent in a flight: levels between two segments are not
bridged, or the time of a level-off would count as free descent."""
SECONDS = pl.col("timestamp").dt.epoch("us") / 1e6


def flights_of(rows: pl.DataFrame) -> np.ndarray:
    """(n,) ascending number of every row's flight (the column may hold such numbers itself)."""
    name = rows[FLIGHT]
    if name.dtype.is_integer():
        return name.cast(pl.Int64).to_numpy()
    return (name != name.shift()).fill_null(True).cum_sum().cast(pl.Int64).to_numpy()


def cut(rows: pl.DataFrame, gone: np.ndarray) -> pl.DataFrame:
    """Drop rows of a descent; a new `SEGMENT` begins after each."""
    if not gone.any():
        return rows
    dropped = pl.Series(gone)
    if SEGMENT in rows.columns:
        rows = rows.with_columns((pl.col(SEGMENT) + dropped.cast(pl.Int64).cum_sum()).alias(SEGMENT))
    return rows.filter(~dropped)


class Filter(ABC):
    """Keeps some rows and counts the others under :attr:`reason`.

    A new rule of cleaning is a subclass with `reason` and `keep`, entered in
    :func:`~descentflow.surveillance.cleaning.chain.before_rates` or `after_rates`.
    """

    reason: str
    uses: ClassVar[tuple[str, ...]] = ()
    """Columns that it uses besides time, altitude, rate, IAS and Mach."""

    @abstractmethod
    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """The rows kept (columns may be added for later filters)."""

    def __call__(self, rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
        """Apply the filter and count what it drops."""
        return report.count(self.reason, rows, self.keep(rows))


def filtered(rows: pl.DataFrame, some: Sequence[Filter], report: DropReport) -> pl.DataFrame:
    """Rows that all filters keep, applied in order.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "altitude": [5000.0, 5025.0, 4950.0]})
        >>> from descentflow.surveillance.cleaning._descent_filters import Falling, LargestDescent
        >>> filtered(rows, [LargestDescent(), Falling()], DropReport())["altitude"].to_list()
        [5000.0, 4950.0]
    """
    for one in some:
        rows = one(rows, report)
    return rows
