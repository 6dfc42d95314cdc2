"""True airspeed and groundspeed between reports of register BDS 5,0, for which radars ask every 4 to 16 s."""

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import SECONDS, clock_of, flights_of
from descentflow.surveillance.rows.air_data import Array
from descentflow.surveillance.rows.drop_report import DropReport

LONGEST_S = 20.0
"""Time between two reports of an aircraft over which values are interpolated: temperature and wind hardly change."""
BETWEEN = "values of {name} between reports of the same flight at most 20 s apart"
"""Note in the report."""


def with_values_between(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows with TAS, by its ratio to the Mach number, and groundspeed between reports.

    The ratio is the speed of sound, which is smooth where an aircraft accelerates, too. The errors of measured air are
    learnt from the scatter of such values, and so have what the reports' rounding leaves in them.

    Args:
        rows: Sorted by flight and time.
        report: Takes the number of values.

    Example:
        >>> from datetime import datetime
        >>> times = [datetime(2024, 3, 1, 12, 0, second) for second in (0, 4, 8)]
        >>> rows = pl.DataFrame({"flight_id": ["a"] * 3, "timestamp": times, "Mach": [0.70, 0.72, 0.74]})
        >>> with_values_between(rows.with_columns(TAS=pl.Series([420.0, None, 444.0])), DropReport())["TAS"].to_list()
        [420.0, 432.0, 444.0]
    """
    names = [name for name in ("TAS", "groundspeed") if name in rows.columns and rows[name].has_nulls()]
    clock = clock_of(flights_of(rows), rows.select(SECONDS).to_series().to_numpy()) if names else np.zeros(0)
    for name in names:
        divisor = rows["Mach"].to_numpy() if name == "TAS" else np.ones(len(rows))
        made = pl.Series(_between(clock, rows[name].to_numpy() / divisor) * divisor).fill_nan(None)
        before = rows[name].count()
        rows = rows.with_columns(pl.coalesce(name, made.alias("_made")).alias(name))
        report.note(BETWEEN.format(name=name), rows[name].count() - before)
    return rows


def _between(clock: Array, values: Array) -> Array:
    """Values (n,) interpolated in time, NaN over long gaps."""
    at = np.flatnonzero(np.isfinite(values))
    if not len(at):
        return values
    number = np.arange(len(values))
    after = at[np.searchsorted(at, number).clip(max=len(at) - 1)]
    before = at[np.searchsorted(at, number, side="right").clip(min=1) - 1]
    inside = (number >= before) & (number <= after) & (clock[after] - clock[before] <= LONGEST_S)
    return np.where(inside, np.interp(clock, clock[at], values[at]), np.nan)
