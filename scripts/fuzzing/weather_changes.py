"""Damaged files of weather: a field in closed form, changed so that its values stay certain or nothing can be read."""

import contextlib
import random
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from descentflow.core.units import KT_MPS
from descentflow.positions.wind import read_wind_field
from descentflow.weather.weather_field import Points, weather_field
from fuzzing.byte_changes import damaged
from fuzzing.good_files import TESTS

sys.path.insert(0, str(TESTS))
from weather_toys import START, linear, linear_wind, weather, written_as_grib

HOURS = np.arange(0, 25, 6)
AXES = ("valid_time", "pressure_level", "latitude", "longitude")
TOLERANCE = 0.05
"""K and m/s: what is packed in 16 bits is 0.003 off."""
NAMES = (
    "t",
    "ta",
    "u",
    "v",
    "ua",
    "lat",
    "plev",
    "level",
    "time",
    "valid_time",
    "step",
    "number",
    "",
    "T",
    "temperature",
)
UNITS = ("", "1", "K", "degC", "Pa", "hPa", "mbar", "m", "%", "kelvins per hour", "?", "degrees_north", "radians")
STANDARD = ("air_temperature", "eastward_wind", "northward_wind", "x_wind", "air_pressure", "unknown", "")


def whole() -> xarray.Dataset:
    """Temperature and wind that are linear in time, level and place, as the Climate Data Store lays them out."""
    return weather(linear, linear_wind, hours=HOURS)


def write_damaged(folder: Path, rng: random.Random) -> tuple[Path, bool]:
    """Write a damaged file.

    Args:
        folder: Gets ``era5.nc`` or ``era5.grib2``.
        rng: Chooses the damage.

    Returns:
        Its path, and whether values that it gives must be those of the closed form: bytes of them may have changed.
    """
    data = whole()
    grib = rng.random() < 0.25
    changes = GRIB_CHANGES if grib else CHANGES
    for change in rng.choices(changes, k=rng.choice((1, 1, 1, 2, 3))):
        with contextlib.suppress(Exception):  # a change before has taken what this one needs
            data = change(data, rng)
    path = folder / ("era5.grib2" if grib else "era5.nc")
    if grib:
        _write_grib(data, path, rng)
    else:
        _write_netcdf(data, path, rng)
    if rng.random() < 0.15:
        path.write_bytes(path.read_bytes()[: rng.randrange(path.stat().st_size)])
    elif rng.random() < 0.1:
        path.write_bytes(damaged(path.read_bytes(), rng))
        return path, False
    return path, True


def wrong_values(path: Path, seed: int) -> str:
    """Values of a file that differ from the closed form; empty if none, for holes and what is outside is NaN.

    Args:
        path: Of the file.
        seed: Of the places.

    Raises:
        DataError: If the file is refused.
    """
    rng = np.random.default_rng(seed)
    hours = rng.uniform(-1, 25, 200)
    places = rng.uniform(90, 460, 200), rng.uniform(43, 61, 200), rng.uniform(-9, 19, 200)
    points = Points(START.astype(float) + 3600 * hours, *places)
    with weather_field(path) as field:
        read, windy = field.at(points), field.wind
        inside = np.isfinite(read[0])
        expected = linear(hours, *places), *(linear_wind(hours, *places) if windy else (np.zeros(200),) * 2)
        if not field.times:
            return ""  # it holds at every time
        for name, got, true in zip(("deviation", "east", "north"), read, expected, strict=True):
            off = np.abs(got - true) > TOLERANCE
            if off.any():
                return f"{name} {got[off][0]:g} in place of {np.asarray(true)[off][0]:g}, wind: {windy}"
        field.check(points.rows(inside) if inside.any() else points)
    if windy:
        some = points.rows(inside)
        wind = read_wind_field(path)
        level = float(np.clip(300.0, *wind.levels_fl))
        found_there = wind.at(level, some.latitude, some.longitude, np.asarray(some.unix_s))
        expected_there = linear_wind(hours[inside], level, some.latitude, some.longitude)
        if (np.abs(np.subtract(found_there, expected_there)) > TOLERANCE).any():
            return f"--wind {found_there} in place of {expected_there}"
    return ""


def _write_netcdf(data: xarray.Dataset, path: Path, rng: random.Random) -> None:
    """In one of the formats and packings of NetCDF; what it cannot hold is written as it can."""
    packed = rng.random() < 0.3
    encoding: dict[str, dict[str, Any]] = {}
    for name, variable in data.data_vars.items():
        if packed and variable.dtype.kind == "f" and variable.size and np.isfinite(variable).all():
            low, high = float(variable.min()), float(variable.max())
            scale = max(high - low, 1e-3) / 65000
            encoding[str(name)] = {
                "dtype": "i2",
                "scale_factor": scale,
                "add_offset": (low + high) / 2,
                "_FillValue": -32768,
            }
    kind = rng.choice(("NETCDF4", "NETCDF4", "NETCDF3_CLASSIC", "NETCDF3_64BIT", "NETCDF4_CLASSIC"))
    try:
        data.to_netcdf(path, format=kind, encoding=encoding)
    except Exception:  # names, types and attributes that this format does not have
        path.unlink(missing_ok=True)
        whole().to_netcdf(path)


def _write_grib(data: xarray.Dataset, path: Path, rng: random.Random) -> None:
    """Message by message, some of which are lost, twice, out of order or of another kind."""
    settings = {}
    if rng.random() < 0.2:
        settings = {"typeOfLevel": rng.choice(("heightAboveGround", "hybrid", "isobaricInPa"))}
    written_as_grib(data, path, **settings)
    parts = path.read_bytes().split(b"GRIB")[1:]
    for _ in range(rng.choice((0, 0, 1, 3, 20))):
        at = rng.randrange(len(parts))
        change = rng.random()
        if change < 0.4 and len(parts) > 1:
            del parts[at]
        elif change < 0.7:
            parts.append(parts[at])
        else:
            parts[at], parts[-1] = parts[-1], parts[at]
    path.write_bytes(b"".join(b"GRIB" + part for part in parts))
    if rng.random() < 0.3:  # another kind of level as well
        other = whole().isel(pressure_level=[0], valid_time=[0])
        written_as_grib(other, path, typeOfLevel="heightAboveGround", level=rng.choice((2, 10)))


def _attribute(data: xarray.Dataset, rng: random.Random) -> xarray.Dataset:
    """An attribute lost, or another one that contradicts names or values."""
    data = data.copy()
    name = rng.choice(list(data.variables))
    key = rng.choice(("units", "units", "standard_name"))
    if rng.random() < 0.3:
        data[name].attrs.pop(key, None)
        return data
    value = rng.choice(UNITS if key == "units" else STANDARD)
    data[name].attrs[key] = rng.choice((value, value, value.upper(), 3.0, [1, 2]))
    return data


def _values(data: xarray.Dataset, rng: random.Random) -> xarray.Dataset:
    """Values of a variable in another unit, type or order of size, or with holes."""
    name = rng.choice(list(data.data_vars))
    old = data[name]
    where = xarray.zeros_like(old, dtype=bool)
    where[tuple(slice(rng.randrange(size)) for size in old.shape)] = True
    where = where if rng.random() < 0.5 else ~where
    fill = rng.choice((np.nan, np.nan, 1e20, -9999.0, 9.96921e36, np.inf, -32767.0, 1e30))
    changes: tuple[Callable[[], xarray.DataArray], ...] = (
        lambda: old.where(where, fill),
        lambda: (old - 273.15) if name == "t" else old,
        lambda: (old / KT_MPS).assign_attrs(units="kt") if old.attrs["units"] == "m s**-1" else old,
        lambda: (old - 273.15).assign_attrs(units=rng.choice(("degC", "C", "celsius"))) if name == "t" else old,
        lambda: old.assign_attrs(units="degC") if name == "t" else old * 1000,
        lambda: old.astype(rng.choice(("f4", "f8", ">f4"))),
        lambda: old.astype(str) if rng.random() < 0.5 else old.astype("timedelta64[s]"),
        lambda: old * np.nan,
        lambda: old.isel(pressure_level=0, drop=True),
        lambda: old.isel(valid_time=0, drop=True),
        lambda: old.expand_dims(number=[0, 1]),
        lambda: old.expand_dims(number=[0]),
        lambda: old.where(old["valid_time"] != old["valid_time"][2]),
        lambda: old.transpose(*rng.sample(AXES, 4)),
    )
    new = rng.choice(changes)()
    return data.assign({name: new.assign_attrs({**old.attrs, **new.attrs})})


def _axis(data: xarray.Dataset, rng: random.Random) -> xarray.Dataset:
    """An axis in another order, counted otherwise, doubled, cut, with places that are none, or gone."""
    axis = rng.choice(AXES)
    if axis not in data.dims or not set(AXES) <= set(data.coords):
        return data
    size = data.sizes[axis]
    some = sorted(rng.sample(range(size), rng.randrange(1, size)))
    place = rng.randrange(size)
    missing = np.datetime64("NaT") if axis == "valid_time" else np.nan
    doubled = [*range(size), place]
    changes: tuple[Callable[[], xarray.Dataset], ...] = (
        lambda: data.isel({axis: slice(None, None, -1)}),
        lambda: data.isel({axis: rng.sample(range(size), size)}),
        lambda: data.isel({axis: doubled}),
        lambda: xarray.concat([data, data.isel({axis: [place]}) + 7.0], axis, data_vars="all"),
        lambda: data.isel({axis: some}),
        lambda: data.isel({axis: place}),
        lambda: data.isel({axis: place}, drop=True),
        lambda: data.isel({axis: [place]}),
        lambda: data.isel({axis: []}),
        lambda: data.drop_vars(axis),
        lambda: data.assign_coords({axis: data[axis].where(np.arange(size) != place, missing)}),
        lambda: data.assign_coords({axis: data[axis].astype(str)}),
        lambda: data.assign_coords({axis: data[axis].astype("f4" if axis != "valid_time" else "i8")}),
        lambda: data.assign_coords({axis: (AXES[2:], np.ones((data.sizes["latitude"], data.sizes["longitude"])))}),
        lambda: data.assign_coords(longitude=data["longitude"] % 360),
        lambda: data.assign_coords(longitude=data["longitude"] + rng.choice((-360, 360))),
        lambda: data.assign_coords(pressure_level=(100 * data["pressure_level"]).assign_attrs(units="Pa")),
        lambda: data.assign_coords(pressure_level=(100 * data["pressure_level"]).assign_attrs(units="hPa")),
        lambda: data.assign_coords(latitude=data["latitude"] + 40),
    )
    return rng.choice(changes)()


def _named(data: xarray.Dataset, rng: random.Random) -> xarray.Dataset:
    """A variable or an axis gone, twice, or of another name."""
    name = str(rng.choice([*data.variables]))
    other = rng.choice(NAMES)
    if rng.random() < 0.3:
        return data.drop_vars(name)
    if rng.random() < 0.3 and name == "t" and other not in data.variables:
        return data.assign({other: data[name]})
    # Of another quantity it would be a field of its own, which is as good as any.
    return data if other in data.variables or name in "tuv" else data.rename({name: other})


def _grid(data: xarray.Dataset, rng: random.Random) -> xarray.Dataset:
    """Damage to the content of GRIB: other levels, times and places, holes, variables that are gone."""
    name = rng.choice("tuv")
    changes: tuple[Callable[[], xarray.Dataset], ...] = (
        lambda: data.drop_vars(name, errors="ignore"),
        lambda: data.isel(valid_time=sorted(rng.sample(range(len(HOURS)), rng.randrange(1, len(HOURS))))),
        lambda: data.isel(pressure_level=slice(rng.randrange(3), None, rng.choice((1, 2)))),
        lambda: data.isel(latitude=slice(None, None, -1)),
        lambda: data.isel(longitude=slice(rng.randrange(5), None)),
    )
    return rng.choice(changes)() if data.sizes["valid_time"] == len(HOURS) else data


CHANGES = (_attribute, _values, _values, _axis, _axis, _named)
GRIB_CHANGES = (_grid,)
