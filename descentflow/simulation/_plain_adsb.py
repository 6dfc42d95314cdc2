"""Rows as plain ADS-B has them, in a wind that each day has, and the field of a weather model that errs.

The field's errors are smooth in time, height and place: one part is common to the hours and the region, one is alike
over some 8,000 ft of a flight, and a small one differs from point to point.
"""

from typing import Any

import numpy as np
import polars as pl
import torch
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.core.mode_s_steps import STEPS
from descentflow.core.tabular import optional_library
from descentflow.core.units import KT_MPS
from descentflow.physics.atmosphere import isa_temperature_k, pressure_altitude_m
from descentflow.simulation.observe import EARTH_RADIUS_M
from descentflow.simulation.world_config import WorldConfig

Array = NDArray[np.float64]

STREAM = 10
"""Of random numbers of the field."""
DAILY_MPS = 12.0
"""Spread of the components of the wind of midnights; between them it is linear in time."""
LEVELS_HPA = np.array([125.0, 150, 175, 200, 225, 250, 300, 350, 400, 450, 500, 550, 600, 650, 700, 750, 800, 850])
"""Pressure levels of ERA5."""
PARTS = ((0.25, (12.0, 1e9, 1e6)), (0.7, (4.0, 2500.0, 3e5)), (0.05, (1e-3, 1e-3, 1e-3)))
"""Shares of the errors' variance, and their lengths in hours, metres of height and metres of place: the common part,
that of a flight, and the white one."""
K_OF_MPS = 0.4
"""Error of the temperature, K, for each m/s of error of the wind."""
OWN_AIR = ("deviation_spread_k", "wind_mean_mps", "wind_slope_mean_per_s", "wind_slope_spread_per_s", "jet_mps",
           "shear_spread_per_s", "layer_spread_k", "daily_spread_k")  # fmt: skip
"""Settings that give flights an air of their own, which no field of places has."""


def check_common_air(config: WorldConfig) -> None:
    """Refuse a world whose flights have an air of their own, and one without xarray for its field.

    Raises:
        ConfigError: Naming the settings, or the library.

    Example:
        >>> check_common_air(WorldConfig(deviation_mean_k=10.0))
    """
    optional_library("xarray", extra="wind")
    if own := [name for name in OWN_AIR if np.max(getattr(config, name))]:
        raise ConfigError(
            f"rows without airspeeds of a world with {', '.join(own)}",
            expected="air that all flights of a time share, as the scenario plain has it",
            mend="leave out the scenario: each day gets a wind",
        )


def plain_adsb(rows: pl.DataFrame, seed: int, deviation_k: float, wind_error_mps: float) -> tuple[pl.DataFrame, Any]:
    """Rows without airspeeds and heading, moved by the wind, and the field by which they can be derived.

    Args:
        rows: Of flights in still air.
        seed: Of wind and errors.
        deviation_k: Temperature of the air less that of the standard atmosphere.
        wind_error_mps: Standard error of each component of the field's wind.

    Returns:
        The rows, and temperature (K) and wind (m/s) by hour, pressure level, latitude and longitude, as ERA5 has them
        (`xarray.Dataset`).

    Raises:
        ConfigError: If xarray is not installed.

    Example:
        >>> rows, field = plain_adsb(pl.read_parquet("rows.parquet"), 0, 0.0, 2.5)
        >>> "IAS" in rows.columns, sorted(field.data_vars)
        (False, ['t', 'u', 'v'])
    """
    xarray = optional_library("xarray", extra="wind")
    generator = np.random.default_rng((seed, STREAM))
    hour = rows["timestamp"].dt.epoch("us").to_numpy() / 3.6e9
    hours = np.arange(np.floor(hour.min()), np.ceil(hour.max()) + 1)
    midnights = 24 * np.arange(hours[0] // 24, hours[-1] // 24 + 2)
    daily = DAILY_MPS * generator.standard_normal((2, len(midnights)))
    rows = _moved(rows, *(np.interp(hour, midnights, component) for component in daily))
    altitude_m = pressure_altitude_m(torch.from_numpy(100 * LEVELS_HPA))
    places = [rows[name].to_numpy() for name in ("latitude", "longitude")]
    latitude, longitude = (np.arange(np.floor(place.min()) - 1, np.ceil(place.max()) + 2) for place in places)
    north_m, east_m = (np.radians(degrees) * EARTH_RADIUS_M for degrees in (latitude, longitude))
    east_m *= np.cos(np.radians(latitude.mean()))
    errors = _errors(generator, (hours, altitude_m.numpy(), north_m, east_m))
    mean = [isa_temperature_k(altitude_m).numpy()[:, None, None] + deviation_k]
    mean += [np.interp(hours, midnights, component)[:, None, None, None] for component in daily]
    axes = {"valid_time": (hours * 3.6e12).astype("datetime64[ns]"), "pressure_level": LEVELS_HPA,
            "latitude": latitude, "longitude": longitude}  # fmt: skip
    sizes = (K_OF_MPS * wind_error_mps, wind_error_mps, wind_error_mps)
    named = zip(("t", "u", "v"), ("K", "m s**-1", "m s**-1"), mean, sizes, errors, strict=True)
    field = xarray.Dataset(
        {name: (tuple(axes), (middle + size * error).astype(np.float32), {"units": unit})
         for name, unit, middle, size, error in named}, axes)  # fmt: skip
    field["pressure_level"].attrs["units"] = "hPa"
    return rows.drop("IAS", "Mach", "TAS", "heading"), field


def _moved(rows: pl.DataFrame, east_mps: Array, north_mps: Array) -> pl.DataFrame:
    """Rows of still air in a wind (n,): ground vectors, and places by its integral along each flight."""
    track, speed = np.radians(rows["track"].to_numpy()), rows["groundspeed"].to_numpy() * KT_MPS
    east, north = speed * np.sin(track) + east_mps, speed * np.cos(track) + north_mps
    moved = {"groundspeed": np.hypot(east, north) / KT_MPS, "track": np.degrees(np.arctan2(east, north)) % 360}
    blown = {"latitude": north_mps, "longitude": east_mps / np.cos(np.radians(rows["latitude"].to_numpy()))}
    seconds = (pl.col("timestamp").diff().over("flight_id").dt.total_microseconds() / 1e6).fill_null(0.0)
    return (
        rows.with_columns(pl.Series(name, np.rint(value / STEPS[name]) * STEPS[name]) for name, value in moved.items())
        .with_columns(
            (seconds * pl.Series(np.degrees(wind / EARTH_RADIUS_M))).alias(f"_{name}") for name, wind in blown.items()
        )
        .with_columns(pl.col(name) + pl.col(f"_{name}").cum_sum().over("flight_id") for name in blown)
        .drop(f"_{name}" for name in blown)
    )


def _errors(generator: np.random.Generator, axes: tuple[Array, ...]) -> Array:
    """Errors (3, t, k, p, q) of temperature and wind on axes, of variance one in the mean between the points."""
    whole = np.zeros((3, *map(len, axes)))
    for share, (hours, height_m, place_m) in PARTS:
        drawn = generator.standard_normal(whole.shape)
        for number, (axis, length) in enumerate(zip(axes, (hours, height_m, place_m, place_m), strict=True), 1):
            away = np.sqrt(5.0) * np.abs(axis[:, None] - axis) / length
            kernel = (1 + away + away**2 / 3) * np.exp(-away)
            # Linear interpolation between two points takes a third of their difference's variance away.
            kept = 1 - (1 - np.diagonal(kernel, 1).mean()) / 3
            root = np.linalg.cholesky(kernel + 1e-9 * np.eye(len(axis))) / np.sqrt(kept)
            drawn = np.moveaxis(np.tensordot(root, drawn, (1, number)), 0, number)
        whole += np.sqrt(share) * drawn
    return whole
