"""Thrust above idle, where a source has N1, thrust or fuel flow: known, and dropped if asked for."""

from dataclasses import dataclass

import polars as pl

from descentflow.core.errors import CleaningError
from descentflow.surveillance.cleaning.filters import Filter, cut
from descentflow.surveillance.cleaning.rates import with_rate

POWER = ("N1", "thrust", "fuel_flow")
"""Columns that tell, the surest first."""
ABOVE_IDLE = "_above_idle"
"""Column of how far the power is above idle, in points of N1."""
BAND_FT = 4_000.0
"""Idle N1 changes by some 4 points over this height."""
IDLE_SHARE = 0.1
"""The power that this share of an aircraft's descending rows in a band stay below is its idle."""
FLOW_A_POINT = 0.04
"""Of idle fuel flow for a point of N1: on a recorded RJ85 5 points and 20 % choose the same rows (96 of 100)."""
THRUST_A_POINT = 0.01
"""Of the greatest thrust of the aircraft's rows for a point of N1."""


def check_power(columns: tuple[str, ...]) -> None:
    """Refuse rows of which none can tell its power.

    Raises:
        CleaningError: If no column of :data:`POWER` is among them.

    Example:
        >>> check_power(("IAS", "N1"))
    """
    if not set(POWER) & set(columns):
        raise CleaningError(
            "no column that tells thrust above idle",
            expected="N1 in percent, thrust in N or fuel_flow in kg/s of all engines",
            mend="name it (--column N1=your_column), or leave --idle-only out",
        )


def with_power(rows: pl.DataFrame, slowest_fpm: float) -> pl.DataFrame:
    """Rows of whole aircraft with :data:`ABOVE_IDLE`; null where a row or its band has none of :data:`POWER`.

    Idle is the lowest decile of the aircraft's own descending rows in bands of 4,000 ft, so what never idles in a
    band seems to idle there.

    Args:
        rows: Sorted by flight and time.
        slowest_fpm: Rate from which a row descends.

    Example:
        >>> from datetime import datetime
        >>> times = [datetime(2024, 3, 1, 12, 0, second) for second in range(0, 60, 2)]
        >>> rows = pl.DataFrame({"flight_id": "a", "icao24": "a00001", "timestamp": times, "vertical_rate": -1500.0,
        ...     "altitude": [11_900.0 - 50 * k for k in range(30)], "N1": [30.0] * 20 + [60.0] * 10})
        >>> with_power(rows, 500.0)["_above_idle"].unique().sort().to_list()
        [0.0, 30.0]
    """
    columns = ("flight_id", "timestamp", "altitude", "vertical_rate")
    rated = with_rate(rows.select(name for name in columns if name in rows.columns))
    falls = (rated["vertical_rate"] <= -slowest_fpm).alias("_falls")
    aircraft, band = pl.col("icao24"), pl.col("altitude") // BAND_FT
    bands = []
    for name in (column for column in POWER if column in rows.columns):
        value = pl.col(name)
        idle = pl.when("_falls").then(value).quantile(IDLE_SHARE).over(aircraft, band)
        most = value.max().over(aircraft)
        a_point = {"N1": pl.lit(1.0), "thrust": THRUST_A_POINT * most, "fuel_flow": FLOW_A_POINT * idle}[name]
        bands.append((value - idle) / a_point)
    return rows.with_columns(falls).with_columns(pl.coalesce(bands).alias(ABOVE_IDLE)).drop("_falls")


@dataclass(frozen=True)
class IdleOnly(Filter):
    """Drop rows with thrust above idle, and those that do not tell."""

    within: float
    """Points of N1."""
    reason = "above_idle"
    uses = (ABOVE_IDLE,)

    def keep(self, rows: pl.DataFrame) -> pl.DataFrame:
        """Rows at idle; a new segment begins after each dropped row."""
        return cut(rows, ~(rows[ABOVE_IDLE] <= self.within).fill_null(False).to_numpy())
