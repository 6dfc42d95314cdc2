"""Readings of a column, and those of a vertical rate beside what the altitude does between neighbouring rows."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.units import FPM_MPS
from descentflow.surveillance.rows.air_data import Array
from descentflow.surveillance.rows.schema import FILLS, POSSIBLE

OFF_COST = 6.0
"""A column that no unit explains counts as much as so many that are in another unit."""
MIN_STEPS = 20
"""Steps below which nothing is said."""
SLOWEST_FPM, FASTEST_FPM = 800.0, 6000.0
"""Rates of the steps that are compared: rounded altitudes say little of slower ones."""
LEAST_S, MOST_S = 8.0, 60.0
"""Length of a step: an altitude that is rounded to 100 ft and changes between two values in level flight changes by 750
ft/min over the least of it, and by 1,500 over 4 s."""
LEAP_FPM = 20_000.0
"""Change that no aircraft makes: to a value that stands for none, or from one."""
MOST_FPM = 1e9
"""Change in no unit of any altitude: what has it is no number of an altitude."""
OPPOSITE = 99.0
"""Difference of a rate from a change of the other sign: larger than any of units."""


@dataclass(frozen=True)
class Reading:
    """Reading of a column's values: unit, sign and meaning.

    Attributes:
        words: Its words in a message; empty for the expected unit.
        factor: To the expected unit.
        meaning: The quantity that it is instead, `TAS` or `IAS`, or `unsigned`; empty for the one that it should be.
        off: Whether no unit is assumed: the column is left out of all comparisons.

    Example:
        >>> Reading("in km/h", 0.5).factor * 500
        250.0
    """

    words: str
    factor: float = 1.0
    meaning: str = ""
    off: bool = False

    @property
    def cost(self) -> float:
        """Cost among the changes that make columns agree."""
        return OFF_COST if self.off else float(bool(self.words))


AS_GIVEN, OFF = Reading(""), Reading("wrong", off=True)
UNITS = (
    ("in m/s", 1 / FPM_MPS),
    ("in hundreds of ft/min", 100.0),
    ("in ft/s", 60.0),
    ("raw counts of 32 ft/min (register BDS 6,0)", 32.0),
    ("raw counts of 64 ft/min (ADS-B)", 64.0),
    ("doubled", 0.5),
    ("halved", 2.0),
)
SINKS = "with the sign of a sink rate"
RATE_READINGS = (
    AS_GIVEN,
    *(Reading(words, factor) for words, factor in UNITS),
    Reading(SINKS, -1.0),
    *(Reading(f"{words} and {SINKS}", -factor) for words, factor in UNITS),
    Reading("without a sign", meaning="unsigned"),
    OFF,
)
"""Readings of a vertical rate, the expected one first."""


@dataclass(frozen=True)
class Steps:
    """Rows of an aircraft, each beside the last one of at least eight seconds before.

    Attributes:
        change: (n,) altitude's change a minute, in the unit of the altitudes.
        reported: (n,) rate that the later row reports.

    Example:
        >>> Steps(np.full(30, -2000.0), np.full(30, -10.16)).difference(1.0, 1 / FPM_MPS, "") < 1e-6
        True
    """

    ALLOWED: ClassVar[float] = 0.15
    """Difference at which rate and change still agree: real sources have up to 0.035, their 52 aircraft up to 0.126."""

    change: Array
    reported: Array

    @classmethod
    def of(cls, rows: pl.DataFrame) -> "Steps | None":
        """Steps of 8 to 60 s of one flight, or aircraft; none if the rows report no rate.

        Args:
            rows: In any order.

        Example:
            >>> Steps.of(pl.DataFrame({"altitude": [30e3]})) is None
            True
        """
        if "vertical_rate" not in rows.columns:
            return None
        steps = _steps(rows)
        return cls(steps["change"].to_numpy(), steps["reported"].to_numpy())

    def difference(self, altitude_factor: float, rate_factor: float, meaning: str) -> float:
        """Logarithm of rate over change, the median of climbs or of descents, whichever is worse; NaN of too few.

        Args:
            altitude_factor: Of the altitudes to ft.
            rate_factor: Of the rates to ft/min, negative for a sink rate.
            meaning: `unsigned` for rates without a sign.
        """
        change, rate = self.change * altitude_factor, self.reported * rate_factor
        moving = np.zeros(len(change), dtype=bool)
        for speed in (change, rate):
            moving |= (np.abs(speed) >= SLOWEST_FPM) & (np.abs(speed) <= FASTEST_FPM)
        moving &= np.abs(change) < LEAP_FPM
        found = []
        for way in (-1, 1):
            chosen = moving & (np.sign(change) == way)
            if chosen.sum() >= MIN_STEPS:
                ratio = float(np.median(rate[chosen] / np.abs(change[chosen]))) * (1 if meaning else way)
                found.append(abs(float(np.log(ratio))) if ratio > 1e-9 else OPPOSITE)
        # Rates without a sign are known by both: with descents alone they are sink rates.
        return np.nan if not found else OPPOSITE if meaning and len(found) < 2 else max(found)


def ratios_of_rates(rows: pl.DataFrame) -> pl.DataFrame:
    """Median of rate over change in the descents of each flight, where there are enough steps.

    Args:
        rows: As :meth:`Steps.of` takes them, with rates.

    Returns:
        Columns `flight_id icao24`, those that rows have, and `vertical_rate`: 1 where both agree.

    Example:
        >>> ratios_of_rates(pl.read_parquet("rows.parquet"))["vertical_rate"].median().__round__(1)
        1.0
    """
    moving = pl.any_horizontal(pl.col("change", "reported").abs().is_between(SLOWEST_FPM, FASTEST_FPM))
    ratio = (pl.col("reported") / pl.col("change")).alias("vertical_rate")
    steps = _steps(rows).filter(moving, pl.col("change").is_between(-LEAP_FPM, 0))
    found = steps.group_by(steps.columns[:-2]).agg(pl.len(), ratio.median())
    return found.filter(pl.col("len") >= MIN_STEPS).drop("len")


def _steps(rows: pl.DataFrame) -> pl.DataFrame:
    """Columns `change` and `reported` of steps of 8 to 60 s, beside the names of their flight."""
    names = [name for name in ("flight_id", "icao24") if name in rows.columns]
    rows = rows.filter(~pl.col("altitude").is_in(FILLS)).sort(*names, "timestamp", maintain_order=True)
    possible = pl.col("vertical_rate").is_between(*POSSIBLE["vertical_rate"])
    seen = rows.select(
        altitude=pl.col("altitude").cast(pl.Float64),
        reported=pl.when(possible).then(pl.col("vertical_rate")).cast(pl.Float64),
        time_us=pl.col("timestamp").dt.epoch("us").fill_null(0),
        flight=pl.any_horizontal(pl.col(name).ne_missing(pl.col(name).shift()) for name in names).cum_sum(),
    )
    altitude, reported, time_us, flight = (seen[name].to_numpy() for name in seen.columns)
    before = _row_before(time_us, flight)
    seconds = (time_us - time_us[before]) / 1e6
    with np.errstate(all="ignore"):
        change = (altitude - altitude[before]) / seconds * 60
    chosen = (flight == flight[before]) & (seconds >= LEAST_S) & (seconds <= MOST_S) & (change != 0)
    chosen &= (np.abs(change) < MOST_FPM) & np.isfinite(reported)
    steps = rows.select(names).with_columns(change=pl.Series(change), reported=pl.Series(reported))
    return steps.filter(pl.Series(chosen, dtype=pl.Boolean))


def _row_before(time_us: NDArray[np.int64], flight: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Position (n,) of the last row that is at least :data:`LEAST_S` older; the first row's, where there is none.

    Rows are sorted by flight and time, so one search in a clock that runs on from flight to flight finds all.
    """
    if not len(time_us):
        return np.zeros(0, dtype=np.int64)
    elapsed = np.diff(time_us, prepend=time_us[:1])
    clock = np.cumsum(np.where(np.diff(flight, prepend=flight[:1]) > 0, int(1e6 * MOST_S) + 1, elapsed.clip(min=0)))
    return np.maximum(np.searchsorted(clock, clock - int(1e6 * LEAST_S), side="right") - 1, 0)
