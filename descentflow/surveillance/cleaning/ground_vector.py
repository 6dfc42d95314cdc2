"""Groundspeed and track of rows: turns, values that are stuck, and whether positions move as they say."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.constants import G0_MPS2, TROPOPAUSE_M
from descentflow.core.errors import CleaningError
from descentflow.core.units import FT_M, KT_MPS
from descentflow.surveillance.cleaning.filters import SECONDS, clock_of, flights_of, windows
from descentflow.surveillance.rows.airspeed_source import PLACED
from descentflow.surveillance.rows.schema import GROUND_VECTOR, MIN_CHECKED_VALUES

Mask = NDArray[np.bool_]
STEEPEST_DEG = 15.0
"""Bank beyond which groundspeed and track, which lag, are no vector of one instant."""
TURN_S, MAX_STEP_S = 5.0, 60.0
"""Half-width of the window of a turn, as tracks in whole degrees need, and longest step to a neighbour beyond it."""
OLDEST_S, STUCK_S, STUCK_FT = 2.0, 20.0, 1500.0
"""Age of a groundspeed that is too old, and how long, over which height, it is repeated before it is one: over that
height TAS changes by 3 kt at a held Mach number, and by 7 kt at a held CAS."""
LEAST_KT, SHORTEST_S = 100.0, 4.0
"""Groundspeed, and seconds between positions, from which these are compared."""
MAX_COURSE_DEG, SPEED_RATIO = 2.0, (0.93, 1.07)
"""Medians over all rows of course less track, and of the speed of positions over groundspeed, that are no error:
headings differ by the drift, miles per hour by 0.87."""
EARTH_NM = 60.0
"""Nautical miles of a degree of latitude."""
UNITS = {"m/s": 1 / KT_MPS, "km/h": 1 / 1.852, "miles per hour": 1 / 1.15078}


def turning(rows: pl.DataFrame) -> Mask:
    """Mask (n,) of rows that bank by more than 15 degrees, by their roll, or else by the change of track.

    Args:
        rows: Sorted by flight and time.

    Example:
        >>> from datetime import datetime
        >>> times = [datetime(2024, 3, 1, 12, 0, second) for second in (0, 4, 8)]
        >>> rows = pl.DataFrame({"flight_id": ["a"] * 3, "timestamp": times, "track": [350.0, 358.0, 6.0]})
        >>> turning(rows.with_columns(groundspeed=400.0)).tolist()
        [True, True, True]
    """
    speed, track = (rows[name].to_numpy() for name in GROUND_VECTOR)
    flight = flights_of(rows)
    clock = clock_of(flight, rows.select(SECONDS).to_series().to_numpy())
    first, last = windows(clock, -TURN_S, TURN_S)
    number, most = np.arange(len(rows)), len(rows) - 1
    same = np.diff(flight, prepend=-1, append=-1) == 0
    first = np.where(same[:-1], np.minimum(first, number - 1), first).clip(min=0)
    last = np.where(same[1:], np.maximum(last - 1, number + 1), last - 1).clip(max=most)
    seconds = clock[last] - clock[first]
    with np.errstate(all="ignore"):
        turned = (track[last] - track[first] + 180.0) % 360.0 - 180.0
        rate = np.where((seconds > 0) & (seconds <= MAX_STEP_S), np.radians(turned) / seconds, 0.0)
        bank = np.degrees(np.arctan(speed * KT_MPS * rate / G0_MPS2))
    if "roll" in rows.columns:
        roll = rows["roll"].to_numpy()
        bank = np.where(np.isnan(roll), bank, roll)
    return np.nan_to_num(np.abs(bank)) > STEEPEST_DEG


def stuck(rows: pl.DataFrame) -> Mask:
    """Mask (n,) of rows that repeat groundspeed and track for longer than 2 s, in a run during which a flight descends.

    Args:
        rows: Sorted by flight and time.

    Example:
        >>> from datetime import datetime
        >>> times = [datetime(2024, 3, 1, 12, 0, second) for second in (0, 20, 40)]
        >>> rows = pl.DataFrame({"flight_id": ["a"] * 3, "timestamp": times, "altitude": [2e4, 1.9e4, 1.8e4]})
        >>> stuck(rows.with_columns(groundspeed=400.0, track=90.0)).tolist()
        [False, True, True]
    """
    flight = flights_of(rows)
    clock = clock_of(flight, rows.select(SECONDS).to_series().to_numpy())
    differs = np.diff(flight, prepend=-1) != 0
    for name in GROUND_VECTOR:
        value = rows[name].to_numpy()
        differs |= value != np.roll(value, 1)
    begins = np.flatnonzero(differs)
    sizes = np.diff(begins, append=len(rows))
    altitude = rows["altitude"].to_numpy()
    lasted = clock[begins + sizes - 1] - clock[begins]
    fallen = np.abs(altitude[begins + sizes - 1] - altitude[begins])
    # Above the tropopause TAS is the same at a held Mach number.
    low = altitude[begins + sizes - 1] < TROPOPAUSE_M / FT_M
    held = np.repeat(low & (lasted > STUCK_S) & (fallen > STUCK_FT), sizes)
    return np.asarray(held & (clock - np.repeat(clock[begins], sizes) > OLDEST_S))


def check_course(rows: pl.DataFrame, straight: Mask) -> None:
    """Refuse a groundspeed or a track that positions contradict: another unit, a heading for a track, swapped places.

    Args:
        rows: Sorted by flight and time.
        straight: (n,) rows outside of turns.

    Raises:
        CleaningError: Naming the column, and the unit that positions say.
    """
    if not set(PLACED) <= set(rows.columns):
        return
    ratio, off = _moved(rows, straight, PLACED)
    if np.isnan(ratio) or (SPEED_RATIO[0] < ratio < SPEED_RATIO[1] and off <= MAX_COURSE_DEG):
        return
    other_ratio, other_off = _moved(rows, straight, PLACED[::-1])
    if SPEED_RATIO[0] < other_ratio < SPEED_RATIO[1] and other_off <= MAX_COURSE_DEG:
        raise CleaningError(
            f"latitude and longitude seem to be swapped: positions move {ratio:.3g} times as fast as groundspeed, and "
            f"{other_ratio:.3g} times once they are exchanged",
            expected="latitude and longitude in their own columns",
            mend="exchange them, for instance by --column latitude=longitude --column longitude=latitude",
        )
    if not SPEED_RATIO[0] < ratio < SPEED_RATIO[1]:
        unit = next((name for name, factor in UNITS.items() if abs(ratio / factor - 1) < 0.05), "no unit known")
        raise CleaningError(
            f"groundspeed seems to be in {unit}: positions move {ratio:.3g} times as fast in the median",
            expected="groundspeed in kt",
            mend=f"multiply the column, for instance by --column 'groundspeed=groundspeed*{ratio:.4g}'",
        )
    raise CleaningError(
        f"track contradicts the positions: their course differs from it by {off:.1f} degrees in the median",
        expected="the true track over the ground, in degrees",
        mend="a heading is no track, and a magnetic track is no true one: name the column of the true track",
    )


def _moved(rows: pl.DataFrame, straight: Mask, placed: tuple[str, ...]) -> tuple[float, float]:
    """Medians of the speed of positions over groundspeed, and of course less track; NaN where too few rows move."""
    speed, track = (rows[name].to_numpy() for name in GROUND_VECTOR)
    latitude, longitude = (rows[name].to_numpy() for name in placed)
    seconds = np.diff(clock_of(flights_of(rows), rows.select(SECONDS).to_series().to_numpy()))
    north = EARTH_NM * np.diff(latitude)
    east = EARTH_NM * ((np.diff(longitude) + 180) % 360 - 180) * np.cos(np.radians(latitude[1:]))
    moving = straight[1:] & straight[:-1] & (seconds >= SHORTEST_S) & (seconds <= MAX_STEP_S)
    moved = np.hypot(north, east) * 3600 / np.maximum(seconds, SHORTEST_S)
    moving &= np.isfinite(moved) & np.isfinite(track[1:]) & (np.fmax(moved, 0) > LEAST_KT)
    if moving.sum() < MIN_CHECKED_VALUES:
        return np.nan, np.nan
    ratio = float(np.nanmedian(moved[moving] / np.maximum((speed[1:] + speed[:-1]) / 2, 1.0)[moving]))
    course = np.degrees(np.arctan2(east, north))[moving]
    return ratio, float(np.median(np.abs((course - track[1:][moving] + 180) % 360 - 180)))
