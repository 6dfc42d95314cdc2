"""Free descents on flight levels: interpolation between rows; levels in gaps are left out."""

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import SEGMENT, flights_of
from descentflow.surveillance.cleaning.rates import ALTITUDE_STEP_FT
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.airspeed_source import REPORTED
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import CHANNELS

CIRCULAR = {"track": 0.0, "heading": 0.0, "wind_direction": 0.0, "longitude": -180.0}
"""Angles, interpolated along the shorter arc, and the least that each has."""


def to_levels(rows: pl.DataFrame, rules: Cleaning, report: DropReport) -> pl.DataFrame:
    """Interpolate every descent linearly in altitude to whole flight levels (paper, section 2.2).

    Two neighbouring rows bridge the levels between them unless they are further apart than `longest_gap_s` or
    `highest_gap_ft`, or rows between them were dropped (a new segment begins), or a level-off may be hidden there: over
    a gap of more than `hidden_gap_s` the mean rate is less than `slowest_fpm`. Then these levels have no row.

    Args:
        rows: Sorted by flight and time, altitude falling strictly within a flight.
        rules: Thresholds of gaps, and the lowest level.
        report: Takes the number of gaps that are not bridged.

    Returns:
        One row per flight and level, sorted by flight and falling level: `flight_id icao24 typecode callsign level_fl
        timestamp time_s` and the channels that the rows have.

    Example:
        >>> from datetime import datetime
        >>> times = [datetime(2024, 3, 1, 12, 0, second) for second in (0, 20)]
        >>> rows = pl.DataFrame({"flight_id": ["a", "a"], "timestamp": times, "altitude": [20_250.0, 19_950.0]})
        >>> to_levels(rows, Cleaning(), DropReport())["level_fl"].to_list()
        [202, 201, 200]
    """
    flight = flights_of(rows)
    altitude_fl = rows["altitude"].to_numpy() / 100.0
    micros = rows["timestamp"].dt.epoch("us").to_numpy()
    gap_s, gap_fl = np.diff(micros) / 1e6, -np.diff(altitude_fl)
    same = flight[1:] == flight[:-1]
    bridged = same & (gap_s <= rules.longest_gap_s) & (gap_fl * 100 <= rules.highest_gap_ft)
    # Half a step of quantisation may be missing from the height at either end.
    falls = 60 * (gap_fl * 100 + ALTITUDE_STEP_FT) >= rules.slowest_fpm * gap_s
    bridged &= (gap_s <= rules.hidden_gap_s) | falls
    segment = np.diff(rows[SEGMENT].to_numpy()) if SEGMENT in rows.columns else np.zeros(len(same), dtype=np.int64)
    report.note("gaps of reception left open", int((same & (segment == 0) & ~bridged).sum()))
    report.note("level or held stretches left open", int((same & (segment != 0)).sum()))
    bridged &= segment == 0
    # The interval from a row down to the next: levels above or at the next row and strictly below this one, so that the
    # level of a row is counted once; the first row of a segment adds its own level.
    top, low = np.ceil(altitude_fl[:-1]) - 1, np.ceil(altitude_fl[1:])
    starts = np.concatenate([[True], ~bridged]) if len(flight) else np.zeros(0, dtype=bool)
    own = starts[:-1] & (altitude_fl[:-1] == np.floor(altitude_fl[:-1]))
    top = np.where(own, altitude_fl[:-1], top)
    count = np.where(bridged, np.maximum(top - np.maximum(low, rules.bottom_fl) + 1, 0), 0).astype(np.int64)
    upper = np.repeat(np.arange(len(count)), count)
    order = np.arange(len(upper)) - np.repeat(np.cumsum(count) - count, count)
    level = np.repeat(top, count) - order
    share = (altitude_fl[upper] - level) / (altitude_fl[upper] - altitude_fl[upper + 1])
    crossing = micros[upper] + share * (micros[upper + 1] - micros[upper])
    columns: dict[str, object] = {
        name: rows[name].gather(upper)
        for name in ("flight_id", "icao24", "typecode", "callsign")
        if name in rows.columns
    }
    if "airspeed_source" in rows.columns:
        # Between a reported airspeed and a derived one lies a derived one.
        above, below = (rows["airspeed_source"].gather(at) for at in (upper, upper + 1))
        columns["airspeed_source"] = pl.select(pl.when(above == REPORTED).then(below).otherwise(above)).to_series()
    columns |= {"level_fl": level.astype(np.int32), "timestamp": pl.Series(crossing.round().astype(np.int64))}
    for name in CHANNELS:
        if name in rows.columns:
            values = rows[name].to_numpy()
            columns[name] = _interpolated(values, upper, share, CIRCULAR.get(name))
    return _timed(pl.DataFrame(columns))


def _interpolated(values: np.ndarray, upper: np.ndarray, share: np.ndarray, least: float | None) -> pl.Series:
    above, below = values[upper], values[upper + 1]
    step = below - above
    if least is not None:
        step = (step + 180.0) % 360.0 - 180.0
    # The level of a row itself has that row's value, even if its neighbour lacks one.
    between = above + share * step
    if np.isnan(between).any():
        between = np.where(share == 0.0, above, np.where(share == 1.0, below, between))
    return pl.Series(between if least is None else (between - least) % 360.0 + least).fill_nan(None)


def _timed(levels: pl.DataFrame) -> pl.DataFrame:
    seconds = (pl.col("timestamp") - pl.col("timestamp").min().over("flight_id")) / 1e6
    position = levels.columns.index("timestamp") + 1
    timed = levels.with_columns(seconds.alias("time_s"), pl.from_epoch("timestamp", time_unit="us"))
    timed = timed.with_columns(pl.col("timestamp").dt.replace_time_zone("UTC"))
    names = [n for n in timed.columns if n != "time_s"]
    return timed.select(*names[:position], "time_s", *names[position:])
