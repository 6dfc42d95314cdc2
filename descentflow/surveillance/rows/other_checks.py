"""Columns that nothing else of a row explains: angles, temperatures, and values that stand for none."""

import numpy as np
import polars as pl

from descentflow.core.errors import DataError, warn
from descentflow.core.units import FT_M
from descentflow.surveillance.rows.schema import MIN_CHECKED_VALUES, POSSIBLE, REQUIRED

MIN_AIRCRAFT = 3
"""Aircraft below which angles are not checked: one may fly north all the time."""
OTHER_FPM, MAX_OTHER_SHARE = 500.0, 0.1
"""Difference of a rate from the change of altitude that rounding to 25 ft does not make, and share of such rows above
which a rate that is one number is none."""


def check_angles(rows: pl.DataFrame, source: str) -> None:
    """Refuse angles in radians: tracks, headings or winds of several aircraft within seven degrees of north."""
    for name in ("track", "heading", "wind_direction"):
        if name not in rows.columns or rows["icao24"].n_unique() < MIN_AIRCRAFT:
            continue
        angles = rows[name].drop_nulls().to_numpy()
        angles = np.abs(angles[np.isfinite(angles)])
        if len(angles) < MIN_CHECKED_VALUES or angles.max() > 2 * np.pi + 1e-6:
            continue
        # Of degrees near north some would be on the other side, at 350.
        if angles.min() < np.pi / 2 < angles.max() and np.any(angles % 1) and angles.max() > 2.5:
            raise DataError(
                f"{source}: {name} seems to be in radians: none of {len(angles):,} values is above {angles.max():.2f}",
                expected=f"{name} in degrees",
                mend=f"multiply the column {name} by {180 / np.pi:.4f} before passing the rows",
            )


def check_constant_rate(rows: pl.DataFrame, source: str) -> None:
    """Refuse a vertical rate that is one number throughout, of rows whose altitude often changes otherwise."""
    rates = rows["vertical_rate"].drop_nulls() if "vertical_rate" in rows.columns else pl.Series(dtype=pl.Float64)
    if len(rates) < MIN_CHECKED_VALUES or rates.n_unique() > 1:
        return
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    ordered = rows.drop_nulls(["altitude", "timestamp"]).sort(*names, "timestamp", maintain_order=True)
    minutes = pl.col("timestamp").diff().over(*names).dt.total_microseconds() / 60e6
    changes = ordered.select(
        pl.when(minutes.is_between(1 / 30, 1)).then(pl.col("altitude").diff() / minutes)
    ).to_series()
    others = (changes.drop_nulls() - rates[0]).abs() > OTHER_FPM
    if len(others) >= MIN_CHECKED_VALUES and float(others.mean() or 0.0) > MAX_OTHER_SHARE:
        raise DataError(
            f"{source}: vertical_rate is {rates[0]:g} in all of {len(rates):,} rows, while the altitude changes",
            expected="vertical_rate in ft/min as the aircraft reported it, or no such column",
            mend="leave the column vertical_rate out: the rate is then differenced from altitude",
        )


def check_other_units(rows: pl.DataFrame, source: str) -> None:
    """Refuse a geometric altitude in metres and a temperature in degrees Celsius."""
    if "geoaltitude" in rows.columns:
        seen = rows.select("altitude", "geoaltitude").drop_nulls()
        seen = seen.filter(pl.col("altitude").is_between(3000, POSSIBLE["altitude"][1]) & (pl.col("geoaltitude") > 0))
        ratio = np.median((seen["geoaltitude"] / seen["altitude"]).to_numpy()) if len(seen) >= MIN_CHECKED_VALUES else 1
        if abs(ratio / FT_M - 1) < 0.1:
            raise DataError(
                f"{source}: geoaltitude seems to be in metres: it is {ratio:.2f} of the pressure altitude",
                expected="geoaltitude in ft",
                mend=f"multiply the column by {1 / FT_M:.4f} before passing the rows",
            )
    temperatures = rows["temperature"].drop_nulls().to_numpy() if "temperature" in rows.columns else np.zeros(0)
    if len(temperatures) >= MIN_CHECKED_VALUES and float(np.median(temperatures)) < 100:
        raise DataError(
            f"{source}: temperature seems to be in degrees Celsius",
            expected="temperature in K",
            mend="add 273.15 to the column before passing the rows",
        )


def check_possible(rows: pl.DataFrame, source: str) -> None:
    """Warn of a column of which most values are impossible; the judging of rows sets them to missing."""
    for name in sorted(set(POSSIBLE) & set(rows.columns) - set(REQUIRED)):
        values = rows[name].drop_nulls()
        outside = values.filter(~values.is_between(*POSSIBLE[name]))
        if len(values) >= MIN_CHECKED_VALUES and len(outside) > len(values) / 2:
            low, high = POSSIBLE[name]
            warn(
                f"{source}: {len(outside):,} of {len(values):,} values of {name} are outside {low:g} to {high:g} and "
                f"taken for missing (the most frequent: {outside.mode().sort()[0]:g}): check the unit of the column, "
                "and leave values that stand for none empty"
            )
