"""Starts of real descents, so that another simulator can fly the same: type, levels, speeds, and times of reports."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.errors import DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import mach_to_cas_mps

Array = NDArray[np.float64]

CRUISE_LEVELS = 40
"""Levels below a flight's highest in which its Mach number is looked for: 4,000 ft."""
CAS_BELOW_FL = 260.0
"""Below it, airliners have handed over from Mach to CAS; where a flight shows nothing there, its own highest CAS."""
MACH_FROM_FL = 290.0
"""A flight that was seen from here on begins at its Mach number."""
EVERY_S = 4.0
"""Between reports where the flight's own rows are not given: a radar's turn."""
LONGEST_S = 120.0
"""Longer silences between two reports are losses, which another flight need not repeat."""
REPORTED = ("vertical_rate", "Mach", "TAS", "groundspeed", "track", "heading", "geoaltitude")
"""Channels that a flight reports or does not; altitude and IAS are always there."""


@dataclass(frozen=True)
class FlightPlan:
    """A descent to be flown: from `top_fl` to `bottom_fl` at `mach` (NaN: none), then `cas_kt`; its reports."""

    flight_id: str
    icao24: str
    typecode: str
    start: datetime
    top_fl: float
    bottom_fl: float
    mach: float
    cas_kt: float
    intervals_s: tuple[float, ...]
    channels: tuple[str, ...]


def flight_plans(descents: pl.DataFrame, rows: pl.DataFrame | None, bottom_fl: float) -> list[FlightPlan]:
    """One plan a prepared descent; with its rows, at the intervals at which it reported.

    Args:
        descents: Prepared descents.
        rows: Rows that they were prepared from, in the schema of `descentflow.surveillance.read_rows`.
        bottom_fl: Lowest level to fly to.

    Raises:
        DataError: If no descent begins above the lowest level.
    """
    high = descents.filter(pl.col("level_fl") >= bottom_fl)
    if not len(high):
        raise DataError(f"no descent above FL{bottom_fl:g}", expected="descents", mend="pass a lower level")
    flights = high.sort("flight_id", "level_fl").partition_by("flight_id", maintain_order=True)
    return [_plan(flight, rows, bottom_fl) for flight in flights]


def _plan(flight: pl.DataFrame, rows: pl.DataFrame | None, bottom_fl: float) -> FlightPlan:
    about = flight.row(0, named=True)
    top = float(np.max(flight["level_fl"].to_numpy()))
    mach, cas_kt = schedule(flight)
    seen = tuple(c for c in REPORTED if c in flight.columns and flight[c].is_not_null().any())
    intervals: tuple[float, ...] = (EVERY_S,)
    if rows is not None:
        mine = rows.filter(
            (pl.col("icao24") == about["icao24"])
            & pl.col("timestamp").is_between(flight["timestamp"].min(), flight["timestamp"].max())
        ).sort("timestamp")
        intervals = report_intervals_s(mine["timestamp"]) or intervals
        # `prepare` differences the altitude where no rate was reported: a rate of its rows tells them apart.
        given = "vertical_rate" in mine.columns and bool(mine["vertical_rate"].is_not_null().any())
        seen = tuple(c for c in seen if c != "vertical_rate" or given)
    return FlightPlan(
        str(about["flight_id"]),
        str(about["icao24"]),
        str(about["typecode"]),
        flight["timestamp"].min(),
        top,
        bottom_fl,
        mach,
        cas_kt,
        intervals,
        seen,
    )


def schedule(flight: pl.DataFrame) -> tuple[float, float]:
    """Mach number (NaN where the flight was not seen high enough) and CAS (kt) of one descent's speed schedule."""
    level, mach, cas = (flight[c].to_numpy().astype(float) for c in ("level_fl", "Mach", "IAS"))
    top = level.max()
    high = (level >= MACH_FROM_FL) & (level > top - CRUISE_LEVELS)
    low = level < CAS_BELOW_FL
    own_mach = float(np.nanmedian(mach[high])) if np.isfinite(mach[high]).any() else float("nan")
    if np.isfinite(cas[low]).any():
        return own_mach, float(np.nanmedian(cas[low]))
    return own_mach, float(np.nanmax(cas))


def report_intervals_s(timestamps: pl.Series) -> tuple[float, ...]:
    """Seconds between a flight's reports, in their order, without losses; none where it reported once."""
    gaps = np.diff(timestamps.cast(pl.Datetime("us")).to_physical().to_numpy()) / 1e6
    return tuple(float(gap) for gap in gaps if 0.0 < gap <= LONGEST_S)


def cas_of_mach_kt(mach: float, level_fl: float) -> float:
    """CAS (kt) of a Mach number at a level."""
    return float(mach_to_cas_mps(mach, level_fl * FL_M)) / KT_MPS
