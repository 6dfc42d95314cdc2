"""Files of a weather model on pressure levels, NetCDF or GRIB, as xarray reads them: ERA5, and what is laid out alike.

A pressure level is a flight level: both are the pressure altitude of the standard atmosphere.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.core.errors import DataError
from descentflow.core.tabular import optional_library
from descentflow.core.units import FL_M
from descentflow.physics.atmosphere import pressure_altitude_m

Array = NDArray[np.float64]
GRIB = (".grib", ".grb", ".grib2", ".grb2")
SUFFIXES = (".nc", ".nc4", *GRIB)
AXES = {
    "time": ("time", "valid_time"),
    "pressure": ("isobaricInhPa", "pressure_level", "level", "plev", "isobaric"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon"),
}
"""Axis -> its names in files: ecCodes', those of both layouts of the Climate Data Store, and CF's."""
VARIABLES = {
    "air_temperature": ("t", "ta"),
    "eastward_wind": ("u", "ua"),
    "northward_wind": ("v", "va"),
}
"""Standard name -> other names of the variable."""
_UNITS = {"air_temperature": ("K", "Kelvin", "kelvin")}
_SPEEDS = ("m/s", "ms-1", "m.s-1")
_PER_HPA = {"hPa": 1.0, "mb": 1.0, "mbar": 1.0, "millibar": 1.0, "millibars": 1.0, "Pa": 0.01}
_VERSION = "expver"
"""ERA5 of the last months has a dimension of both versions, each missing where the other is not."""


@dataclass(frozen=True)
class WeatherFile:
    """An open file: its axes, ascending, and its fields, which are read time by time.

    Attributes:
        path: The file.
        unix_s: (t,) seconds since 1970, in the order of the file; None where it has no time.
        levels_fl: (k,) ascending flight levels.
        latitude: (p,) ascending degrees.
        longitude: (q,) ascending degrees, eastwards from the west end on, which is from -180 to 180; around the globe,
            the first meridian ends them again.
        variables: Those of :data:`VARIABLES` that it has, as xarray's arrays.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> warm = xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 250.0))}, axes)
        >>> file = weather_file_of(warm, "warm.nc")
        >>> file.levels_fl.round(), file.latitude, file.at_time("air_temperature", 0).shape
        (array([183., 340.]), array([50., 52.]), (2, 2, 2))
    """

    path: str
    unix_s: Array | None
    levels_fl: Array
    latitude: Array
    longitude: Array
    variables: dict[str, Any]
    _time: str | None
    _places: tuple[str, str, str]
    _orders: tuple[NDArray[np.int64], ...]

    def at_time(self, name: str, number: int) -> Array:
        """A field (k, p, q) on the ascending axes at one time of the file.

        Args:
            name: Standard name, one of :attr:`variables`.
            number: Of the time; 0 where the file has none.

        Raises:
            DataError: If the file is damaged there.
        """
        with readable(self.path):
            variable = self.variables[name]
            if self._time is not None and self._time in variable.dims:
                variable = variable.isel({self._time: number})
            versions = [variable.isel({_VERSION: i}) for i in range(variable.sizes.get(_VERSION, 0))] or [variable]
            values = _cube(versions[0], self._places)
            for other in versions[1:]:
                values = np.where(np.isnan(values), _cube(other, self._places), values)
        found: Array = values[np.ix_(*self._orders)]
        return found

    def eastwards(self, longitude: Array) -> Array:
        """Longitudes counted as this file's: from its west end on."""
        west = self.longitude[0]
        counted: Array = (longitude - west) % 360 + west
        return counted


@contextmanager
def opened(path: str | Path) -> Iterator[WeatherFile]:
    """Open a file: NetCDF (``.nc``) by netCDF4 or h5netcdf, GRIB (``.grib``, ``.grib2``) by cfgrib.

    Raises:
        ConfigError: If a library is missing.
        DataError: If the file cannot be read, or is not laid out by pressure level, latitude and longitude.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 250.0))}, axes).to_netcdf("warm.nc")
        >>> with opened("warm.nc") as file:
        ...     list(file.variables)
        ['air_temperature']
    """
    import pyproj  # noqa: F401 - before ecCodes, which brings a PROJ of its own that pyproj crashes with

    xarray = optional_library("xarray", extra="wind")
    path = Path(path)
    if path.suffix in GRIB:
        optional_library("cfgrib", extra="wind")
    # No index beside the file: it would be left behind.
    grib = {"engine": "cfgrib", "backend_kwargs": {"indexpath": ""}} if path.suffix in GRIB else {}
    with readable(path):
        data = xarray.open_dataset(path, **grib)
    with data:
        with readable(path):
            file = weather_file_of(data, str(path))
        yield file


@contextmanager
def readable(path: str | Path) -> Iterator[None]:
    """Turn what the libraries raise for a damaged file into one line.

    Example:
        >>> with readable("a.nc"):
        ...     raise OSError("no HDF5")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: weather a.nc: no HDF5; expected a NetCDF or GRIB file ...
    """
    try:
        yield
    except (OSError, ValueError, EOFError, RuntimeError) as error:
        raise DataError(
            f"weather {path}: {str(error).splitlines()[0] if str(error) else type(error).__name__}",
            expected="a NetCDF or GRIB file of a weather model on pressure levels",
            mend="check the path and the file; reading needs: pip install 'descentflow[wind]'",
        ) from error


def weather_file_of(data: Any, path: str) -> WeatherFile:
    """The same of an `xarray.Dataset`.

    Raises:
        DataError: If it is not laid out by pressure level, latitude and longitude.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0], "latitude": [52.0, 50.0], "longitude": [350.0, 10.0]}
        >>> warm = xarray.Dataset({"t": (tuple(axes), np.full((1, 2, 2), 250.0))}, axes)
        >>> weather_file_of(warm, "warm.nc").longitude
        array([-10.,  10.])
    """
    axes = {name: _axis(data, names, path, required=name != "time") for name, names in AXES.items()}
    time = axes["time"]
    level, latitude, longitude = (_numbers(data[axes[name]]) for name in ("pressure", "latitude", "longitude"))
    levels_fl = _levels(data[axes["pressure"]], level, path)
    ascending = np.argsort(levels_fl), np.argsort(latitude), _eastwards_order(longitude)
    places = str(axes["pressure"]), str(axes["latitude"]), str(axes["longitude"])
    # GRIB of a forecast counts its times by the step.
    along = data[time].dims[0] if time is not None and data[time].dims else None
    found = {name: _variable(data, name, path) for name in VARIABLES}
    variables = {name: variable for name, variable in found.items() if variable is not None}
    for variable in variables.values():
        others = set(variable.dims) - {*places, along, _VERSION}
        if others or not set(places[1:]) <= set(variable.dims):
            raise unusable(f"{path}: {variable.name} over {', '.join(map(str, variable.dims))}")
    eastwards = longitude[ascending[2]]
    eastwards = (eastwards - eastwards[0]) % 360 + (eastwards[0] + 180) % 360 - 180
    if len(eastwards) > 1 and ascending[2][0] == ascending[2][-1]:
        eastwards[-1] = eastwards[0] + 360
    return WeatherFile(
        path,
        None if time is None else _seconds(data[time]),
        levels_fl[ascending[0]],
        latitude[ascending[1]],
        eastwards,
        variables,
        None if along is None else str(along),
        places,
        ascending,
    )


def paths_of(source: str | Path | Sequence[str | Path]) -> list[Path]:
    """The files that a path stands for: itself, or those of a folder, or several.

    Raises:
        DataError: If a folder holds none.

    Example:
        >>> [path.name for path in paths_of(["a.nc", "b.grib"])]
        ['a.nc', 'b.grib']
    """
    if not isinstance(source, str | Path):
        return [path for one in source for path in paths_of(one)]
    path = Path(source)
    if not path.is_dir():
        return [path]
    found = sorted(one for one in path.iterdir() if one.suffix in SUFFIXES)
    if not found:
        raise DataError(
            f"no file of weather in {path}", expected=f"files {', '.join(SUFFIXES)}", mend="name another folder"
        )
    return found


def _cube(variable: Any, places: tuple[str, str, str]) -> Array:
    values: Array = variable.transpose(*(axis for axis in places if axis in variable.dims)).to_numpy()
    values = values.astype(np.float64)
    return values if places[0] in variable.dims else values[None]


def _axis(data: Any, names: tuple[str, ...], path: str, *, required: bool) -> str | None:
    found = [name for name in names if name in data.coords or name in data.dims]
    # GRIB has the time of the forecast and the valid time: the one that goes along a dimension counts.
    found.sort(key=lambda name: (name not in data.dims, not data[name].dims))
    if not found and required:
        raise unusable(f"{path} without a coordinate {names[0]}")
    return found[0] if found else None


def _variable(data: Any, standard: str, path: str) -> Any | None:
    found = [each for each in data.data_vars.values() if each.attrs.get("standard_name") == standard]
    found += [data[name] for name in VARIABLES[standard] if name in data.data_vars]
    if not found:
        return None
    allowed = _UNITS.get(standard, _SPEEDS)
    unit = str(found[0].attrs.get("units", allowed[0])).replace("**", "").replace(" ", "")
    if unit not in allowed:
        raise unusable(f"{path}: {found[0].name} in {unit}")
    return found[0]


def _numbers(coordinate: Any) -> Array:
    return np.atleast_1d(coordinate.to_numpy()).astype(np.float64)


def _levels(pressure: Any, values: Array, path: str) -> Array:
    unit = str(pressure.attrs.get("units", "hPa"))
    if unit not in _PER_HPA:
        raise unusable(f"{path}: levels in {unit}")
    found: Array = pressure_altitude_m(torch.from_numpy(100 * _PER_HPA[unit] * values)).numpy() / FL_M
    return found


def _eastwards_order(longitude: Array) -> NDArray[np.int64]:
    """Positions of the meridians eastwards from the end of the widest gap; around the globe, the first one ends them.

    So a region across Greenwich or the date line is one region, however its longitudes are counted.
    """
    east = longitude % 360
    order = np.argsort(east)
    if len(order) < 2:
        return order
    gaps = np.diff(east[order], append=east[order[0]] + 360)
    if gaps.max() <= gaps.min() + 1e-3:
        start = int(np.argmin((longitude[order] + 180) % 360))
        return np.append(np.roll(order, -start), order[start])
    return np.roll(order, -int(np.argmax(gaps)) - 1)


def _seconds(time: Any) -> Array:
    stamps = np.atleast_1d(time.to_numpy()).astype("datetime64[ns]").astype(np.int64)
    return np.asarray(stamps / 1e9)


def unusable(got: str) -> DataError:
    """The error for a file that is not such a field.

    Example:
        >>> str(unusable("a.nc without winds")).split(";")[0]
        'a.nc without winds'
    """
    return DataError(
        got,
        expected="temperature in K or eastward and northward wind in m/s by pressure level, latitude and longitude, "
        "and time if there are several",
        mend="cut such a file from the analysis, for instance ERA5's t, u and v on pressure levels",
    )
