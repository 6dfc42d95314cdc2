"""Columns that nothing else of a row explains: angles, and values that stand for none."""

import warnings

import numpy as np
import polars as pl

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.rows.schema import POSSIBLE, REQUIRED
from descentflow.surveillance.rows.times import (
    MAX_REPEATED_SHARE,
    MIN_TIMES,
)

MIN_AIRCRAFT = 3
"""Aircraft below which angles are not checked: one may fly north all the time."""
OTHER_FPM = 500.0
"""Difference of a rate from the change of altitude that rounding to 25 ft does not make."""


def check_angles(rows: pl.DataFrame, source: str) -> None:
    """Refuse a track, heading or wind direction in radians: several aircraft that keep within seven degrees of north.

    Raises:
        DataError: If there is one.

    Example:
        >>> directions = pl.Series([0.06 * number for number in range(100)])
        >>> check_angles(pl.DataFrame({"track": directions, "icao24": ["a", "b", "c", "d"] * 25}), "rows.csv")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: rows.csv: track seems to be in radians...
    """
    for name in ("track", "heading", "wind_direction"):
        if name not in rows.columns or rows["icao24"].n_unique() < MIN_AIRCRAFT:
            continue
        angles = rows[name].drop_nulls().to_numpy()
        angles = np.abs(angles[np.isfinite(angles)])
        if len(angles) < MIN_TIMES or angles.max() > 2 * np.pi + 1e-6:
            continue
        # Of degrees near north some would be on the other side, at 350.
        if angles.min() < np.pi / 2 < angles.max() and np.any(angles % 1) and angles.max() > 2.5:
            raise DataError(
                f"{source}: {name} seems to be in radians: none of {len(angles):,} values is above {angles.max():.2f}",
                expected=f"{name} in degrees",
                mend=f"multiply the column {name} by {180 / np.pi:.4f} before passing the rows",
            )


def check_constant_rate(rows: pl.DataFrame, source: str) -> None:
    """Refuse a vertical rate that is one number throughout, of rows whose altitude often changes otherwise.

    Raises:
        DataError: If it is.

    Example:
        >>> times = pl.from_epoch(pl.Series(range(0, 300, 10)))
        >>> rows = pl.DataFrame({"icao24": "a", "timestamp": times, "altitude": range(30_000, 21_000, -300)})
        >>> check_constant_rate(rows.with_columns(vertical_rate=0.0), "rows.csv")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: rows.csv: vertical_rate is 0 in all of 30 rows, while the altitude changes...
    """
    rates = rows["vertical_rate"].drop_nulls() if "vertical_rate" in rows.columns else pl.Series(dtype=pl.Float64)
    if len(rates) < MIN_TIMES or rates.n_unique() > 1:
        return
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    ordered = rows.drop_nulls(["altitude", "timestamp"]).sort(*names, "timestamp", maintain_order=True)
    minutes = pl.col("timestamp").diff().over(*names).dt.total_microseconds() / 60e6
    changes = ordered.select(
        pl.when(minutes.is_between(1 / 30, 1)).then(pl.col("altitude").diff() / minutes)
    ).to_series()
    others = (changes.drop_nulls() - rates[0]).abs() > OTHER_FPM
    if len(others) >= MIN_TIMES and float(others.mean() or 0.0) > MAX_REPEATED_SHARE:
        raise DataError(
            f"{source}: vertical_rate is {rates[0]:g} in all of {len(rates):,} rows, while the altitude changes",
            expected="vertical_rate in ft/min as the aircraft reported it, or no such column",
            mend="leave the column vertical_rate out: the rate is then differenced from altitude",
        )


def check_possible(rows: pl.DataFrame, source: str) -> None:
    """Warn of a column of which most values are impossible; they are set to missing, and counted, when rows are judged.

    Example:
        >>> rows = pl.DataFrame({"TAS": [9999.0] * 30})
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always")
        ...     check_possible(rows, "rows.csv")
        >>> print(caught[0].message)
        rows.csv: 30 of 30 values of TAS are outside 40 to 700 and taken for missing (the most frequent: 9999): ...
    """
    for name in sorted(set(POSSIBLE) & set(rows.columns) - set(REQUIRED)):
        values = rows[name].drop_nulls()
        outside = values.filter(~values.is_between(*POSSIBLE[name]))
        if len(values) >= MIN_TIMES and len(outside) > len(values) / 2:
            low, high = POSSIBLE[name]
            warnings.warn(
                f"{source}: {len(outside):,} of {len(values):,} values of {name} are outside {low:g} to {high:g} and "
                f"taken for missing (the most frequent: {outside.mode().sort()[0]:g}): check the unit of the column, "
                "and leave values that stand for none empty",
                DescentflowWarning,
                stacklevel=4,
            )
