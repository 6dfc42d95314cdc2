"""Managed stretches, where an autopilot holds a selected vertical rate."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.surveillance.cleaning.filters import FLIGHT, Filter, cut
from descentflow.surveillance.cleaning.windows import Index, clock_of, window_max, window_sum, windows
from descentflow.surveillance.rows.air_data import Array

Mask = NDArray[np.bool_]

SELECTABLE_FPM = 100.0
"""Step of the vertical rate that a pilot can select on a flight control unit or mode control panel."""
SIDE_S = 20.0
"""Time over which the rate is averaged on either side of a change."""
TURN_S = 4.0
"""Left out on either side of a change: the aircraft is turning onto its new path."""
SETTLE_S = 10.0
"""Left out at both ends of a stretch before it is judged."""
FEWEST_BESIDE = 3
"""Reports needed on either side for a change to be seen."""


@dataclass(frozen=True)
class FreeRate(Filter):
    """Drop managed stretches, where the vertical rate is held constant (paper, section 3).

    An idle descent's rate follows altitude and airspeed, but slowly: by some 60 ft/min in 90 s, hardly more than the
    noise of the reports. So a window of time cannot tell it from a held rate: judged by drift and scatter alone, two
    thirds of the idle rows of world flights pass for managed. What tells is how a rate begins and ends, for it is
    selected and given up at once. Flights are cut at gaps, and where the mean rates of the 20 s before and after
    differ by `jump_fpm` and more; the stretches between are judged whole. One is managed if

    - its rate is constant: a line fitted to it changes by at most `drift_fpm` from end to end, and the reports scatter
      about it by at most `scatter_fpm` (standard deviation; rates are quantised to 32 or 64 ft/min, or differenced
      from altitudes in steps of 25 ft);
    - its mean is within `offset_fpm` of a rate that can be selected (vertical-speed modes step by 100 ft/min);
    - and either it lasts `seconds`, and is shallower than a neighbour that it was cut from and steeper than none (less
      is selected than idle thrust gives; the change from Mach to CAS makes a descent shallower, but is not undone);
      or it lasts `seconds_alone`, whatever is beside it.

    On 1,500 world flights (A320, reports 4 s apart) it takes four fifths of the managed rows and 0.9 % of the idle
    ones (1.3 % where rates are differenced from altitude). In the hour over the Netherlands, held rates average to 987
    to 1,020 ft/min where 1,000 was clearly selected, drift by up to 79 and scatter by up to 55 ft/min.

    Unseen stay stretches of fewer than `fewest` reports, and managed descents that are not constant, as those that
    follow the geometry of an arrival.
    """

    seconds: float = 50.0
    seconds_alone: float = 180.0
    jump_fpm: float = 150.0
    drift_fpm: float = 80.0
    scatter_fpm: float = 64.0
    offset_fpm: float = 25.0
    fewest: int = 6
    longest_gap_s: float = 60.0
    reason = "constant_rate"

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows outside every managed stretch; :data:`STRETCH` changes where one stood."""
        if rows.is_empty():
            return rows
        flight = rows[FLIGHT].rle_id().to_numpy().astype(np.int64)
        seconds = (rows["timestamp"] - rows["timestamp"].min()).dt.total_microseconds().to_numpy() / 1e6
        return cut(rows, self.managed(flight, seconds, rows["vertical_rate"].to_numpy()))

    def managed(self, flight: Index, seconds: Array, rate_fpm: Array) -> Mask:
        """Which rows lie in a stretch of held rate.

        Args:
            flight: (n,) ascending number of the flight.
            seconds: (n,) ascending within a flight.
            rate_fpm: (n,).
        """
        clock = clock_of(flight, seconds)
        change = self._changes(clock, rate_fpm)
        starts = np.flatnonzero((change != 0) | (np.diff(clock, prepend=-np.inf) > self.longest_gap_s))
        begins, ends = change[starts], np.append(change[starts][1:], 0.0)
        beside = ((begins > 0) | (ends < 0)) & (begins >= 0) & (ends <= 0)
        constant, lasted = self._constant(clock, rate_fpm, starts, np.append(starts[1:], len(clock)))
        held = constant & ((lasted >= self.seconds_alone) | (beside & (lasted >= self.seconds)))
        return np.repeat(held, np.diff(starts, append=len(clock)))

    def _changes(self, clock: Array, rate_fpm: Array) -> Array:
        """Change of the mean rate at each row (positive where it gets shallower), zero if a larger one is near."""
        before = _means(rate_fpm, *windows(clock, -SIDE_S - TURN_S, -TURN_S), FEWEST_BESIDE)
        after = _means(rate_fpm, *windows(clock, TURN_S, SIDE_S + TURN_S), FEWEST_BESIDE)
        change = np.nan_to_num(after - before)
        largest = window_max(np.abs(change), *windows(clock, -SIDE_S, SIDE_S))
        return np.where((np.abs(change) >= self.jump_fpm) & (np.abs(change) == largest), change, 0.0)

    def _constant(self, clock: Array, rate_fpm: Array, first: Index, last: Index) -> tuple[Mask, Array]:
        """Which stretches hold a selectable rate, and how long each lasts without its ends (s)."""
        begin, end = clock[first], clock[last - 1]
        first, last = (
            np.searchsorted(clock, begin + SETTLE_S),
            np.searchsorted(clock, end - SETTLE_S, side="right"),
        )
        last = np.maximum(first, last)
        # Time since the stretch's begin is small, and so keeps the digits of its squares.
        time = clock - np.repeat(begin, np.diff(np.append(np.searchsorted(clock, begin), len(clock))))
        n, t, r, tt, tr, rr = (
            window_sum(values, first, last)
            for values in (np.ones_like(time), time, rate_fpm, time**2, time * rate_fpm, rate_fpm**2)
        )
        enough = n >= max(self.fewest, 3)
        n = np.maximum(n, 1)
        spread = np.maximum(tt - t * t / n, 1e-9)
        slope = (tr - t * r / n) / spread
        rest = np.maximum(rr - r * r / n - slope**2 * spread, 0.0) / np.maximum(n - 2, 1)
        lasted = np.where(enough, clock[np.maximum(last, 1) - 1] - clock[np.minimum(first, len(clock) - 1)], 0.0)
        off = np.abs(r / n - SELECTABLE_FPM * np.round(r / n / SELECTABLE_FPM))
        constant = (np.abs(slope) * lasted <= self.drift_fpm) & (rest <= self.scatter_fpm**2)
        return enough & constant & (off <= self.offset_fpm), lasted


def _means(values: Array, first: Index, last: Index, fewest: int) -> Array:
    """Mean of values[first:last] for every window, NaN for those of fewer than `fewest`."""
    count = last - first
    return np.where(count >= fewest, window_sum(values, first, last) / np.maximum(count, 1), np.nan)
