"""Vertical rate from altitude, for sources that report none."""

import numpy as np
import polars as pl

from descentflow.surveillance.airdata import Array
from descentflow.surveillance.windows import time_in_flight, window_sum, windows

WINDOWS_S = (5.0, 10.0, 20.0, 40.0)
"""Half-widths tried in turn."""
FEWEST = 4
"""Reports that a window must hold."""
SPAN_S = 8.0
"""Seconds that they must span: 25 ft of quantisation over 8 s are 190 ft/min, averaged down by the fit."""


def with_rate(rows: pl.DataFrame) -> pl.DataFrame:
    """Fill missing `vertical_rate` (ft/min) by a local line through the altitudes.

    For each row, a least-squares line is fitted to the reports of the same flight within the narrowest of +-5, 10, 20
    and 40 s that holds at least four of them over at least 8 s. Altitude spikes must be gone before: one of 1,000 ft
    would bend the line. Where no window suffices the rate stays missing.

    Args:
        rows: Sorted by flight and time, columns `flight_id timestamp altitude`.
    """
    if "vertical_rate" not in rows.columns:
        rows = rows.with_columns(pl.lit(None, pl.Float64).alias("vertical_rate"))
    absent = rows["vertical_rate"].is_null()
    if not absent.any():
        return rows
    flight = rows["flight_id"].rle_id().to_numpy()
    seconds = rows["timestamp"].dt.epoch("us").to_numpy() / 1e6
    fitted = pl.Series(60 * local_slope(flight, seconds, rows["altitude"].to_numpy())).fill_nan(None)
    return rows.with_columns(pl.coalesce("vertical_rate", fitted.alias("vertical_rate")))


def local_slope(flight: np.ndarray, seconds: Array, values: Array) -> Array:
    """Slope of a local line at each row (per second); NaN where too few rows are near.

    Args:
        flight: (n,) number of the flight, equal for the rows of one flight, which stand together.
        seconds: (n,) ascending within a flight.
        values: (n,).
    """
    slope = np.full(len(values), np.nan)
    if len(values) == 0:
        return slope
    time = time_in_flight(flight, seconds)
    level = values - values.mean()
    products = (time, level, time**2, time * level)
    for half in WINDOWS_S:
        first, last = windows(flight, time, half, half)
        count = last - first
        sum_t, sum_v, sum_tt, sum_tv = (window_sum(value, first, last) for value in products)
        spread = sum_tt - sum_t**2 / count
        enough = (count >= FEWEST) & (time[last - 1] - time[first] >= SPAN_S) & np.isnan(slope)
        slope[enough] = ((sum_tv - sum_t * sum_v / count)[enough]) / spread[enough]
        if not np.isnan(slope).any():
            break
    return slope
