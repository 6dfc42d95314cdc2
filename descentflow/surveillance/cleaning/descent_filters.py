"""Filters that find the free descent in a flight: which rows descend, steadily, in one descent, each below the last."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import FLIGHT, SEGMENT, Filter, flights_of
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.cleaning.windows import PAUSE_S, clock_of


@dataclass(frozen=True)
class Descending(Filter):
    """Keep rows that descend at 500 ft/min or more (paper, section 3): level-offs and climbs are dropped.

    Adds `_since_level` and `_until_level`, seconds from the last and to the next row of the flight that does not
    descend so, and `SEGMENT`: a new one begins after each dropped row.

    Args:
        slowest_fpm: Slowest rate of descent.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "timestamp": pl.from_epoch(pl.Series([0, 10, 20]))})
        >>> rows = rows.with_columns(vertical_rate=pl.Series([0.0, -900.0, -1500.0]))
        >>> Descending().keep(rows).select("vertical_rate", "_since_level").rows()
        [(-900.0, 10.0), (-1500.0, 20.0)]
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
    """Drop the transients at the top and the bottom of a descent, and beside level-offs (paper, section 3).

    A transport aircraft takes some 20 s to enter or to leave its descent (0.05 to 0.1 g); in this time its rate carries
    little about thrust and drag.

    Args:
        transient_s: Time dropped.

    Example:
        >>> rows = pl.DataFrame({"altitude": [34900.0, 34500.0], "_since_level": [10.0, 30.0], "_until_level": 600.0})
        >>> SteadyDescent(20.0).keep(rows)["altitude"].to_list()
        [34500.0]
    """

    transient_s: float = Cleaning.transient_s
    reason = "transient"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows further than `transient_s` from any row that did not descend."""
        steady = [(pl.col(name) >= self.transient_s).fill_null(True) for name in ("_since_level", "_until_level")]
        return rows.filter(steady[0] & steady[1]).drop("_since_level", "_until_level")


@dataclass(frozen=True)
class LargestDescent(Filter):
    """Keep the largest descent of a flight that climbs and descends again.

    Args:
        climb_back_ft: Climb that separates two descents.

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "altitude": [5000.0, 3000.0, 9000.0, 2000.0]})
        >>> LargestDescent().keep(rows)["altitude"].to_list()
        [9000.0, 2000.0]
    """

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
    """Drop rows that are not below every earlier row of the descent (quantisation to 25 ft makes some).

    Example:
        >>> rows = pl.DataFrame({"flight_id": 1, "altitude": [5000.0, 5025.0, 4950.0]})
        >>> Falling().keep(rows)["altitude"].to_list()
        [5000.0, 4950.0]
    """

    reason = "not_below_earlier_row"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows at a new lowest altitude."""
        # Each flight is shifted below all before it, so that one running minimum serves all of them.
        height = rows["altitude"].to_numpy() - 1e6 * flights_of(rows)
        lowest = np.minimum.accumulate(np.concatenate([[np.inf], height[:-1]])) if len(rows) else height
        return rows.filter(pl.Series(height < lowest))
