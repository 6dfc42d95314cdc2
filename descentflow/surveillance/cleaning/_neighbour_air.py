r"""Wind and temperature at an aircraft, from the reports of others: kriging in place, height and time.

Reports of an aircraft over ten minutes and 1,000 ft are one observation: the temperature by true airspeed and Mach
number, and the wind along its track by groundspeed, :math:`w = V_g - \sqrt{V^2 - \dot h^2 - w_\perp^2}`. Tracks differ,
so both components of the wind follow, and with them the cross wind :math:`w_\perp` of the next round. No heading is
used, for magnetic ones err by the declination. A level and a trend with height are common to all, of which nothing is
assumed; the departures from them are Matern 5/2 in height, and exponential in distance and time.

Source: Cressie, Statistics for Spatial Data (1993), section 3.4, with a prior of the trend in place of its constraint.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import polars as pl

from descentflow.core.constants import KAPPA, LAPSE_K_M, R_AIR, T0_K, TROPOPAUSE_M
from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.surveillance.rows.air_data import Array
from descentflow.surveillance.rows.airspeed_source import PLACED
from descentflow.surveillance.rows.schema import POSSIBLE

BAND_FT, BAND_S = 1000.0, 600.0
"""Of an observation."""
OBSERVED = (
    *("aircraft", "unix_s", "altitude_m", "latitude", "longitude", "sine", "cosine"),
    *("level_mps", "along", "deviation"),
)
NEEDED = ("icao24", "timestamp", "altitude", "Mach", "TAS", "groundspeed", "track", "latitude", "longitude")
DIFFUSE, TREND_M, MIDDLE_M, LENGTH_M = 50.0, 5000.0, 8000.0, 2500.0
"""Prior spread of the level (K, m/s), and over 5 km of the trend, and the length of departures in height: those of
:mod:`descentflow.air.air_smoother`."""
LENGTH_KM, LENGTH_S = 700.0, 72_000.0
"""Lengths in place and time: winds 100 km or three hours apart differ by some 4 m/s."""
LATEST_S = 10_800.0
"""Time away from which an observation counts no more, as that of a field of every six hours."""
NEIGHBOURS, AT_ONCE = 48, 256
"""Observations that are used at a place, and places at a time."""
STRAIGHT = 0.99
"""Length of the mean of the tracks of an observation, as unit vectors, below which it was made in a turn."""
ROUNDS, OUTLIER = 3, 5.0
"""Rounds of the cross wind, and robust standard deviations from its neighbours' beyond which one is wrong."""
EARTH_KM = 60 * 1.852
"""Kilometres of a degree of latitude."""


class Quantity(NamedTuple):
    """Standard deviations of a quantity's departures and errors."""

    departure: float
    own: float
    """Of an aircraft's own error."""
    white: float
    """Of the error of one observation."""
    worst: float
    """Largest standard error with which the quantity is known."""


WIND, TEMPERATURE = Quantity(8.0, 1.0, 1.5, 5.0), Quantity(3.0, 0.7, 1.0, 3.0)


def observations(rows: pl.DataFrame, by: str = "icao24") -> pl.DataFrame:
    """Observations by aircraft, or flight, 1,000 ft and ten minutes: one a row, with its mean place and time.

    Args:
        rows: With the columns of ``NEEDED``; where one is absent there is no observation.
        by: Column of the aircraft or flight.

    Example:
        >>> rows = pl.read_parquet("rows.parquet").with_columns(latitude=52.0, longitude=4.0, track=90.0)
        >>> seen = observations(rows.with_columns(groundspeed=pl.col("TAS") + 20))
        >>> 10 < seen["along"].min() < seen["along"].max() < 12, abs(seen["deviation"].median()) < 1
        (True, True)
    """
    absent = [pl.lit(None, pl.Float64).alias(name) for name in NEEDED if name not in rows.columns]
    rows = rows.with_columns(absent)
    seconds, altitude_m = pl.col("timestamp").dt.epoch("us") / 1e6, pl.col("altitude") * FT_M
    tas = pl.when(pl.col("TAS").is_between(*POSSIBLE["TAS"])).then(pl.col("TAS") * KT_MPS)
    sink = (pl.col("vertical_rate") * FPM_MPS).fill_null(0.0) if "vertical_rate" in rows.columns else 0.0
    level = (tas**2 - sink**2).sqrt()
    standard = T0_K + LAPSE_K_M * altitude_m.clip(upper_bound=TROPOPAUSE_M)
    track = pl.col("track").radians()
    clock = [pl.col("clock").mean()] if "clock" in rows.columns else []
    return (
        rows.group_by(by, pl.col("altitude") // BAND_FT, seconds // BAND_S, maintain_order=True)
        .agg(
            *clock, pl.col("icao24").first().alias("aircraft"), seconds.mean().alias("unix_s"),
            altitude_m.mean().alias("altitude_m"), pl.col("latitude").mean(), pl.col("longitude").last(),
            track.sin().mean().alias("sine"), track.cos().mean().alias("cosine"), level.mean().alias("level_mps"),
            (pl.col("groundspeed") * KT_MPS - level).median().alias("along"),
            ((tas / pl.col("Mach")) ** 2 / (KAPPA * R_AIR) - standard).median().alias("deviation"),
        )
    )  # fmt: skip


def observed(parts: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Whole observations in all parts of the rows.

    Raises:
        DataError: If there are none.
    """
    seen = [observations(part).select(OBSERVED).drop_nulls() for part in parts]
    if all(part.is_empty() for part in seen):
        raise DataError(
            "airspeeds from neighbours, and no row that reports them",
            expected="aircraft with Mach, TAS (BDS 5,0), groundspeed, track and position among the others",
            mend="pass rows of enhanced surveillance too, or the file of a weather field",
        )
    return pl.concat(seen)


class NeighbourAir:
    """The air that some aircraft met, at the places of others.

    Example:
        >>> rows = pl.read_parquet("rows.parquet").with_columns(latitude=52.0, longitude=4.0, track=90.0)
        >>> air = NeighbourAir(observations(rows.with_columns(groundspeed=pl.col("TAS") + 20)))
        >>> east, north, deviation = air.at(observations(rows.head(100)))
        >>> bool((abs(east - 10) < 1).all()), bool((abs(deviation) < 1).all())
        (True, True)
    """

    def __init__(self, seen: pl.DataFrame) -> None:
        """Order the observations, and take the cross wind out of them.

        Args:
            seen: As :func:`observations` of all aircraft; those that are not whole, or made in turns, are left out.
        """
        straight = (pl.col("sine") ** 2 + pl.col("cosine") ** 2).sqrt() > STRAIGHT
        whole = pl.all_horizontal(pl.exclude("aircraft").is_finite())
        self.seen = seen.select(OBSERVED).drop_nulls().filter(straight, whole).with_columns(wind="along")
        self._middle = tuple(float(np.median(self.seen[name])) if len(self.seen) else 0.0 for name in PLACED)
        for _ in range(ROUNDS if len(self.seen) else 0):
            east, north, deviation = self.at(self.seen, blank=False)
            values = self.seen.select("level_mps", "sine", "cosine", "along", "wind", "deviation").to_numpy().T
            level, sine, cosine, along, wind, warm = values
            across = np.nan_to_num(east * cosine - north * sine)
            left = np.abs([wind - np.nan_to_num(east * sine + north * cosine), warm - np.nan_to_num(deviation)])
            scatter = np.maximum(1.4826 * np.median(left, 1), [WIND.white, TEMPERATURE.white])
            good = (left <= OUTLIER * scatter[:, None]).all(0)
            wind = along + level - np.sqrt(np.maximum(level**2 - across**2, 0.0))
            self.seen = self.seen.with_columns(wind=pl.Series(wind)).filter(pl.Series(good))

    def at(self, places: pl.DataFrame, blank: bool = True) -> tuple[Array, Array, Array]:
        """Wind towards east and north (m/s) and temperature deviation (K), (m,); NaN where others are too far away.

        Args:
            places: As :func:`observations`; the aircraft's own reports are never used.
            blank: Whether values with a large error are NaN.
        """
        from scipy.spatial import cKDTree

        air = np.full((3, len(places)), np.nan)
        count = min(NEIGHBOURS, len(self.seen))
        if not count:
            return air[0], air[1], air[2]
        seen, here, wind = self._scaled(self.seen), self._scaled(places), self.seen["wind"].to_numpy()
        names, own = self.seen["aircraft"], places["aircraft"]
        number = {name: i for i, name in enumerate(pl.concat([names, own]).unique())}
        other, aircraft = (column.replace_strict(number).to_numpy() for column in (names, own))
        whole = np.flatnonzero(np.isfinite(here).all(1))
        tree, k_nearest = cKDTree(seen), list(range(1, count + 1))
        course, tracks = (
            np.arctan2(table["sine"].to_numpy(), table["cosine"].to_numpy()) for table in (self.seen, places)
        )
        for part in np.array_split(whole, -(-len(whole) // AT_ONCE)) if len(whole) else []:
            _, k = tree.query(here[part], k=k_nearest)
            usable = (other[k] != aircraft[part, None]) & (
                np.abs(seen[k][..., 2] - here[part, None, 2]) < LATEST_S / LENGTH_S
            )
            for rows, what, angle, values, ahead in (
                ((0, 1), WIND, course, wind, tracks[part]),
                ((2, 2), TEMPERATURE, 0 * course, self.seen["deviation"].to_numpy(), 0 * tracks[part]),
            ):
                east, north, error = _kriged(seen[k], here[part], other[k], angle[k], values[k], usable, what, ahead)
                far = blank & ~(error <= what.worst)
                # A scalar is the component of winds that all blow along tracks to the north.
                air[rows[0], part], air[rows[1], part] = np.where(far, np.nan, east), np.where(far, np.nan, north)
        return air[0], air[1], air[2]

    def _scaled(self, places: pl.DataFrame) -> Array:
        """East, north, time and height (n, 4), in lengths."""
        latitude, longitude, unix_s, altitude_m = (
            places[name].to_numpy() for name in ("latitude", "longitude", "unix_s", "altitude_m")
        )
        east = ((longitude - self._middle[1] + 180) % 360 - 180) * np.cos(np.radians(self._middle[0]))
        flat = [EARTH_KM / LENGTH_KM * east, EARTH_KM / LENGTH_KM * latitude, unix_s / LENGTH_S]
        return np.stack([*flat, (altitude_m - MIDDLE_M) / LENGTH_M], 1)


def _kriged(
    seen: Array, here: Array, other: Array, angle: Array, values: Array, usable: Array, what: Quantity, ahead: Array
) -> tuple[Array, Array, Array]:
    """Both components (m,) of a vector, of which k observations (m, k) see the one along an angle, and an error (m,).

    It is the standard error of the component along `ahead`.
    """
    inside = _covariance(seen[:, :, None], seen[:, None], what) * np.cos(angle[:, :, None] - angle[:, None])
    inside += what.own**2 * (other[:, :, None] == other[:, None])
    # An observation that is not used errs by more than anything is.
    inside += np.eye(seen.shape[1]) * np.where(usable, what.white**2, 1e9)[:, None]
    across = np.where(usable, _covariance(seen, here[:, None], what), 0.0)
    sides = np.stack([np.where(usable, values, 0.0), across * np.cos(angle - ahead[:, None])], -1)
    weights = np.linalg.solve(inside, sides)
    east, north = ((across * part(angle) * weights[..., 0]).sum(1) for part in (np.sin, np.cos))
    own = _covariance(here, here, what)
    return east, north, np.sqrt(np.maximum(own - (sides[..., 1] * weights[..., 1]).sum(1), 0.0))


def _covariance(first: Array, second: Array, what: Quantity) -> Array:
    """Covariance of a quantity at two places (..., 4)."""
    away = np.abs(first - second)
    high = np.sqrt(5.0) * away[..., 3]
    apart = np.hypot(away[..., 0], away[..., 1]) + away[..., 2]
    line = first[..., 3] * second[..., 3] * (LENGTH_M / TREND_M) ** 2
    return np.asarray(DIFFUSE**2 * (1 + line) + what.departure**2 * (1 + high + high**2 / 3) * np.exp(-high - apart))
