"""Filters of rows: small classes that compose with ``|``; each counts what it drops under its reason.

A filter gets rows sorted by flight and time and returns those to keep. ``a | b`` applies `a`, then `b`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.thresholds import Cleaning, Fixed
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

FLIGHT = "flight_id"
SEGMENT = "_segment"
"""Column that numbers the segments of uninterrupted free descent in a flight: levels between two segments are not
bridged, or the time of a level-off would count as free descent."""
SECONDS = pl.col("timestamp").dt.epoch("us") / 1e6


def flights_of(rows: pl.DataFrame) -> np.ndarray:
    """(n,) ascending number of every row's flight (the column may hold such numbers itself).

    Example:
        >>> flights_of(pl.DataFrame({"flight_id": ["a", "a", "b"]}))
        array([1, 1, 2])
    """
    name = rows[FLIGHT]
    if name.dtype.is_integer():
        return name.cast(pl.Int64).to_numpy()
    return (name != name.shift()).fill_null(True).cum_sum().cast(pl.Int64).to_numpy()


def cut(rows: pl.DataFrame, gone: np.ndarray) -> pl.DataFrame:
    """Drop rows of a descent; a new `SEGMENT` begins after each.

    Example:
        >>> cut(pl.DataFrame({SEGMENT: [0, 0, 0]}), np.array([False, True, False]))[SEGMENT].to_list()
        [0, 1]
    """
    if not gone.any():
        return rows
    dropped = pl.Series(gone)
    if SEGMENT in rows.columns:
        rows = rows.with_columns((pl.col(SEGMENT) + dropped.cast(pl.Int64).cum_sum()).alias(SEGMENT))
    return rows.filter(~dropped)


class Filter(ABC):
    """Keeps some rows and counts the others under :attr:`reason`.

    A new rule of cleaning is a subclass with `reason` and `keep`, entered in
    :func:`~descentflow.surveillance.cleaning.chain.after_rates`.
    """

    reason: str

    @abstractmethod
    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """The rows kept (columns may be added for later filters)."""

    def __call__(self, rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
        """Apply the filter and count what it drops."""
        return report.count(self.reason, rows, self.keep(rows))

    def __or__(self, other: "Filter | Chain") -> "Chain":
        """This filter, then another.

        Example:
            >>> from descentflow.surveillance.cleaning.descent_filters import Descending
            >>> cleaning = Despike("altitude", 300.0) | Descending()
            >>> [one.reason for one in cleaning.filters]
            ['spike_altitude', 'not_descending']
        """
        return Chain((self,)) | other


@dataclass(frozen=True)
class Chain:
    """Filters applied one after the other.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "altitude": [5000.0, 5025.0, 4950.0]})
        >>> from descentflow.surveillance.cleaning.descent_filters import Falling, LargestDescent
        >>> Chain((LargestDescent(), Falling()))(rows, DropReport())["altitude"].to_list()
        [5000.0, 4950.0]
    """

    filters: tuple[Filter, ...] = ()

    def __call__(self, rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
        """Apply them in order."""
        for one in self.filters:
            rows = one(rows, report)
        return rows

    def __or__(self, other: "Filter | Chain") -> "Chain":
        """These filters, then another."""
        return Chain(self.filters + (other.filters if isinstance(other, Chain) else (other,)))


@dataclass(frozen=True)
class Despike(Filter):
    """Drop rows with an isolated value: a Hampel filter over five reports (Hampel 1974).

    A value is a spike if it differs from the median of the five around it by more than `smallest` and by more than
    three robust standard deviations (1.4826 times their median absolute deviation). The median of monotone values is
    the middle one, so a steep path is no spike; at the ends of a flight, where there is no middle, the change that
    `fastest` allows within 5 reports is added to `smallest`.

    Rows in which IAS and Mach agree are no spikes of either, however far they are from their neighbours: where reports
    are sparse, an aircraft that accelerates and decelerates looks like one (seen in real flights), and two registers
    are not wrong in the same way.

    Args:
        column: The column.
        smallest: Smallest spike in the column's unit; far above noise and quantisation, so that smooth manoeuvres are
            no spikes.
        fastest: Fastest change per second that an aircraft makes.
        agreeing_kt: IAS and the CAS of Mach and altitude agree within this; None if their agreement does not count.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "timestamp": pl.from_epoch(pl.Series([0, 1, 2, 3, 4]))})
        >>> rows = rows.with_columns(altitude=pl.Series([5000.0, 4980.0, 9000.0, 4940.0, 4920.0]))
        >>> Despike("altitude", 300.0).keep(rows)["altitude"].to_list()
        [5000.0, 4980.0, 4940.0, 4920.0]
    """

    column: str
    smallest: float
    fastest: float = 0.0
    agreeing_kt: float | None = None

    @property
    def reason(self) -> str:  # type: ignore[override]
        """Named after the column."""
        return f"spike_{self.column}"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows that are no spikes; rows without the value are kept."""
        suspects = self._suspects(rows)
        if not suspects.any():
            return rows
        # Medians are computed for the few flights that can have a spike.
        spikes = np.zeros(len(rows), dtype=bool)
        some = np.isin(flights_of(rows), np.unique(flights_of(rows)[suspects]))
        spikes[some] = self._spikes(rows.filter(pl.Series(some))).to_numpy()
        if self.agreeing_kt is not None and spikes.any():
            spikes[spikes] = ~AirspeedsAgree(self.agreeing_kt).agree(rows.filter(pl.Series(spikes)))
        return rows.filter(pl.Series(~spikes))

    def _suspects(self, rows: pl.DataFrame) -> np.ndarray:
        """(n,) rows that two of the four around them exceed, or fall below, by more than `smallest`.

        No other row can be that far from a median of three to five values.
        """
        value, flight = rows[self.column].to_numpy(), flights_of(rows)
        above, below = np.zeros(len(value), dtype=np.int8), np.zeros(len(value), dtype=np.int8)
        for offset in (1, 2):
            step = value[offset:] - value[:-offset]
            same = flight[offset:] == flight[:-offset]
            up, down = same & (step > self.smallest), same & (step < -self.smallest)
            above[:-offset] += up
            below[offset:] += up
            below[:-offset] += down
            above[offset:] += down
        return np.asarray(np.maximum(above, below) >= 2)

    def _spikes(self, rows: pl.DataFrame) -> pl.Series:
        value = pl.col(self.column)
        first, last = SECONDS.shift(2).over(FLIGHT), SECONDS.shift(-2).over(FLIGHT)
        # At an end: seconds to the row four on, or over all of a flight that is shorter.
        ahead, behind = SECONDS.shift(-4).over(FLIGHT) - SECONDS, SECONDS - SECONDS.shift(4).over(FLIGHT)
        whole = (SECONDS.max() - SECONDS.min()).over(FLIGHT)
        reach = pl.when((last - first).is_null()).then(pl.min_horizontal(ahead, behind, whole)).otherwise(0.0)
        around = rows.with_columns(
            value.rolling_median(Fixed.hampel_rows, center=True, min_samples=3).over(FLIGHT).alias("_median"),
            (self.smallest + self.fastest * reach).alias("_smallest"),
        ).with_columns((value - pl.col("_median")).abs().alias("_off"))
        around = around.with_columns(
            pl.col("_off").rolling_median(Fixed.hampel_rows, center=True, min_samples=3).over(FLIGHT).alias("_mad")
        )
        spike = (pl.col("_off") > pl.col("_smallest")) & (
            pl.col("_off") > Fixed.hampel_deviations * 1.4826 * pl.col("_mad")
        )
        return around.select(spike.fill_null(False)).to_series()


@dataclass(frozen=True)
class AirspeedsAgree(Filter):
    """Drop rows whose IAS is not the CAS of their Mach number and pressure altitude.

    This shows a register decoded as another, or a Mach number kept from an earlier report. Position and instrument
    error, quantisation (1 kt, 0.004 Mach) and a few seconds between the two registers are well below the limit.

    Args:
        limit_kt: Largest difference of IAS and CAS.

    Example:
        >>> rows = pl.DataFrame({"altitude": 35000.0, "Mach": 0.78, "IAS": [264.0, 310.0]})
        >>> AirspeedsAgree(25.0).keep(rows)["IAS"].to_list()
        [264.0]
    """

    limit_kt: float = Cleaning.airspeeds_differ_kt
    reason = "IAS_contradicts_Mach"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows within the limit."""
        agree = self.agree(rows)
        return rows if agree.all() else rows.filter(pl.Series(agree))

    def agree(self, rows: pl.DataFrame) -> np.ndarray:
        """(n,) which rows are within the limit."""
        cas = cas_of_mach_kt(rows["Mach"].to_numpy(), rows["altitude"].to_numpy())
        return np.asarray(np.abs(rows["IAS"].to_numpy() - cas) <= self.limit_kt)
