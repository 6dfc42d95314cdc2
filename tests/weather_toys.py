"""Files of a weather model that are written as the Climate Data Store writes ERA5, with values known in closed form."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import xarray

from descentflow.core.units import FL_M
from descentflow.physics.atmosphere import isa_temperature_k, pressure_altitude_m

PRESSURE_HPA = np.array([150.0, 200, 250, 300, 350, 400, 450, 500, 600, 700])
LATITUDE, LONGITUDE = np.arange(60.0, 43.9, -2.0), np.arange(-8.0, 18.1, 2.0)
START = np.datetime64("2024-03-03T00", "s")
HOURS = np.arange(0, 7 * 24 + 1, 6)
"""The days of the simulated world's flights."""
NEW, OLD = ("valid_time", "pressure_level"), ("time", "level")
Formula = Callable[..., object]


def levels_fl(pressure_hpa: np.ndarray = PRESSURE_HPA) -> np.ndarray:
    return pressure_altitude_m(torch.from_numpy(100 * pressure_hpa)).numpy() / FL_M


def standard_k(level_fl: np.ndarray) -> np.ndarray:
    return isa_temperature_k(torch.from_numpy(np.asarray(level_fl, dtype=float)) * FL_M).numpy()


def weather(
    deviation: Formula,
    wind: Formula | None = None,
    *,
    names: tuple[str, str] = NEW,
    hours: np.ndarray = HOURS,
    longitude: np.ndarray = LONGITUDE,
) -> xarray.Dataset:
    """Temperature and wind of formulas of (hours, flight level, latitude, longitude)."""
    axes = {names[0]: START + hours.astype("timedelta64[h]"), names[1]: PRESSURE_HPA}
    axes = {**axes, "latitude": LATITUDE, "longitude": longitude}
    shape = tuple(len(axis) for axis in axes.values())
    grid = np.meshgrid(hours, levels_fl(), LATITUDE, longitude, indexing="ij")
    values = {"t": (np.broadcast_to(deviation(*grid), shape) + standard_k(grid[1]), "K")}
    if wind is not None:
        values |= {name: (np.broadcast_to(one, shape), "m s**-1") for name, one in zip("uv", wind(*grid), strict=True)}
    found = {name: (tuple(axes), np.array(value), {"units": unit}) for name, (value, unit) in values.items()}
    data = xarray.Dataset(found, {name: axis.astype("datetime64[ns]") if i == 0 else axis
                                  for i, (name, axis) in enumerate(axes.items())})  # fmt: skip
    data[names[1]].attrs["units"] = "hPa" if names == NEW else "millibars"
    return data


def written(data: xarray.Dataset, path: Path) -> Path:
    data.to_netcdf(path)
    return path
