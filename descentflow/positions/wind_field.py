"""The wind of a weather model, from NetCDF or GRIB, as xarray reads it (ERA5, and what is laid out like it)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.tabular import optional_library
from descentflow.core.units import FL_M
from descentflow.physics.atmosphere import pressure_altitude_m

Array = NDArray[np.float64]
GRIB = (".grib", ".grb", ".grib2", ".grb2")
SUFFIXES = (".nc", ".nc4", *GRIB)
_NAMES = {
    "time": ("time", "valid_time"),
    "pressure": ("isobaricInhPa", "pressure_level", "level", "plev", "isobaric"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon"),
}
_WINDS = {"eastward_wind": ("u", "ua"), "northward_wind": ("v", "va")}
_PER_HPA = {"hPa": 1.0, "mb": 1.0, "mbar": 1.0, "millibar": 1.0, "millibars": 1.0, "Pa": 0.01}


@dataclass(frozen=True)
class WindField:
    """Wind on a grid of times, pressure levels, latitudes and longitudes, linear between them.

    Levels are flight levels (pressure altitude of the standard atmosphere); the highest and the lowest are held
    outside of them.

    Attributes:
        unix_s: (t,) ascending seconds since 1970; one for a field without a time or of a single one, which then is
            taken for every time.
        levels_fl: (k,) ascending.
        latitude: (p,) ascending degrees.
        longitude: (q,) ascending degrees.
        wind_mps: (t, k, p, q, 2) components towards east and north.

    Example:
        >>> grid = np.zeros((1, 2, 2, 2, 2))
        >>> grid[:, 1, :, :, 0] = 40.0  # a westerly of 40 m/s at the upper level
        >>> corners = np.array([50.0, 52.0]), np.array([4.0, 6.0])
        >>> field = WindField(np.zeros(1), np.array([100.0, 300.0]), *corners, grid)
        >>> field.at(250.0, np.array([51.0]), np.array([5.0]), None)[0]
        array([30.])
    """

    unix_s: Array
    levels_fl: Array
    latitude: Array
    longitude: Array
    wind_mps: Array

    def at(self, level_fl: float, latitude: Array, longitude: Array, unix_s: Array | None) -> tuple[Array, Array]:
        """Components towards east and north (m/s), see :class:`~descentflow.positions.wind_by_level.Wind`.

        Raises:
            ConfigError: If the field has several times and the flights' is not known.
            DataError: If the field does not hold a place or a time.
        """
        from scipy.interpolate import interpn

        axes, places = [self.latitude, self.longitude], [latitude, self._eastwards(longitude)]
        values = self._at_level(level_fl)
        if len(self.unix_s) == 1:
            values = values[0]
        else:
            if unix_s is None:
                raise ConfigError(
                    f"a field of wind with {len(self.unix_s)} times, and no time of the flights",
                    expected="the time at which the lowest level is passed",
                    mend="give --time, or a file with one time",
                )
            axes, places = [self.unix_s, *axes], [unix_s, *places]
        for name, axis, place in zip(("time", "latitude", "longitude")[-len(axes) :], axes, places, strict=True):
            _check_inside(name, axis, place)
        found = interpn(axes, values, np.stack(places, -1))
        return found[..., 0], found[..., 1]

    def _at_level(self, level_fl: float) -> Array:
        """(t, p, q, 2) at one level."""
        position = np.interp(level_fl, self.levels_fl, np.arange(len(self.levels_fl)))
        low = min(int(position), max(len(self.levels_fl) - 2, 0))
        share = position - low
        lower = self.wind_mps[:, low]
        return lower if share == 0 else (1 - share) * lower + share * self.wind_mps[:, low + 1]

    def _eastwards(self, longitude: Array) -> Array:
        """Longitudes counted as the grid counts them: from its west end on."""
        west = self.longitude[0]
        counted: Array = (longitude - west) % 360 + west
        return counted


def _check_inside(name: str, axis: Array, place: Array) -> None:
    if len(place) and not (axis[0] <= place.min() and place.max() <= axis[-1]):
        raise DataError(
            f"flights at {name} {_shown(name, place.min())} to {_shown(name, place.max())}, outside of the wind",
            expected=f"{name} {_shown(name, axis[0])} to {_shown(name, axis[-1])}",
            mend="take a larger field, or another end point or time",
        )


def _shown(name: str, value: float) -> str:
    return f"{np.datetime64(int(value), 's')}Z" if name == "time" else f"{value:.2f}"


def read_wind_field(path: str | Path) -> WindField:
    """Read a field of wind on pressure levels.

    Args:
        path: NetCDF (``.nc``) with xarray and netCDF4 or h5netcdf, or GRIB (``.grib``, ``.grib2``) with cfgrib. The
            variables are found by their standard name (``eastward_wind``, ``northward_wind``) or as ``u`` and ``v``.

    Raises:
        ConfigError: If a library is missing.
        DataError: If the file cannot be read, or has no such wind, or another unit than m/s.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> winds = {name: (tuple(axes), np.full((2, 2, 2), 7.0), {"units": "m s**-1"}) for name in "uv"}
        >>> xarray.Dataset(winds, axes).to_netcdf("wind.nc")
        >>> read_wind_field("wind.nc").levels_fl.round()
        array([183., 340.])
    """
    xarray = optional_library("xarray", extra="wind")
    path = Path(path)
    if path.suffix in GRIB:
        optional_library("cfgrib", extra="wind")
    try:
        # No index beside the file: it would be left behind.
        grib = {"engine": "cfgrib", "backend_kwargs": {"indexpath": ""}} if path.suffix in GRIB else {}
        with xarray.open_dataset(path, **grib) as data:
            return _field(data.load(), path)
    except (OSError, ValueError, EOFError) as error:
        raise DataError(
            f"wind {path}: {str(error).splitlines()[0] if str(error) else type(error).__name__}",
            expected="a NetCDF or GRIB file of winds on pressure levels",
            mend="check the path and the file; reading needs: pip install 'descentflow[wind]'",
        ) from error


def _field(data: Any, path: Path) -> WindField:
    axes = {name: _axis(data, names, path, required=name != "time") for name, names in _NAMES.items()}
    parts = []
    for standard, names in _WINDS.items():
        variable = _variable(data, standard, names, path)
        order = [axis for axis in axes.values() if axis is not None and axis in variable.dims]
        others = set(variable.dims) - set(order)
        if others or not {axes["latitude"], axes["longitude"]} <= set(order):
            raise _unusable(f"{path}: {variable.name} over {', '.join(map(str, variable.dims))}")
        values = variable.transpose(*order).to_numpy().astype(np.float64)
        for number, axis in enumerate(("time", "pressure")):
            if axes[axis] not in variable.dims:
                values = np.expand_dims(values, number)
        parts.append(values)
    time = np.zeros(1) if axes["time"] is None else _seconds(data[axes["time"]])
    grid = np.stack(parts, -1)
    places = [time, _levels(data[axes["pressure"]], path)]
    places += [np.atleast_1d(data[axes[name]].to_numpy()).astype(np.float64) for name in ("latitude", "longitude")]
    for number, values in enumerate(places):
        ascending = np.argsort(values)
        places[number], grid = values[ascending], np.take(grid, ascending, number)
    unix_s, levels_fl, latitude, longitude = places
    return _around(WindField(unix_s, levels_fl, latitude, longitude, grid))


def _around(field: WindField) -> WindField:
    """A field around the globe closed by its first meridian again."""
    east = field.longitude
    if len(east) < 2 or abs(east[-1] + (east[1] - east[0]) - east[0] - 360) > 1e-3:
        return field
    closed = np.concatenate([field.wind_mps, field.wind_mps[:, :, :, :1]], 3)
    return WindField(field.unix_s, field.levels_fl, field.latitude, np.append(east, east[0] + 360), closed)


def _axis(data: Any, names: tuple[str, ...], path: Path, *, required: bool) -> str | None:
    found = [name for name in names if name in data.coords or name in data.dims]
    # GRIB has the time of the forecast and the valid time: the one that is a dimension counts.
    found.sort(key=lambda name: name not in data.dims)
    if not found and required:
        raise _unusable(f"{path} without a coordinate {names[0]}")
    return found[0] if found else None


def _variable(data: Any, standard: str, names: tuple[str, ...], path: Path) -> Any:
    found = [each for each in data.data_vars.values() if each.attrs.get("standard_name") == standard]
    found += [data[name] for name in names if name in data.data_vars]
    if not found:
        raise _unusable(f"{path} without {standard} among {', '.join(map(str, data.data_vars)) or 'no variables'}")
    unit = str(found[0].attrs.get("units", "m/s")).replace("**", "").replace(" ", "")
    if unit not in ("m/s", "ms-1", "m.s-1"):
        raise _unusable(f"{path}: {found[0].name} in {unit}")
    return found[0]


def _levels(pressure: Any, path: Path) -> Array:
    unit = str(pressure.attrs.get("units", "hPa"))
    if unit not in _PER_HPA:
        raise _unusable(f"{path}: levels in {unit}")
    pascal = 100 * _PER_HPA[unit] * np.atleast_1d(pressure.to_numpy()).astype(np.float64)
    found: Array = pressure_altitude_m(torch.from_numpy(pascal)).numpy() / FL_M
    return found


def _seconds(time: Any) -> Array:
    stamps = np.atleast_1d(time.to_numpy()).astype("datetime64[ns]").astype(np.int64)
    return np.asarray(stamps / 1e9)


def _unusable(got: str) -> DataError:
    return DataError(
        got,
        expected="eastward and northward wind in m/s by pressure level, latitude and longitude, and time if there are "
        "several",
        mend="cut such a file from the analysis, for instance ERA5's u and v on pressure levels",
    )
