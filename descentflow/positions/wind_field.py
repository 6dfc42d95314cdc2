"""The wind of a weather model over the ground."""

from dataclasses import dataclass, replace

import numpy as np

from descentflow.air.weather_field import Points, WeatherField
from descentflow.air.weather_file import Source, opened, readable
from descentflow.air.weather_layout import EAST, NORTH, Array


@dataclass(frozen=True)
class FieldWind:
    """The wind of a field, see :class:`~descentflow.positions.wind_by_level.Wind`.

    The highest and the lowest level are held outside of them, and a single time at every time.

    Attributes:
        field: With a wind.
        levels_fl: (2,) its lowest and highest level.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> westerly = np.array([10.0, 40.0])[:, None, None] + np.zeros((1, 2, 2))
        >>> winds = {"u": westerly, "v": 0 * westerly}
        >>> winds = {name: (tuple(axes), values, {"units": "m s**-1"}) for name, values in winds.items()}
        >>> xarray.Dataset(winds, axes).to_netcdf("wind.nc")
        >>> read_wind_field("wind.nc").at(450.0, np.array([51.0]), np.array([5.0]), None)[0]
        array([40.])
    """

    field: WeatherField
    levels_fl: Array

    def at(self, level_fl: float, latitude: Array, longitude: Array, unix_s: Array | None) -> tuple[Array, Array]:
        """Components towards east and north (m/s).

        Raises:
            ConfigError: If the field has several times and the flights' is not known.
            DataError: If the field has no value at a place or a time.
        """
        if unix_s is None or len(self.field.times) == 1:
            unix_s = np.asarray(self.field.only_time)
        points = Points(unix_s, np.clip(level_fl, *self.levels_fl), latitude, longitude)
        east, north = (self.field.read(name, points) for name in (EAST, NORTH))
        if np.isnan(east + north).any():
            self.field.check(points)
        return east, north


def read_wind_field(source: Source) -> FieldWind:
    """Read a field of wind on pressure levels, all of it.

    Args:
        source: NetCDF or GRIB, a folder of them, or several, see :func:`descentflow.air.weather_file.opened`. The
            variables are found by their standard name (``eastward_wind``, ``northward_wind``) or as ``u`` and ``v``.

    Raises:
        ConfigError: If a library is missing.
        DataError: If a file cannot be read, or has no such wind, or one in another unit.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> winds = {name: (tuple(axes), np.full((2, 2, 2), 7.0), {"units": "m s**-1"}) for name in "uv"}
        >>> xarray.Dataset(winds, axes).to_netcdf("wind.nc")
        >>> read_wind_field("wind.nc").levels_fl.round()
        array([183., 340.])
    """
    loaded = []
    with opened(source) as parts:
        for part in parts:
            with readable(part.path):
                winds = {name: part.variables[name].load() for name in (EAST, NORTH) if name in part.variables}
            loaded.append(replace(part, variables=winds))
    field = WeatherField(loaded, needed=(EAST, NORTH))
    return FieldWind(field, np.asarray(field.extent(EAST).level_fl))
