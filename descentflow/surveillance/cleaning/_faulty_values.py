"""Filters of faulty values: isolated spikes, values that a source repeats, and airspeeds that contradict each other."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import FLIGHT, SECONDS, Filter, Index, clock_of, flights_of
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.air_data import Array, cas_of_mach_kt, mach_of_cas

HAMPEL_REPORTS, HAMPEL_DEVIATIONS = 5, 3.0
"""Reports in the window of a Hampel filter, and robust standard deviations from the median that make a spike (Hampel
1974, JASA 69)."""
STALE_RATE_FPM, STALE_HEIGHT_SHARE = 100.0, 0.1
"""Rate by which altitude and reported rate may differ for any time (steps of 64 ft/min and their bias), and share of
the height besides (inertial rates in air 25 K off the standard atmosphere differ by a tenth)."""


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
            value.rolling_median(HAMPEL_REPORTS, center=True, min_samples=3).over(FLIGHT).alias("_median"),
            (self.smallest + self.fastest * reach).alias("_smallest"),
        ).with_columns((value - pl.col("_median")).abs().alias("_off"))
        around = around.with_columns(
            pl.col("_off").rolling_median(HAMPEL_REPORTS, center=True, min_samples=3).over(FLIGHT).alias("_mad")
        )
        spike = (pl.col("_off") > pl.col("_smallest")) & (pl.col("_off") > HAMPEL_DEVIATIONS * 1.4826 * pl.col("_mad"))
        return around.select(spike.fill_null(False)).to_series()


@dataclass(frozen=True)
class AirspeedsAgree(Filter):
    """Drop rows whose IAS is not the CAS of their Mach number and pressure altitude.

    This shows a register decoded as another, or a Mach number kept from an earlier report. Position and instrument
    error, quantisation (1 kt, 0.004 Mach) and a few seconds between the two registers are well below the limit.
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


@dataclass(frozen=True)
class Stale(Filter):
    """Drop the repetitions of a value while the other channels show that it changes.

    A run of one value, repeated exactly for `seconds` or more without a gap, is no fault by itself: airspeed is held
    in a descent, altitude in level flight. It is stale if the value that the others imply changes by `moved` meanwhile:

    - IAS: the CAS of Mach number and altitude; Mach: the Mach number of IAS and altitude;
    - altitude: the median reported rate times the time; vertical rate: itself times the time, against the altitude.

    The first row of a stale run is kept, as it was new once; the others are dropped. If two channels are repeated at
    the same time the run is dropped, whichever is at fault.
    """

    column: str
    moved: float
    seconds: float = Cleaning.stale_s
    longest_gap_s: float = Cleaning.longest_gap_s

    @property
    def reason(self) -> str:  # type: ignore[override]
        """Named after the column."""
        return f"stale_{self.column}"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows that do not repeat a stale value; rows without the value are kept."""
        if self.column not in rows.columns or ("vertical_rate" not in rows.columns and self.column == "altitude"):
            return rows
        stale = self._stale(rows)
        return rows.filter(pl.Series(~stale)) if stale.any() else rows

    def _stale(self, rows: pl.DataFrame) -> np.ndarray:
        value = rows[self.column].to_numpy()
        clock = clock_of(flights_of(rows), rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
        stale = np.zeros(len(rows), dtype=bool)
        # Missing values differ from each other; the time between flights is a gap.
        begins = np.flatnonzero((value != np.roll(value, 1)) | (np.diff(clock, prepend=-np.inf) > self.longest_gap_s))
        sizes = np.diff(begins, append=len(value))
        lasted = clock[begins + sizes - 1] - clock[begins]
        suspect = lasted >= self.seconds
        if not suspect.any():
            return stale
        begins, sizes, lasted = begins[suspect], sizes[suspect], lasted[suspect]
        # Indices of the suspect rows, run by run.
        starts = np.cumsum(sizes) - sizes
        places = np.repeat(begins - starts, sizes) + np.arange(sizes.sum())
        some = rows.select(
            pl.col(name) for name in ("altitude", "IAS", "Mach", "vertical_rate") if name in rows.columns
        )
        wrong = self._moves(some[places], clock[places] - np.repeat(clock[begins], sizes), starts, lasted)
        repeats = np.repeat(wrong, sizes)
        repeats[starts] = False
        stale[places[repeats]] = True
        return stale

    def _moves(self, rows: pl.DataFrame, time: Array, starts: Index, lasted: Array) -> np.ndarray:
        """Mask of runs that the other channels contradict.

        Args:
            rows: (n,) of all suspect runs.
            time: (n,) seconds since the run began.
            starts: (m,) where each run begins in them.
            lasted: (m,) seconds.
        """
        altitude = rows["altitude"].to_numpy()
        if self.column in ("IAS", "Mach"):
            other = rows["Mach" if self.column == "IAS" else "IAS"].to_numpy()
            implied = cas_of_mach_kt(other, altitude) if self.column == "IAS" else mach_of_cas(other, altitude)
            return np.asarray(np.maximum.reduceat(implied, starts) - np.minimum.reduceat(implied, starts) > self.moved)
        allowed = self.moved + STALE_RATE_FPM / 60 * lasted
        rate = rows["vertical_rate"].to_numpy()
        if self.column == "altitude":
            run = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(time)))
            middle = rows.group_by(pl.Series("run", run), maintain_order=True).agg(pl.col("vertical_rate").median())
            return np.asarray(np.nan_to_num(np.abs(middle["vertical_rate"].to_numpy()) / 60 * lasted) > allowed)
        made = altitude - np.repeat(altitude[starts], np.diff(starts, append=len(time)))
        off = np.maximum.reduceat(np.abs(made - rate / 60 * time) - STALE_HEIGHT_SHARE * np.abs(made), starts)
        return np.asarray(off > allowed)
