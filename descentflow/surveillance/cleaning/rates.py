"""Vertical rate from altitude, for sources that report none."""

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.thresholds import Fixed
from descentflow.surveillance.cleaning.windows import Index, clock_of, window_sum, windows
from descentflow.surveillance.rows.air_data import Array

ALTITUDE_ERROR_FT = Fixed.altitude_step_ft / 12**0.5
"""Standard deviation of altitude rounded to its step."""


def with_rate(rows: pl.DataFrame) -> pl.DataFrame:
    """Fill missing `vertical_rate` (ft/min) with the slope of a local line through the altitudes.

    For each row, a least-squares line is fitted to the reports of the same flight within +-5 s; if quantisation to 25
    ft leaves its slope uncertain by more than 50 ft/min, within +-10, 20, 30 and at last 60 s. The window is therefore
    as narrow as the reports allow: +-10 s where they come every second, the two neighbours where they come every 30 s.
    Altitude spikes must have been removed: one of 1,000 ft would bend the line. Where no window suffices the rate
    remains missing.

    Args:
        rows: Sorted by flight and time, columns `flight_id timestamp altitude`.

    Returns:
        The rows with the column `vertical_rate`.

    Example:
        >>> from datetime import datetime
        >>> times = [datetime(2024, 3, 1, 12, minute, 0) for minute in range(3)]
        >>> rows = pl.DataFrame({"flight_id": ["a"] * 3, "timestamp": times, "altitude": [20e3, 18.5e3, 17e3]})
        >>> with_rate(rows)["vertical_rate"].round(6).to_list()
        [-1500.0, -1500.0, -1500.0]
    """
    if "vertical_rate" not in rows.columns:
        rows = rows.with_columns(pl.lit(None, pl.Float64).alias("vertical_rate"))
    absent = rows["vertical_rate"].is_null()
    if not absent.any():
        return rows
    flight = rows["flight_id"].rle_id().to_numpy().astype(np.int64)
    seconds = rows["timestamp"].dt.epoch("us").to_numpy() / 1e6
    fitted = pl.Series(60 * local_slope(flight, seconds, rows["altitude"].to_numpy())).fill_nan(None)
    return rows.with_columns(pl.coalesce("vertical_rate", fitted.alias("vertical_rate")))


def local_slope(flight: Index, seconds: Array, values: Array) -> Array:
    """Slope of a local line at each row (per second); NaN where too few rows are near.

    Args:
        flight: (n,) number of the flight, equal for the rows of one flight, which are neighbours.
        seconds: (n,) ascending within a flight.
        values: (n,) in ft.

    Returns:
        (n,) in ft/s.

    Example:
        >>> local_slope(np.zeros(3, dtype=int), np.array([0.0, 30.0, 60.0]), np.array([900.0, 600.0, 300.0])).round(9)
        array([-10., -10., -10.])
    """
    slope = np.full(len(values), np.nan)
    clock = clock_of(flight, seconds)
    begins = np.flatnonzero(np.diff(flight, prepend=flight[:1] - 1))
    sizes = np.diff(begins, append=len(flight))
    # Within a flight both are small, so that squares and products keep their digits.
    time, height = clock - np.repeat(clock[begins], sizes), values - np.repeat(values[begins], sizes)
    products = (time, height, time**2, time * height)
    rows = np.arange(len(values))
    for half in Fixed.rate_windows_s:
        first, last = (ends[rows] for ends in windows(clock, -half, half))
        count = last - first
        sum_t, sum_v, sum_tt, sum_tv = (window_sum(value, first, last) for value in products)
        spread = sum_tt - sum_t**2 / count
        enough = spread >= (60 * ALTITUDE_ERROR_FT / Fixed.rate_error_fpm) ** 2
        slope[rows[enough]] = ((sum_tv - sum_t * sum_v / count)[enough]) / spread[enough]
        rows = rows[~enough]
        if not len(rows):
            break
    return slope
