"""Temperature and wind of a weather model at places, levels and times: one file, or several as one."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.air.weather_file import Array, WeatherFile, opened, paths_of, unusable
from descentflow.core.units import FL_M
from descentflow.physics.atmosphere import isa_temperature_k

WIDEST_GAP = 1.5
"""Median steps of time beyond which two times of a field count as a gap, which nothing is interpolated across."""
_PLACES = ("levels_fl", "latitude", "longitude")
TEMPERATURE, EAST, NORTH = "air_temperature", "eastward_wind", "northward_wind"


class Points(NamedTuple):
    """m places of flights, (m,) each: seconds since 1970, flight level, degrees.

    Example:
        >>> Points(np.zeros(2), np.full(2, 300.0), np.full(2, 52.0), np.full(2, 4.0)).rows(np.array([0])).level_fl
        array([300.])
    """

    unix_s: Array
    level_fl: Array
    latitude: Array
    longitude: Array

    def rows(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> "Points":
        """The points at these positions, or where a mask is true."""
        return Points(*(values[index] for values in self))


class Weather(NamedTuple):
    """At m points, (m,) each; NaN outside of the field.

    Example:
        >>> still = np.zeros(3)
        >>> Weather(still + 10.0, still, still).deviation_k
        array([10., 10., 10.])
    """

    deviation_k: Array
    """Temperature minus that of the standard atmosphere, K."""
    east_mps: Array
    """Wind towards east."""
    north_mps: Array
    """Wind towards north."""


class WeatherField:
    """Files of a weather model as one field, linear in time, flight level, latitude and longitude.

    What is linear between pressure levels is the deviation from the standard atmosphere, so that its own lapse and
    tropopause are exact. Times may be spread over files, and variables too.

    Example:
        >>> import xarray
        >>> from descentflow.air.weather_file import weather_file_of
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> cold = xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 240.0))}, axes)
        >>> field = WeatherField([weather_file_of(cold, "cold.nc")])
        >>> place = Points(np.zeros(1), np.full(1, 200.0), np.full(1, 51.0), np.full(1, 5.0))
        >>> field.at(place).deviation_k.round(1), field.wind
        (array([-8.5]), False)
    """

    def __init__(self, files: Sequence[WeatherFile]) -> None:
        """Order the times of open files.

        Raises:
            DataError: If no file has a temperature, or one has a single level or meridian.
        """
        self.files = files
        for file in files:
            if min(len(file.levels_fl), len(file.latitude), len(file.longitude)) < 2:
                raise unusable(f"{file.path} of a single level, latitude or longitude")
        self._kept: dict[str, dict[int, Array]] = {TEMPERATURE: {}, EAST: {}, NORTH: {}}
        self._steps = {name: _steps(files, name) for name in (TEMPERATURE, EAST, NORTH)}
        if not self._steps[TEMPERATURE]:
            raise unusable(f"{', '.join(file.path for file in files)} without {TEMPERATURE}")

    @property
    def wind(self) -> bool:
        """Whether it has a wind; still air if not."""
        return bool(self._steps[EAST] and self._steps[NORTH])

    @property
    def times(self) -> list[float]:
        """Seconds since 1970 at which temperature is known; empty for a field that holds at any time."""
        return [step.unix_s for step in self._steps[TEMPERATURE] if step.unix_s is not None]

    def at(self, points: Points) -> Weather:
        """Temperature deviation and wind; NaN where a point is outside of the field.

        Raises:
            DataError: If a file is damaged.
        """
        deviation = self._at(TEMPERATURE, points)
        still = np.zeros_like(deviation)
        return Weather(deviation, *(self._at(name, points) for name in (EAST, NORTH)) if self.wind else (still, still))

    def describe(self) -> str:
        """What it covers, in a line."""
        times = self.times
        when = f"{_shown(times[0])} to {_shown(times[-1])}" if times else "any time"
        low, high = (
            [pick(float(getattr(file, name)[end]) for file in self.files) for name in _PLACES]
            for pick, end in ((min, 0), (max, -1))
        )
        return (
            f"{when}, FL{low[0]:.0f} to FL{high[0]:.0f}, latitude {low[1]:.2f} to {high[1]:.2f}, longitude "
            f"{low[2]:.2f} to {high[2]:.2f}"
        )

    def _at(self, name: str, points: Points) -> Array:
        steps, found = self._steps[name], np.full(len(points.unix_s), np.nan)
        if steps[0].unix_s is None:
            return _interpolated(steps[0].file, self._held(name, (0,))[0], points)
        times = np.array([step.unix_s for step in steps])
        before = np.searchsorted(times, points.unix_s, side="right").clip(1, max(len(times) - 1, 1)) - 1
        after = (before + 1).clip(max=len(times) - 1)
        gap = times[after] - times[before]
        near = gap <= WIDEST_GAP * (np.median(np.diff(times)) if len(times) > 1 else 0.0)
        inside = (points.unix_s >= times[0]) & (points.unix_s <= times[-1]) & near
        for number in np.unique(before[inside]).tolist():
            pair = (number, min(number + 1, len(times) - 1))
            kept = self._held(name, pair)
            here = inside & (before == number)
            some = points.rows(here)
            share = (some.unix_s - times[number]) / max(times[pair[1]] - times[number], 1.0)
            low, high = (_interpolated(steps[k].file, kept[k], some) for k in pair)
            # A share of 0 or 1 needs one of them alone, which may be there where the other is missing.
            found[here] = np.where(share == 0, low, np.where(share == 1, high, (1 - share) * low + share * high))
        return found

    def _held(self, name: str, numbers: tuple[int, ...]) -> dict[int, Array]:
        """Fields of two times at most: the later one of a pair is mostly the earlier one of the next."""
        before, steps = self._kept[name], self._steps[name]
        self._kept[name] = {k: before[k] if k in before else self._cube(name, steps[k]) for k in numbers}
        return self._kept[name]

    def _cube(self, name: str, step: "_Step") -> Array:
        values = step.file.at_time(name, step.number)
        if name != TEMPERATURE:
            return values
        standard: Array = isa_temperature_k(torch.from_numpy(step.file.levels_fl) * FL_M).numpy()
        return values - standard[:, None, None]


@contextmanager
def weather_field(source: str | Path | Sequence[str | Path]) -> Iterator[WeatherField]:
    """Open a field: a NetCDF or GRIB file, a folder of them, or several.

    Raises:
        ConfigError: If a library is missing.
        DataError: If a file cannot be read, or none has a temperature on pressure levels.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 240.0))}, axes).to_netcdf("cold.nc")
        >>> with weather_field("cold.nc") as field:
        ...     print(field.describe())
        any time, FL183 to FL340, latitude 50.00 to 52.00, longitude 4.00 to 6.00
    """
    with ExitStack() as stack:
        yield WeatherField([stack.enter_context(opened(path)) for path in paths_of(source)])


class _Step(NamedTuple):
    unix_s: float | None
    file: WeatherFile
    number: int


def _steps(files: Sequence[WeatherFile], name: str) -> list[_Step]:
    """Times at which a variable is known, in order, each once; one without a time stands for all."""
    found: dict[float | None, _Step] = {}
    for file in files:
        if name in file.variables:
            for number, time in enumerate([None] if file.unix_s is None else file.unix_s.tolist()):
                found.setdefault(time, _Step(time, file, number))
    if None in found and len(found) > 1:
        raise unusable(f"{found[None].file.path} without a time beside files of a time")
    return sorted(found.values(), key=lambda step: step.unix_s or 0.0)


def _interpolated(file: WeatherFile, cube: Array, points: Points) -> Array:
    from scipy.interpolate import RegularGridInterpolator

    axes = (file.levels_fl, file.latitude, file.longitude)
    grid = RegularGridInterpolator(axes, cube, bounds_error=False, fill_value=np.nan)
    found: Array = grid(np.stack([points.level_fl, points.latitude, file.eastwards(points.longitude)], -1))
    return found


def _shown(unix_s: float) -> str:
    return f"{np.datetime64(int(unix_s), 's').astype('datetime64[m]')}Z"
