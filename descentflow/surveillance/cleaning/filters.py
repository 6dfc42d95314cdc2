"""Filters of rows: small classes that compose with ``|``, each with its reason and its count.

A filter sees rows sorted by flight and time and says which to keep. ``a | b`` applies `a`, then `b`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.windows import PAUSE_S, clock_of
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

FLIGHT = "flight_id"
STRETCH = "_stretch"
"""Column that numbers the stretches of free descent in a flight: levels between two stretches are not bridged, or a
level-off's time would stand in a free descent."""
SECONDS = pl.col("timestamp").dt.epoch("us") / 1e6


def flights_of(rows: pl.DataFrame) -> np.ndarray:
    """Ascending number of every row's flight, which the column may hold itself."""
    name = rows[FLIGHT]
    if name.dtype.is_integer():
        return name.cast(pl.Int64).to_numpy()
    return (name != name.shift()).fill_null(True).cum_sum().cast(pl.Int64).to_numpy()


def cut(rows: pl.DataFrame, gone: np.ndarray) -> pl.DataFrame:
    """Drop rows of a descent; :data:`STRETCH` changes where some stood."""
    if not gone.any():
        return rows
    dropped = pl.Series(gone)
    if STRETCH in rows.columns:
        rows = rows.with_columns((pl.col(STRETCH) + dropped.cast(pl.Int64).cum_sum()).alias(STRETCH))
    return rows.filter(~dropped)


class Filter(ABC):
    """Keep some rows, count the others under :attr:`reason`."""

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
            >>> cleaning = Despike("altitude", 300.0) | Descending()
        """
        return Chain((self,)) | other


@dataclass(frozen=True)
class Chain:
    """Filters one after the other."""

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
    """Drop rows whose value stands alone: a Hampel filter over five reports (Hampel 1974).

    A value is a spike if it differs from the median of the five around it by more than `floor` and by more than three
    robust standard deviations (1.4826 times their median absolute deviation). The median of a monotone stretch is its
    middle, so a steep path is no spike; at the ends of a flight, where there is no middle, the change that `fastest`
    allows within 5 reports is added to `floor`.

    Of IAS and Mach, rows in which the two agree are no spikes, however far they stand out: where reports are sparse an
    aircraft that hurries and slows down looks like one (real flights showed it), and two registers do not err alike.
    """

    column: str
    floor: float
    """In the column's unit; far above noise and quantisation, so that smooth manoeuvres are never spikes."""
    fastest: float = 0.0
    """Fastest change a second that an aircraft makes."""
    agreeing_kt: float | None = None
    """IAS and the CAS of Mach and altitude agree within this; none to let them not witness for each other."""

    @property
    def reason(self) -> str:  # type: ignore[override]
        """Named after the column."""
        return f"spike_{self.column}"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows that are no spikes, or miss the value."""
        suspects = self._suspects(rows)
        if not suspects.any():
            return rows
        # The medians are worked out for the few flights that can hold a spike.
        spikes = np.zeros(len(rows), dtype=bool)
        some = np.isin(flights_of(rows), np.unique(flights_of(rows)[suspects]))
        spikes[some] = self._spikes(rows.filter(pl.Series(some))).to_numpy()
        if self.agreeing_kt is not None and spikes.any():
            spikes[spikes] = ~AirspeedsAgree(self.agreeing_kt).agree(rows.filter(pl.Series(spikes)))
        return rows.filter(pl.Series(~spikes))

    def _suspects(self, rows: pl.DataFrame) -> np.ndarray:
        """Rows that two of the four around them exceed, or fall below, by more than the floor.

        No other row can be that far from a median of three to five values.
        """
        value, flight = rows[self.column].to_numpy(), flights_of(rows)
        above, below = np.zeros(len(value), dtype=np.int8), np.zeros(len(value), dtype=np.int8)
        for offset in (1, 2):
            step = value[offset:] - value[:-offset]
            same = flight[offset:] == flight[:-offset]
            up, down = same & (step > self.floor), same & (step < -self.floor)
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
            value.rolling_median(5, center=True, min_samples=3).over(FLIGHT).alias("_median"),
            (self.floor + self.fastest * reach).alias("_floor"),
        ).with_columns((value - pl.col("_median")).abs().alias("_off"))
        around = around.with_columns(
            pl.col("_off").rolling_median(5, center=True, min_samples=3).over(FLIGHT).alias("_mad")
        )
        spike = (pl.col("_off") > pl.col("_floor")) & (pl.col("_off") > 3 * 1.4826 * pl.col("_mad"))
        return around.select(spike.fill_null(False)).to_series()


@dataclass(frozen=True)
class AirspeedsAgree(Filter):
    """Drop rows whose IAS is not the CAS of their Mach number and pressure altitude.

    A register decoded as another, or a Mach held over from an earlier report, shows here. Position and instrument
    error, quantisation (1 kt, 0.004 Mach) and a few seconds between the two registers stay well below the limit.
    """

    limit_kt: float = 25.0
    reason = "IAS_contradicts_Mach"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows within the limit."""
        agree = self.agree(rows)
        return rows if agree.all() else rows.filter(pl.Series(agree))

    def agree(self, rows: pl.DataFrame) -> np.ndarray:
        """Which rows are within the limit."""
        cas = cas_of_mach_kt(rows["Mach"].to_numpy(), rows["altitude"].to_numpy())
        return np.asarray(np.abs(rows["IAS"].to_numpy() - cas) <= self.limit_kt)


@dataclass(frozen=True)
class Descending(Filter):
    """Keep rows that descend at 500 ft/min or more (paper, section 3): level-offs and climbs go.

    Adds `_since_level` and `_until_level`: seconds from the last, and to the next, row of the flight that did not
    descend so; and :data:`STRETCH`, which changes where such a row stood.
    """

    slowest_fpm: float = 500.0
    reason = "not_descending"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows with a rate of at most -`slowest_fpm`; rows without a rate go too."""
        descends = rows["vertical_rate"].to_numpy() <= -self.slowest_fpm
        clock = clock_of(flights_of(rows), rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
        since = clock - np.maximum.accumulate(np.where(descends, -np.inf, clock))
        until = np.minimum.accumulate(np.where(descends, np.inf, clock)[::-1])[::-1] - clock
        timed = rows.with_columns(
            pl.Series("_since_level", since),
            pl.Series("_until_level", until),
            pl.Series(STRETCH, np.cumsum(~descends), dtype=pl.Int64),
        ).filter(pl.Series(descends))
        # Of another flight, or none at all.
        beyond = pl.col("_since_level", "_until_level")
        return timed.with_columns(pl.when(beyond < PAUSE_S / 2).then(beyond))


@dataclass(frozen=True)
class SteadyDescent(Filter):
    """Drop the transients at the top and the bottom of a descent, and beside level-offs (paper, section 3).

    A transport aircraft takes some 20 s to settle into, or to leave, its descent (0.05 to 0.1 g); during them its
    rate says little of thrust and drag.
    """

    transient_s: float = 20.0
    reason = "transient"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows further than `transient_s` from any row that did not descend."""
        steady = [(pl.col(name) >= self.transient_s).fill_null(True) for name in ("_since_level", "_until_level")]
        return rows.filter(steady[0] & steady[1]).drop("_since_level", "_until_level")


@dataclass(frozen=True)
class LargestDescent(Filter):
    """Of a flight that climbs back and descends again, keep the descent of the largest span."""

    climb_back_ft: float = 1000.0
    reason = "second_descent"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows of the descent with the largest difference of altitudes."""
        # Climbing rows are gone by now: a climb is a jump upwards between two descending rows.
        altitude, flight = rows["altitude"].to_numpy(), flights_of(rows)
        if not ((np.diff(altitude) > self.climb_back_ft) & (flight[1:] == flight[:-1])).any():
            return rows
        number = (pl.col("altitude").diff() > self.climb_back_ft).fill_null(False).cum_sum().over(FLIGHT)
        span = (pl.col("altitude").max() - pl.col("altitude").min()).over(FLIGHT, "_descent")
        numbered = rows.with_columns(number.alias("_descent")).with_columns(span.alias("_span"))
        largest = pl.col("_descent") == pl.col("_descent").sort_by("_span", descending=True).first().over(FLIGHT)
        return numbered.filter(largest).drop("_descent", "_span")


@dataclass(frozen=True)
class Falling(Filter):
    """Drop rows that are not below every earlier row of the descent (25 ft of quantisation make some)."""

    reason = "not_below_earlier_row"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows at a new lowest altitude."""
        # Each flight is put below all before it, so that one running minimum serves them all.
        height = rows["altitude"].to_numpy() - 1e6 * flights_of(rows)
        lowest = np.minimum.accumulate(np.concatenate([[np.inf], height[:-1]])) if len(rows) else height
        return rows.filter(pl.Series(height < lowest))
