"""Filters that find the free descent in a flight: rows of one steady descent, without turns or clearances."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import FLIGHT, PAUSE_S, SEGMENT, Filter, clock_of, cut, flights_of
from descentflow.surveillance.cleaning.thresholds import Cleaning

MACH_PER_KT = 0.002
"""Mach number that counts as much as 1 kt of an assigned speed: 0.0019 at FL150, 0.0027 at FL350."""


@dataclass(frozen=True)
class Descending(Filter):
    """Keep rows that descend at 500 ft/min or more (paper, section 3): level-offs and climbs are dropped.

    Adds `_since_level` and `_until_level`, seconds from the last and to the next row of the flight that does not
    descend so, and `SEGMENT`: a new one begins after each dropped row.
    """

    slowest_fpm: float = Cleaning.slowest_fpm
    reason = "not_descending"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows with a rate of at most -`slowest_fpm`; rows without a rate are dropped."""
        descends = rows["vertical_rate"].to_numpy() <= -self.slowest_fpm
        clock = clock_of(flights_of(rows), rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
        since = clock - np.maximum.accumulate(np.where(descends, -np.inf, clock))
        until = np.minimum.accumulate(np.where(descends, np.inf, clock)[::-1])[::-1] - clock
        timed = rows.with_columns(
            pl.Series("_since_level", since),
            pl.Series("_until_level", until),
            pl.Series(SEGMENT, np.cumsum(~descends), dtype=pl.Int64),
        ).filter(pl.Series(descends))
        # Of another flight, or none at all.
        beyond = pl.col("_since_level", "_until_level")
        return timed.with_columns(pl.when(beyond < PAUSE_S / 2).then(beyond))


@dataclass(frozen=True)
class SteadyDescent(Filter):
    """Drop the transients at the top and the bottom of a descent, and next to level-offs (paper, section 3).

    A transport aircraft takes some 20 s to enter or to leave its descent (0.05 to 0.1 g); in this time its rate carries
    little about thrust and drag.
    """

    transient_s: float = Cleaning.transient_s
    reason = "transient"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows further than `transient_s` from any row that did not descend."""
        steady = [(pl.col(name) >= self.transient_s).fill_null(True) for name in ("_since_level", "_until_level")]
        return rows.filter(steady[0] & steady[1]).drop("_since_level", "_until_level")


@dataclass(frozen=True)
class LargestDescent(Filter):
    """Keep the largest descent of a flight that climbs and descends again."""

    climb_back_ft: float = Cleaning.climb_back_ft
    reason = "second_descent"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows of the descent with the largest difference of altitudes."""
        # Climbing rows have been dropped: a climb is a step upwards between two descending rows.
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
    """Drop rows that are not below every earlier row of the descent (quantisation to 25 ft makes some)."""

    reason = "not_below_earlier_row"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows at a new lowest altitude."""
        # Each flight is shifted below all before it, so that one running minimum serves all of them.
        height = rows["altitude"].to_numpy() - 1e6 * flights_of(rows)
        lowest = np.minimum.accumulate(np.concatenate([[np.inf], height[:-1]])) if len(rows) else height
        return rows.filter(pl.Series(height < lowest))


@dataclass(frozen=True)
class ClearedSpeed(Filter):
    """Drop rows under an assigned speed, and for a while after it: the speed is not the aircraft's own choice.

    An assigned speed counts from its issue to its end if the aircraft comes within `within_kt` of it in this time
    (0.002 Mach per kt). One that it never comes close to is no constraint: "280 kt or less" is none for an aircraft
    that flies 260. Only sources with clearances know (:data:`~descentflow.surveillance.rows.schema.INSTRUCTIONS`).
    """

    after_s: float
    within_kt: float = Cleaning.cleared_speed_within_kt
    reason = "cleared_speed"
    uses = ("cleared_speed_kt", "cleared_mach")

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows without an assigned speed; a new segment begins after each dropped row."""
        limits = {"cleared_speed_kt": ("IAS", 1.0), "cleared_mach": ("Mach", MACH_PER_KT)}
        known = {name: limit for name, limit in limits.items() if name in rows.columns and rows[name].count()}
        if rows.is_empty() or not known:
            return rows
        flight = flights_of(rows)
        clock = clock_of(flight, rows["timestamp"].dt.epoch("us").to_numpy() / 1e6)
        under = np.zeros(len(rows), dtype=bool)
        for name, (flown, step) in known.items():
            cleared = rows[name].to_numpy()
            # Missing values differ from each other, so each is a run of its own.
            begins = np.flatnonzero((cleared != np.roll(cleared, 1)) | (np.diff(flight, prepend=-1) != 0))
            near = np.abs(rows[flown].to_numpy() - cleared) <= self.within_kt * step
            under |= np.repeat(np.logical_or.reduceat(near, begins), np.diff(begins, append=len(rows)))
        last = np.maximum.accumulate(np.where(under, clock, -np.inf))
        return cut(rows, under | (clock - last <= self.after_s))
