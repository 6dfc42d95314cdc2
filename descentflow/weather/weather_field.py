"""Temperature and wind of a weather model at places, levels and times: one file, or several as one."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.isa import Array, standard_k
from descentflow.core.recent import Recent
from descentflow.core.units import FL_M
from descentflow.weather.weather_file import WeatherFile, WeatherSource, opened, same
from descentflow.weather.weather_layout import EAST, NORTH, TEMPERATURE, VARIABLE_NAMES, unusable

WIDEST_GAP = 1.5
"""Median steps of time beyond which two times of a field count as a gap, which nothing is interpolated across."""
_HELD = 4
"""Times of a variable that are held in memory: flights at one place are within a few hours."""


class Points(NamedTuple):
    """Places of flights, of one shape together: seconds since 1970, flight level, degrees."""

    unix_s: Array | float
    level_fl: Array | float
    latitude: Array
    longitude: Array

    def rows(self, mask: NDArray[np.bool_]) -> "Points":
        """The points, (m,), where a mask is true."""
        return Points(*(values[mask] for values in np.broadcast_arrays(*self)))


class WeatherField:
    """Files of a weather model as one field, linear in time, flight level, latitude and longitude.

    What is linear between pressure levels is the deviation from the standard atmosphere, so that its own lapse and
    tropopause are exact. Times may be spread over files, and variables too.

    Example:
        >>> import xarray
        >>> from descentflow.weather.weather_file import weather_file_of
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> cold = xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 240.0))}, axes)
        >>> field = WeatherField([weather_file_of(cold, "cold.nc")])
        >>> place = Points(0.0, 200.0, np.array([51.0]), np.array([5.0]))
        >>> field.at(place)[0].round(1), field.wind
        (array([-8.5]), False)
    """

    def __init__(self, files: Sequence[WeatherFile], needed: Sequence[str] = (TEMPERATURE,)) -> None:
        """Order the times of open files.

        Args:
            files: Each with some of the variables at some of the times.
            needed: Standard names of variables that must be there.

        Raises:
            DataError: If a variable is missing, or one component of the wind.
        """
        by_name = {name: _steps(files, name) for name in VARIABLE_NAMES}
        self._steps = {name: steps for name, steps in by_name.items() if steps}
        wanted = {*needed, *(() if {EAST, NORTH}.isdisjoint(self._steps) else (EAST, NORTH))}
        for absent in (name for name in VARIABLE_NAMES if name in wanted and name not in self._steps):
            paths = ", ".join(dict.fromkeys(file.path for file in files))
            raise unusable(f"{paths} without {absent}, with {' and '.join(self._steps) or 'nothing of use'}")
        self._grids = {name: Recent[Any](_HELD) for name in self._steps}
        east, north = ([step.unix_s for step in self._steps.get(name, [])] for name in (EAST, NORTH))
        if east != north:
            raise unusable(f"{len(east)} times of {EAST} and {len(north)} others of {NORTH}")

    @property
    def wind(self) -> bool:
        """True if it has a wind; still air if not."""
        return EAST in self._steps

    @property
    def times(self) -> list[float]:
        """Seconds since 1970 at which something is known; empty for a field that holds at any time."""
        return [step.unix_s for step in next(iter(self._steps.values())) if step.unix_s is not None]

    @property
    def only_time(self) -> float:
        """The time of a field that has one, or has none.

        Raises:
            ConfigError: If it has several.
        """
        if len(self.times) > 1:
            raise ConfigError(
                f"a weather field with {len(self.times)} times, and no time of the descents",
                expected="the time at which the lowest level is passed",
                mend="give --time, or a file with one time",
            )
        return next(iter(self.times), 0.0)

    def extent(self, name: str) -> Points:
        """Times of a variable, and its lowest and highest level, latitude and longitude."""
        steps = self._steps[name]
        axes = zip(*(step.file.axes for step in steps), strict=True)
        ends = ([min(number[0] for number in axis), max(number[-1] for number in axis)] for axis in axes)
        return Points(np.array([step.unix_s for step in steps], dtype=np.float64), *map(np.array, ends))

    def at(self, points: Points) -> tuple[Array, Array, Array]:
        """Temperature minus that of the standard atmosphere (K), and wind towards east and north (m/s).

        NaN where the field has no value.

        Raises:
            DataError: If a file is damaged.
        """
        deviation = self.read(TEMPERATURE, points)
        east, north = (self.read(name, points) if self.wind else np.zeros_like(deviation) for name in (EAST, NORTH))
        return deviation, east, north

    def read(self, name: str, points: Points, *, blank: bool = False) -> Array:
        """Deviation or wind, by its standard name; NaN where the field has no value.

        Args:
            name: One of those that it has.
            points: Places, of any shape.
            blank: Zeros in place of the field's values, and so NaN outside of it alone.

        Raises:
            DataError: If a file is damaged.
        """
        steps, (unix_s, *_) = self._steps[name], np.broadcast_arrays(*points)
        values = np.full(unix_s.shape, np.nan)
        times, last = np.array([step.unix_s or 0.0 for step in steps]), len(steps) - 1
        before = np.searchsorted(times, unix_s, side="right").clip(1, max(last, 1)) - 1
        gap = times[(before + 1).clip(max=last)] - times[before]
        near = gap <= WIDEST_GAP * (np.median(np.diff(times)) if last else 0.0)
        inside = near & (unix_s >= times[0]) & (unix_s <= times[-1]) | (steps[0].unix_s is None)
        for number in np.unique(before[inside]).tolist():
            here, then = inside & (before == number), min(number + 1, last)
            some = points.rows(here)
            share = (some.unix_s - times[number]) / (times[then] - times[number]) if then > number else 0.0
            low, high = (self._interpolated(name, steps[k], some, blank) for k in (number, then))
            # A share of 0 or 1 needs one of them alone, which may be there where the other is missing.
            values[here] = np.where(share == 0, low, np.where(share == 1, high, (1 - share) * low + share * high))
        return values

    def check(self, points: Points) -> None:
        """Refuse points at which something is not known.

        Raises:
            DataError: If some are outside of the field, or in a hole of it: how many, and where.
        """
        for blank in (True, False):
            for name in self._steps:
                here = np.isnan(self.read(name, points, blank=blank))
                if here.any():
                    where = "outside of the weather field" if blank else "in a hole of the weather field (NaN)"
                    raise DataError(
                        f"{here.sum():,} of {here.size:,} places of descents {where}: {_shown(points.rows(here))}",
                        expected=f"{_shown(self.extent(name))}, with a value of {name} at each place",
                        mend="take another field, time or place: this one may be cut off, or masked below the ground",
                    )

    def _interpolated(self, name: str, step: "_Step", points: Points, blank: bool) -> Array:
        from scipy.interpolate import RegularGridInterpolator

        axes, west = step.file.axes, step.file.axes[2][0]

        def grid() -> RegularGridInterpolator:
            values = np.zeros([len(axis) for axis in axes]) if blank else self._values(name, step)
            return RegularGridInterpolator(axes, values, bounds_error=False, fill_value=np.nan)

        held = grid() if blank else self._grids[name].get(step.unix_s, grid)
        eastwards = (points.longitude - west) % 360 + west
        between: Array = held(np.stack([points.level_fl, points.latitude, eastwards], -1))
        return between

    def _values(self, name: str, step: "_Step") -> Array:
        """Field (k, p, q) of a time, which must be the same wherever it is."""
        values, *others = (version.file.at_time(name, version.number) for version in (step, *step.again))
        for one, other in zip(step.again, others, strict=True):
            if not (same(values, other) and all(map(np.array_equal, one.file.axes, step.file.axes))):
                raise unusable(f"{step.file.path} and {one.file.path} with another {name} at one time")
        if name != TEMPERATURE:
            return values
        return values - standard_k(step.file.axes[0] * FL_M)[:, None, None]


@contextmanager
def weather_field(source: WeatherSource, needed: Sequence[str] = (TEMPERATURE,)) -> Iterator[WeatherField]:
    """Open a field: a NetCDF or GRIB file, a folder of them, or several.

    Args:
        source: Paths.
        needed: Standard names of variables that must be there.

    Raises:
        ConfigError: If a library is missing.
        DataError: If a file cannot be read, or a variable or a component of the wind is missing.

    Example:
        >>> import xarray
        >>> axes = {"level": [500.0, 250.0], "latitude": [52.0, 50.0], "longitude": [4.0, 6.0]}
        >>> xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 240.0))}, axes).to_netcdf("cold.nc")
        >>> with weather_field("cold.nc") as field:
        ...     field.extent("air_temperature").level_fl.round()
        array([183., 340.])
    """
    with opened(source) as files:
        yield WeatherField(files, needed)


class _Step(NamedTuple):
    unix_s: float | None
    file: WeatherFile
    number: int
    again: list["_Step"]
    """The same time in other files, or once more in the file."""


def _steps(files: Sequence[WeatherFile], name: str) -> list[_Step]:
    """Times at which a variable is known, in order, each once; one without a time stands for all."""
    steps: dict[float | None, _Step] = {}
    for file in files:
        if name in file.variables:
            for number, time in enumerate([None] if file.unix_s is None else file.unix_s.tolist()):
                step = _Step(time, file, number, [])
                if steps.setdefault(time, step) is not step:
                    steps[time].again.append(step)
    if None in steps and len(steps) > 1:
        raise unusable(f"{steps[None].file.path} without a time next to files of a time")
    return sorted(steps.values(), key=lambda step: step.unix_s or 0.0)


def _shown(points: Points) -> str:
    """Time and place of points, as text."""
    unix_s, level, latitude, longitude = ((float(np.min(part)), float(np.max(part))) for part in points)
    times = (f"{np.datetime64(int(end), 's').astype('datetime64[m]')}Z" for end in unix_s if np.isfinite(end))
    return (
        f"{' to '.join(times) or 'at any time'}, FL{level[0]:.0f} to FL{level[1]:.0f}, latitude {latitude[0]:.2f} to "
        f"{latitude[1]:.2f}, longitude {longitude[0]:.2f} to {longitude[1]:.2f}"
    )
