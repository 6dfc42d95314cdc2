"""Files of a weather model that are written as the Climate Data Store writes ERA5, with values known in closed form."""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import xarray

from descentflow.core.units import FL_M
from descentflow.physics.atmosphere import isa_temperature_k, pressure_altitude_m
from descentflow.weather.weather_field import Points

PRESSURE_HPA = np.array([150.0, 200, 250, 300, 350, 400, 450, 500, 600, 700])
LATITUDE, LONGITUDE = np.arange(60.0, 43.9, -2.0), np.arange(-8.0, 18.1, 2.0)
START = np.datetime64("2024-03-03T00", "s")
HOURS = np.arange(0, 7 * 24 + 1, 6)
"""The days of the simulated world's flights."""
NAMES = ("valid_time", "pressure_level")
Formula = Callable[..., object]


def levels_fl(pressure_hpa: np.ndarray = PRESSURE_HPA) -> np.ndarray:
    return pressure_altitude_m(torch.from_numpy(100 * pressure_hpa)).numpy() / FL_M


def standard_k(level_fl: np.ndarray) -> np.ndarray:
    return isa_temperature_k(torch.from_numpy(np.asarray(level_fl, dtype=float)) * FL_M).numpy()


def weather(
    deviation: Formula, wind: Formula | None = None, *, hours: np.ndarray = HOURS, longitude: np.ndarray = LONGITUDE
) -> xarray.Dataset:
    """Temperature and wind of formulas of (hours, flight level, latitude, longitude)."""
    axes = {NAMES[0]: START + hours.astype("timedelta64[h]"), NAMES[1]: PRESSURE_HPA}
    axes = {**axes, "latitude": LATITUDE, "longitude": longitude}
    shape = tuple(len(axis) for axis in axes.values())
    grid = np.meshgrid(hours, levels_fl(), LATITUDE, longitude, indexing="ij")
    values = {"t": (np.broadcast_to(deviation(*grid), shape) + standard_k(grid[1]), "K")}
    if wind is not None:
        values |= {name: (np.broadcast_to(one, shape), "m s**-1") for name, one in zip("uv", wind(*grid), strict=True)}
    variables = {name: (tuple(axes), np.array(value), {"units": unit}) for name, (value, unit) in values.items()}
    data = xarray.Dataset(variables, {name: axis.astype("datetime64[ns]") if i == 0 else axis
                                  for i, (name, axis) in enumerate(axes.items())})  # fmt: skip
    data[NAMES[1]].attrs["units"] = "hPa"
    return data


def some_points(hours: float) -> tuple[Points, np.ndarray]:
    """Points within the hours after :data:`START`, and how many hours after it each is."""
    rng = np.random.default_rng(1)
    after, *places = (rng.uniform(*ends, 200) for ends in ((0, hours), (110, 400), (45, 59), (-7, 17)))
    return Points(START.astype(float) + 3600 * after, *places), after


def written(data: xarray.Dataset, path: Path) -> Path:
    data.to_netcdf(path)
    return path


def linear(hours: object, level: object, latitude: object, longitude: object) -> object:
    return 4 + 0.05 * hours - 0.03 * (level - 250) + 0.2 * (latitude - 52) - 0.1 * longitude


def linear_wind(hours: object, level: object, latitude: object, longitude: object) -> tuple[object, object]:
    east = 20 + 0.1 * hours + 0.15 * (level - 250) + 0.7 * (latitude - 50) - 0.3 * longitude
    return east, 5 - 0.1 * hours + 0.05 * (level - 250) + 0.1 * (latitude - 50) + 0.4 * longitude


def written_as_grib(data: xarray.Dataset, path: Path, **settings: object) -> Path:
    """Each variable, time and level as a message of ecCodes with 24 bits a value: 45 m/s of range to 3e-6 m/s.

    Args:
        data: Over valid time, pressure level, latitude and longitude, as :func:`weather` makes it.
        path: To append to.
        settings: Other keys of ecCodes, for instance ``level``.
    """
    import pyproj  # noqa: F401 - before ecCodes, as descentflow has it
    import pytest

    eccodes = pytest.importorskip("eccodes", reason="cfgrib is an extra of descentflow (wind)")

    time, level, latitude, longitude = (data[name].to_numpy() for name in (*NAMES, "latitude", "longitude"))
    with path.open("ab") as file:
        for name in data.data_vars:
            for (t, stamp), (k, pressure) in itertools.product(enumerate(time), enumerate(level)):
                handle = eccodes.codes_grib_new_from_samples("regular_ll_pl_grib2")
                day, hour = str(stamp.astype("datetime64[h]")).split("T")
                keys = {
                    "shortName": name, "level": int(pressure), "dataDate": int(day.replace("-", "")),
                    "dataTime": 100 * int(hour), "Ni": len(longitude), "Nj": len(latitude), "bitsPerValue": 24,
                    "latitudeOfFirstGridPointInDegrees": latitude[0],
                    "latitudeOfLastGridPointInDegrees": latitude[-1],
                    "longitudeOfFirstGridPointInDegrees": longitude[0] % 360,
                    "longitudeOfLastGridPointInDegrees": longitude[-1] % 360,
                    "iDirectionIncrementInDegrees": abs(longitude[1] - longitude[0]),
                    "jDirectionIncrementInDegrees": abs(latitude[1] - latitude[0]),
                    "jScansPositively": int(latitude[1] > latitude[0]),
                }  # fmt: skip
                for key, value in (keys | settings).items():
                    eccodes.codes_set(handle, key, value)
                eccodes.codes_set_values(handle, data[name].to_numpy()[t, k].ravel())
                eccodes.codes_write(handle, file)
                eccodes.codes_release(handle)
    return path
