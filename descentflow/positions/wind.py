"""Winds: one for all levels, one by level, or the field of a weather model."""

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.core.units import KT_MPS
from descentflow.weather.weather_layout import EAST, NORTH

if TYPE_CHECKING:
    from descentflow.weather.weather_field import WeatherField
    from descentflow.weather.weather_file import WeatherSource

Array = NDArray[np.float64]
_WIND = re.compile(r"(?:(?P<level>\d+(?:\.\d+)?):)?(?P<direction>\d+(?:\.\d+)?)/(?P<speed>\d+(?:\.\d+)?)")


class Wind(Protocol):
    """Whatever tells the wind at a place.

    Example:
        >>> class OffTheSea:
        ...     def at(self, level_fl, latitude, longitude, unix_s):
        ...         return np.full_like(latitude, 5.0), np.zeros_like(latitude)
        >>> from descentflow.positions.ground_path import path_to
        >>> from descentflow.positions.ground_plan import GroundPlan
        >>> plan = GroundPlan(path_to((52.0, 4.0), track=90.0), wind=OffTheSea())
    """

    def at(self, level_fl: float, latitude: Array, longitude: Array, unix_s: Array | None) -> tuple[Array, Array]:
        """Components towards east and north (m/s) at one level and n places, and times if they are known."""


@dataclass(frozen=True)
class WindByLevel:
    """A wind that depends on the level alone: its components are linear between levels and held outside of them.

    Attributes:
        levels_fl: (k,) ascending flight levels; one for a wind that is the same everywhere.
        east_mps: (k,) component towards east.
        north_mps: (k,) component towards north.

    Example:
        >>> westerly = WindByLevel(np.array([100.0, 300.0]), np.array([10.0, 30.0]), np.zeros(2))
        >>> westerly.at(200.0, np.zeros(2), np.zeros(2), None)[0]
        array([20., 20.])
    """

    levels_fl: Array
    east_mps: Array
    north_mps: Array

    def at(self, level_fl: float, latitude: Array, longitude: Array, unix_s: Array | None) -> tuple[Array, Array]:
        """Components towards east and north (m/s), see :class:`Wind`."""
        parts = (np.interp(level_fl, self.levels_fl, values) for values in (self.east_mps, self.north_mps))
        east, north = (np.full(latitude.shape, part) for part in parts)
        return east, north


def wind_of_text(text: str) -> WindByLevel:
    """Read a wind as aviation writes it: direction from where it blows (degrees true), and speed (kt).

    Args:
        text: ``270/35`` at every level, or ``100:250/20,300:270/60`` by flight level.

    Raises:
        ConfigError: If it cannot be read.

    Example:
        >>> wind = wind_of_text("100:270/20,300:270/60")
        >>> (wind.at(200.0, np.zeros(1), np.zeros(1), None)[0] / 0.514444).round(6)  # towards east, kt
        array([40.])
    """
    matches = [_WIND.fullmatch(part.strip()) for part in text.split(",")]
    rows = [(float(m["level"] or 0), float(m["direction"]), float(m["speed"]) * KT_MPS) for m in matches if m]
    levels = [level for level, _, _ in rows]
    by_level = len(matches) > 1
    odd = len(rows) < len(matches) or any(direction > 360 for _, direction, _ in rows) or levels != sorted(set(levels))
    if odd or (by_level and any(m is not None and m["level"] is None for m in matches)):
        raise ConfigError(
            f"the wind {text!r}",
            expected="DIRECTION/KNOTS, or LEVEL:DIRECTION/KNOTS,... with ascending flight levels",
            mend="write for instance 270/35 or 100:250/20,300:270/60, or name a .nc or .grib file",
        )
    level_fl, direction, speed = np.array(rows).T
    towards = np.radians(direction + 180)
    return WindByLevel(level_fl, speed * np.sin(towards), speed * np.cos(towards))


@dataclass(frozen=True)
class FieldWind:
    """The wind of a field, see :class:`~descentflow.positions.wind.Wind`.

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

    field: "WeatherField"
    levels_fl: Array

    def at(self, level_fl: float, latitude: Array, longitude: Array, unix_s: Array | None) -> tuple[Array, Array]:
        """Components towards east and north (m/s).

        Raises:
            ConfigError: If the field has several times and the flights' is not known.
            DataError: If the field has no value at a place or a time.
        """
        from descentflow.weather.weather_field import Points

        if unix_s is None or len(self.field.times) == 1:
            unix_s = np.asarray(self.field.only_time)
        points = Points(unix_s, np.clip(level_fl, *self.levels_fl), latitude, longitude)
        east, north = (self.field.read(name, points) for name in (EAST, NORTH))
        if np.isnan(east + north).any():
            self.field.check(points)
        return east, north


def read_wind_field(source: "WeatherSource") -> FieldWind:
    """Read a field of wind on pressure levels, all of it.

    Args:
        source: NetCDF or GRIB, a folder of them, or several, see :func:`descentflow.weather.weather_file.opened`. The
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
    # Here: most samples are flown without a field.
    from descentflow.weather.weather_field import WeatherField
    from descentflow.weather.weather_file import opened, readable

    loaded = []
    with opened(source) as parts:
        for part in parts:
            with readable(part.path):
                winds = {name: part.variables[name].load() for name in (EAST, NORTH) if name in part.variables}
            loaded.append(replace(part, variables=winds))
    field = WeatherField(loaded, needed=(EAST, NORTH))
    return FieldWind(field, np.asarray(field.extent(EAST).level_fl))
