"""Temperature by the height between pressure levels, and wind by other aircraft: checks that a diagnosis never saw."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from descentflow.core.constants import G0_MPS2, KAPPA, LAPSE_K_M, R_AIR, T0_K, TROPOPAUSE_M
from descentflow.core.errors import DataError
from descentflow.core.units import FT_M, KT_MPS

Array = NDArray[np.float64]
EARTH_RADIUS_M: Final = 6_371_000.0
MIN_SPAN_FT: Final = 3000.0
"""Below this the steps of 25 ft leave a flight's deviation too uncertain."""


def _isa_k(altitude_m: Array) -> Array:
    """Temperature of the standard atmosphere."""
    return np.asarray(T0_K + LAPSE_K_M * np.minimum(altitude_m, TROPOPAUSE_M))


def gravity_mps2(latitude_deg: Array, height_m: Array) -> Array:
    """Gravity (m/s2) by the formula of 1980 at sea level (Moritz 2000), minus the free-air gradient.

    Args:
        latitude_deg: Latitudes.
        height_m: Heights above the sea, of the same shape.

    Returns:
        Gravity, of that shape.

    Example:
        >>> gravity_mps2(np.array([0.0, 45.0, 90.0]), np.zeros(3)).round(3)
        array([9.78 , 9.806, 9.832])
    """
    square = np.sin(np.radians(latitude_deg)) ** 2
    surface = 9.7803267715 * (1 + 0.0052790414 * square + 0.0000232718 * square**2)
    return np.asarray(surface * (1 - 2 * height_m / EARTH_RADIUS_M))


@dataclass(frozen=True)
class Deviation:
    """Deviation from the standard temperature, as heights give it.

    Attributes:
        mean_k: Over the flights, weighted by the height that each spans.
        error_k: Standard error of that, from the scatter between aircraft.
        by_flight: Columns ``flight_id icao24 deviation_k span_ft low_fl high_fl``.

    Example:
        >>> by_flight = pl.DataFrame({"flight_id": ["a", "b"], "deviation_k": [9.0, 11.0], "span_ft": [1e4, 1e4]})
        >>> mean_k, error_k = weighted_mean(by_flight["deviation_k"].to_numpy(), by_flight["span_ft"].to_numpy())
        >>> found = Deviation(mean_k, error_k, by_flight)
        >>> found.mean_k, found.error_k
        (10.0, 1.0)
    """

    mean_k: float
    error_k: float
    by_flight: pl.DataFrame


def hypsometric_deviation(frame: pl.DataFrame, *, latitude_deg: float | None = None) -> Deviation:
    """Deviation from ISA by geometric and pressure altitude alone.

    Hydrostatics: ``dh / dHp = T / T_isa g0 / g``, hence ``dh g / g0 - dHp = dT dHp / T_isa``. One
    deviation is fitted to each flight, with its own offset, which takes the receiver's datum with it, as the median of
    the slopes between its levels (Theil and Sen): a geometric altitude repeated from an earlier report would turn a
    least-squares line by tens of kelvins. Moist air counts with its virtual temperature, 1 to 2 K above its own at
    10,000 ft in the tropics.

    Args:
        frame: Descents with ``level_fl`` and ``geoaltitude`` (ft).
        latitude_deg: Where, for gravity; standard gravity if absent, as in a world.

    Returns:
        The deviation.

    Raises:
        DataError: If no flight spans 3,000 ft with a geometric altitude.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> found = hypsometric_deviation(read_descents("descents.parquet").frame)  # flown in standard air
        >>> abs(found.mean_k) < 0.5
        True
    """
    if "geoaltitude" not in frame.columns:
        raise DataError("descents without geometric altitude", expected="a geoaltitude column", mend="use other rows")
    found = []
    for flight in frame.drop_nulls("geoaltitude").partition_by("flight_id", maintain_order=True):
        flight = flight.sort("level_fl")
        pressure = flight["level_fl"].to_numpy() * 100 * FT_M
        height = flight["geoaltitude"].to_numpy() * FT_M
        span = float(np.ptp(pressure)) / FT_M if len(flight) else 0.0
        if span < MIN_SPAN_FT:
            continue
        weight = np.ones_like(height)
        if latitude_deg is not None:
            weight = gravity_mps2(np.full_like(height, latitude_deg), height) / G0_MPS2
        middle = (height[1:] + height[:-1]) / 2
        ratio = np.interp(middle, height, weight) if np.all(np.diff(height) > 0) else (weight[1:] + weight[:-1]) / 2
        # Geopotential height, and the integral of dHp / T_isa, both from the lowest level up.
        potential = np.concatenate([[0.0], np.cumsum(ratio * np.diff(height))])
        lever = _integral(pressure)
        slope = float(stats.theilslopes(potential - (pressure - pressure[0]), lever).slope)
        found.append((flight["flight_id"][0], flight["icao24"][0], slope, span, *(pressure[[0, -1]] / FT_M / 100)))
    if not found:
        raise DataError(
            "no flight that spans 3,000 ft with geometric altitude", expected="one at least", mend="use other rows"
        )
    names = ("flight_id", "icao24", "deviation_k", "span_ft", "low_fl", "high_fl")
    table = pl.DataFrame(found, schema=list(names), orient="row")
    by_aircraft = table.group_by("icao24").agg(
        (pl.col("deviation_k") * pl.col("span_ft")).sum() / pl.col("span_ft").sum(), pl.col("span_ft").sum()
    )
    mean, error = weighted_mean(by_aircraft["deviation_k"].to_numpy(), by_aircraft["span_ft"].to_numpy())
    return Deviation(mean, error, table)


def _integral(pressure_m: Array) -> Array:
    """Integral of ``dHp / T_isa`` from the first level."""
    below = np.minimum(pressure_m, TROPOPAUSE_M)
    whole = np.log(_isa_k(below)) / LAPSE_K_M + (pressure_m - below) / _isa_k(np.array(TROPOPAUSE_M))
    return np.asarray(whole - whole[0])


def speed_deviation(frame: pl.DataFrame) -> Deviation:
    """Deviation from ISA by TAS and Mach number: ``T = (TAS / Mach)^2 / (kappa R)``, by flight.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> abs(speed_deviation(read_descents("descents.parquet").frame).mean_k) < 2
        True
    """
    known = frame.drop_nulls(["TAS", "Mach"])
    sound = known["TAS"].to_numpy() * KT_MPS / known["Mach"].to_numpy()
    warm = sound**2 / (KAPPA * R_AIR) - _isa_k(known["level_fl"].to_numpy() * 100 * FT_M)
    table = (
        known.with_columns(pl.Series("deviation_k", warm))
        .group_by("flight_id", "icao24", maintain_order=True)
        .agg(
            pl.col("deviation_k").mean(),
            (100.0 * (pl.col("level_fl").max() - pl.col("level_fl").min())).alias("span_ft"),
            pl.col("level_fl").min().cast(pl.Float64).alias("low_fl"),
            pl.col("level_fl").max().cast(pl.Float64).alias("high_fl"),
        )
    )
    mean, error = weighted_mean(table["deviation_k"].to_numpy(), table["span_ft"].to_numpy() + 100)
    return Deviation(mean, error, table)


def weighted_mean(values: Array, weights: Array) -> tuple[float, float]:
    """Weighted mean and its standard error from the scatter (infinite for one value).

    Example:
        >>> weighted_mean(np.array([1.0, 3.0]), np.array([1.0, 1.0]))
        (2.0, 1.0)
    """
    share = weights / weights.sum()
    mean = float(share @ values)
    if len(values) < 2:
        return mean, math.inf
    return mean, float(np.sqrt((share**2 * (values - mean) ** 2).sum() * len(values) / (len(values) - 1)))
