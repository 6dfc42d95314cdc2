"""The wind of a weather model, from NetCDF or GRIB, as xarray reads it (ERA5, and what is laid out like it)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from descentflow.air.weather_field import EAST, NORTH
from descentflow.air.weather_file import VARIABLES, Array, WeatherFile, opened, unusable
from descentflow.core.errors import ConfigError, DataError


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
    """Read a field of wind on pressure levels, all of it.

    Args:
        path: NetCDF or GRIB, see :func:`descentflow.air.weather_file.opened`. The variables are found by their standard
            name (``eastward_wind``, ``northward_wind``) or as ``u`` and ``v``.

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
    with opened(path) as file:
        return wind_of(file)


def wind_of(file: WeatherFile) -> WindField:
    """The wind of an open file.

    Raises:
        DataError: If it has none.

    Example:
        >>> import xarray
        >>> from descentflow.air.weather_file import weather_file_of
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> winds = xarray.Dataset({name: (tuple(axes), np.full((2, 2, 2), 7.0)) for name in "uv"}, axes)
        >>> wind_of(weather_file_of(winds, "wind.nc")).wind_mps.shape
        (1, 2, 2, 2, 2)
    """
    absent = [name for name in (EAST, NORTH) if name not in file.variables]
    if absent:
        there = ", ".join(VARIABLES[name][0] for name in file.variables) or "no variables"
        raise unusable(f"{file.path} without {absent[0]} among {there}")
    unix_s = np.zeros(1) if file.unix_s is None else file.unix_s
    order = np.argsort(unix_s)
    parts = [np.stack([file.at_time(name, number) for number in order.tolist()]) for name in (EAST, NORTH)]
    return WindField(unix_s[order], file.levels_fl, file.latitude, file.longitude, np.stack(parts, -1))
