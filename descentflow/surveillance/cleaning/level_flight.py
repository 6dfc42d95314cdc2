"""Level flight in descents, EUROCONTROL's harmonised indicator of continuous descents: by segment and by flight."""

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.rates import with_rate
from descentflow.surveillance.rows.air_data import isa_tas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

LEVEL_FPM = 300.0
"""A flight is level while its vertical rate is within this of zero."""
LEAST_S = 20.0
"""Shorter level flight does not count."""
TOP_FT = 200.0
"""The descent begins where a flight is for the last time so near to its highest altitude."""
BOTTOM_FT = 1800.0
"""The descent ends here."""
LEAST_DESCENT_FT = 5000.0
"""Height that a flight loses at least to be counted among descents."""
LONGEST_GAP_S = 60.0
"""Between reports of one segment."""
BANDS_FT = (0, 10_000, 20_000, 30_000, 60_000)
"""Altitudes between which the report counts."""


def level_segments(rows: pl.DataFrame) -> pl.DataFrame:
    """Level segments of descents: the rate within 300 ft/min for 20 s or more, from the top of descent to 1,800 ft.

    Args:
        rows: Reports of whole flights with ``flight_id timestamp altitude``, and ``vertical_rate``, ``groundspeed``,
            ``TAS`` or ``Mach`` where they are known; a missing rate is the slope of the altitude.

    Returns:
        One row for each segment: ``flight_id timestamp`` (its begin) ``level_s altitude_ft`` (mean) ``distance_nm``
        (over the ground, or through standard air without a groundspeed; missing where no speed is known).

    Example:
        >>> from datetime import datetime, timedelta
        >>> times = [datetime(2024, 3, 1) + timedelta(seconds=s) for s in range(0, 1000, 10)]
        >>> altitude = [max(30_000 - 20 * s, 20_000) - max(20 * (s - 560), 0) for s in range(0, 1000, 10)]
        >>> rows = pl.DataFrame({"flight_id": "a", "timestamp": times, "altitude": altitude})
        >>> level_segments(rows).select("level_s", "altitude_ft").rows()
        [(40.0, 20000.0)]
    """
    numbers = ("altitude", "vertical_rate", "groundspeed", "TAS", "Mach")
    used = rows.select(
        "flight_id", "timestamp", *(pl.col(name).cast(pl.Float64) for name in numbers if name in rows.columns)
    )
    return _segments(_descents(with_rate(used.sort("flight_id", "timestamp"))))


def _segments(descent: pl.DataFrame) -> pl.DataFrame:
    """Segments of the rows of descents, which are sorted by flight and time and have rates."""
    if "Mach" in descent.columns:
        through = isa_tas_of_mach_kt(*(descent[name].to_numpy() for name in ("Mach", "altitude")))
        descent = descent.with_columns(pl.Series("through_air", through).fill_nan(None))
    speed = [pl.col(name) for name in ("groundspeed", "TAS", "through_air") if name in descent.columns]
    seconds = pl.col("timestamp").diff().over("flight_id").dt.total_microseconds() / 1e6
    level = (pl.col("vertical_rate").abs() <= LEVEL_FPM).fill_null(False)
    named = descent.with_columns(
        level.alias("level"),
        seconds.fill_null(0.0).alias("seconds"),
        (pl.coalesce(*speed) if speed else pl.lit(None, pl.Float64)).alias("speed"),
    )
    begins = (pl.col("level") & ~pl.col("level").shift(fill_value=False)) | (pl.col("seconds") > LONGEST_GAP_S)
    first = pl.col("flight_id") != pl.col("flight_id").shift()
    flown = (pl.col("speed") + pl.col("speed").shift()) / 2 * pl.col("seconds") / 3600
    runs = named.with_columns((begins | first.fill_null(True)).cum_sum().alias("run"), flown.alias("flown"))
    inside = pl.col("run") == pl.col("run").shift()
    return (
        runs.with_columns(seconds=pl.when(inside).then("seconds"), flown=pl.when(inside).then("flown"))
        .filter("level")
        .group_by("flight_id", "run", maintain_order=True)
        .agg(
            pl.col("timestamp").first(),
            level_s=pl.col("seconds").sum(),
            altitude_ft=pl.col("altitude").mean(),
            distance_nm=pl.when(pl.col("speed").is_not_null().all()).then(pl.col("flown").sum()),
        )
        .filter(pl.col("level_s") >= LEAST_S)
        .drop("run")
    )


def _descents(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows after the top of descent of flights that lose enough height, down to the bottom."""
    altitude, flight = pl.col("altitude"), "flight_id"
    at_top = altitude >= altitude.max().over(flight) - TOP_FT
    last = pl.col("timestamp").filter(at_top).max().over(flight)
    lost = altitude.max().over(flight) - altitude.min().over(flight)
    return rows.filter((pl.col("timestamp") >= last) & (lost >= LEAST_DESCENT_FT) & (altitude >= BOTTOM_FT))


def level_flight(rows: pl.DataFrame) -> pl.DataFrame:
    """Level flight of each flight that descends.

    Args:
        rows: As those of :func:`level_segments`.

    Returns:
        One row for each flight: ``flight_id segments level_s distance_nm``; zeros where its descent is continuous.

    Example:
        >>> found = level_flight(pl.read_parquet("rows.parquet"))
        >>> len(found), bool((found["level_s"] >= 0).all())
        (120, True)
    """
    by_flight = (
        level_segments(rows)
        .group_by("flight_id")
        .agg(segments=pl.len().cast(pl.Int64), level_s=pl.col("level_s").sum(), distance_nm=pl.col("distance_nm").sum())
    )
    numbers = rows.select("flight_id", "timestamp", pl.col("altitude").cast(pl.Float64))
    flights = _descents(numbers).select("flight_id").unique().sort("flight_id")
    return flights.join(by_flight, on="flight_id", how="left", maintain_order="left").with_columns(
        pl.col("segments", "level_s", "distance_nm").fill_null(0)
    )


def note_level_flight(rows: pl.DataFrame, report: DropReport) -> None:
    """Count flights that descend, those of them without level flight, and the seconds level between altitudes.

    Args:
        rows: Sorted by flight and time, with rates.
        report: Takes the counts.
    """
    descent = _descents(rows)
    segments, flights = _segments(descent), descent["flight_id"].n_unique()
    report.note("flights that descend by 5,000 ft or more", flights)
    report.note("of them without level flight (300 ft/min, 20 s)", flights - segments["flight_id"].n_unique())
    number = np.searchsorted(BANDS_FT, segments["altitude_ft"].to_numpy(), side="right") - 1
    for place, low in enumerate(BANDS_FT[:-1]):
        here = segments.filter(pl.Series(number == place, dtype=pl.Boolean))
        report.note(f"level segments in descents from FL{low // 100}", len(here))
        report.note(f"seconds level in descents from FL{low // 100}", round(here["level_s"].sum()))
