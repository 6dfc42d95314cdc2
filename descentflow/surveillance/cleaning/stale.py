"""Values that a source repeats although the other channels show that they have changed."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import Filter, flights_of
from descentflow.surveillance.cleaning.thresholds import Cleaning, Fixed
from descentflow.surveillance.cleaning.windows import Index, clock_of
from descentflow.surveillance.rows.air_data import Array, cas_of_mach_kt, mach_of_cas


@dataclass(frozen=True)
class Stale(Filter):
    """Drop the repetitions of a value while the other channels show that it changes.

    A run of one value, repeated exactly for `seconds` or more without a gap, is no fault by itself: airspeed is held
    in a descent, altitude in level flight. It is stale if the value that the others imply changes by `moved` meanwhile:

    - IAS: the CAS of Mach number and altitude; Mach: the Mach number of IAS and altitude;
    - altitude: the median reported rate times the time; vertical rate: itself times the time, against the altitude.

    The first row of a stale run is kept, as it was new once; the others are dropped. If two channels are repeated at
    the same time the run is dropped, whichever is at fault.

    Args:
        column: `altitude`, `IAS`, `Mach` or `vertical_rate`.
        moved: Smallest change of the implied value, in the column's unit (ft for `vertical_rate`).
        seconds: Shortest run.
        longest_gap_s: Longest time between two reports of a run.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "timestamp": pl.from_epoch(pl.Series([0, 15, 30]))})
        >>> altitude, mach = pl.Series([30000.0, 28500.0, 27000.0]), pl.Series([0.75, 0.70, 0.65])
        >>> rows = rows.with_columns(altitude=altitude, Mach=mach, IAS=283.0)
        >>> Stale("IAS", moved=8.0).keep(rows)["altitude"].to_list()
        [30000.0]
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
        allowed = self.moved + Fixed.stale_rate_fpm / 60 * lasted
        rate = rows["vertical_rate"].to_numpy()
        if self.column == "altitude":
            run = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(time)))
            middle = rows.group_by(pl.Series("run", run), maintain_order=True).agg(pl.col("vertical_rate").median())
            return np.asarray(np.nan_to_num(np.abs(middle["vertical_rate"].to_numpy()) / 60 * lasted) > allowed)
        made = altitude - np.repeat(altitude[starts], np.diff(starts, append=len(time)))
        off = np.maximum.reduceat(np.abs(made - rate / 60 * time) - Fixed.stale_height_share * np.abs(made), starts)
        return np.asarray(off > allowed)
