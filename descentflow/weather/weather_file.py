"""Files of a weather model on pressure levels, NetCDF or GRIB, as xarray reads them: ERA5, and what is laid out alike.

A pressure level is a flight level: both are the pressure altitude of the standard atmosphere.
"""

import atexit
import logging
import mmap
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, reduce
from itertools import chain
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from descentflow.core.errors import DataError, DescentflowError
from descentflow.core.isa import Array
from descentflow.core.tabular import optional_library, pyproj
from descentflow.weather import weather_layout as layout
from descentflow.weather.weather_layout import AXES, GRIB, SUFFIXES, VARIABLE_NAMES, VERSION, Axis

WeatherSource = str | Path | Sequence[str | Path]
"""A file, a folder of files, or several."""
SAME_WITHIN = 0.1
"""K and m/s within which two values of one place and time are the same: files are packed in steps of 0.01 or less."""


@dataclass(frozen=True)
class WeatherFile:
    """An open file: its axes, ascending, and its fields, which are read time by time.

    Attributes:
        path: The file.
        unix_s: (t,) seconds since 1970, in the order of the file; None where it has no time.
        variables: Those of :data:`~.weather_layout.VARIABLE_NAMES` that it has, as xarray's arrays.
    """

    path: str
    unix_s: Array | None
    variables: dict[str, Any]
    _time: str | None
    _places: dict[str, Axis]

    @property
    def axes(self) -> tuple[Array, ...]:
        """Flight levels (k,), latitudes (p,) and longitudes (q,), ascending.

        Longitudes go eastwards from the west end on, which is from -180 to 180; around the globe, the first meridian
        ends them again.
        """
        return tuple(axis.values for axis in self._places.values())

    def at_time(self, name: str, number: int) -> Array:
        """A field (k, p, q) on the ascending axes at one time of the file, in K or m/s; NaN where it has no value."""
        with readable(self.path):
            variable = self.variables[name]
            if self._time is not None:
                variable = variable.isel({self._time: number})
            versions = [variable.isel({VERSION: i}) for i in range(variable.sizes.get(VERSION, 0))] or [variable]
            variable = reduce(lambda first, other: first.fillna(other), versions)
            values = layout.values_of(variable.transpose(*self._places), name, self.path)
        for along, (axis, place) in enumerate(self._places.items()):
            if not same(values, values.take(place.first, along)):
                raise layout.unusable(f"{self.path}: two values of {variable.name} at a place that {axis} has twice")
        return values[np.ix_(*(place.order for place in self._places.values()))]


@contextmanager
def opened(source: WeatherSource) -> Iterator[list[WeatherFile]]:
    """Open NetCDF (``.nc``) by netCDF4 or h5netcdf, and GRIB (``.grib``, ``.grib2``) by cfgrib."""
    if "eckitlib" not in sys.modules:  # else it is too late, and positions say so
        pyproj()
    xarray, parts = optional_library("xarray", extra="wind"), []
    with ExitStack() as stack:
        for path in weather_files(source):
            with readable(path):
                for options in _grib_options(path) if path.suffix.lower() in GRIB else [{}]:
                    data = stack.enter_context(xarray.open_dataset(path, **options))
                    parts.append(weather_file_of(data, str(path)))
        yield parts


@contextmanager
def readable(path: str | Path) -> Iterator[None]:
    """Turn whatever libraries raise for a damaged file into one line, and keep their warnings from the terminal."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except DescentflowError:
        raise
    except Exception as error:
        raise DataError(
            f"weather {path}: {' '.join(str(error).split()) or type(error).__name__}",
            expected="a NetCDF or GRIB file of a weather model on pressure levels",
            mend="check the path and the file",
        ) from error


def weather_file_of(data: Any, path: str) -> WeatherFile:
    """An open file of an `xarray.Dataset`."""
    others = [name for name, size in data.sizes.items() if size == 1 and name not in chain(*AXES.values(), [VERSION])]
    data = data.squeeze(others)
    named = {axis: name for axis in AXES if (name := layout.axis_name(data, axis, path)) is not None}
    data = data.expand_dims([name for name in named.values() if not data[name].dims])
    time = named.pop("time", None)
    along = None if time is None else str(data[time].dims[0])
    dimensions = {*named.values(), *([] if along is None else [along])}
    variables = ((name, layout.variable_of(data, name, dimensions, path)) for name in VARIABLE_NAMES)
    return WeatherFile(
        path,
        None if time is None else layout.seconds_of(data[time], path),
        {name: variable for name, variable in variables if variable is not None},
        along,
        {name: layout.place_axis(data[name], axis, path) for axis, name in named.items()},
    )


def same(one: Array, other: Array) -> bool:
    """True for two fields that differ by no more than their packing, holes included."""
    return one.shape == other.shape and np.allclose(one, other, rtol=0, atol=SAME_WITHIN, equal_nan=True)


def weather_files(source: WeatherSource) -> list[Path]:
    """The files that a path stands for: itself, or those of a folder, or several."""
    paths = [Path(path) for path in ([source] if isinstance(source, str | Path) else source)]
    files = (sorted(path.iterdir()) if path.is_dir() else [path] for path in paths)
    usable = [file for file in chain(*files) if file in paths or file.suffix.lower() in SUFFIXES]
    if not usable:
        raise layout.unusable(f"no file of weather ({', '.join(SUFFIXES)}) in {', '.join(map(str, paths))}")
    return usable


@cache
def _nowhere() -> TextIO:
    """A file that ecCodes can write to until the end."""
    file = Path(os.devnull).open("w")  # noqa: SIM115 - ecCodes keeps it
    atexit.register(file.close)
    return file


def _grib_options(path: Path) -> list[dict[str, Any]]:
    """Options that open each variable of a GRIB file on pressure levels by itself: it may have other levels too."""
    cfgrib = optional_library("cfgrib", extra="wind")
    # What both say, they raise too, if it matters.
    logging.getLogger("cfgrib").addHandler(logging.NullHandler())
    cfgrib.messages.eccodes.codes_context_set_logging(_nowhere())
    _check_messages(path, cfgrib.messages.eccodes)
    # No index next to the file: it would be left behind. Without "raise", what is damaged would be left out.
    stream = cfgrib.messages.FileStream(str(path), errors="raise")
    whole = cfgrib.dataset.open_fileindex(stream, "", ["shortName", "typeOfLevel"])
    kind = next((kind for kind in ("isobaricInhPa", "isobaricInPa") if kind in whole["typeOfLevel"]), None)
    there = [
        name for name, *_ in VARIABLE_NAMES.values() if kind and name in whole.subindex(typeOfLevel=kind)["shortName"]
    ]
    if not there:
        raise layout.unusable(f"{path}: {', '.join(whole['shortName'])} on levels {', '.join(whole['typeOfLevel'])}")
    keys = ({"typeOfLevel": kind, "shortName": name} for name in there)
    backend = {"indexpath": "", "errors": "raise"}
    return [{"engine": "cfgrib", "backend_kwargs": {**backend, "filter_by_keys": each}} for each in keys]


def _check_messages(path: Path, eccodes: Any) -> None:
    """Refuse messages that ecCodes must not open: of parts longer than they are, or of days that no month has.

    Of the former it would free memory twice, and of the latter it writes on the terminal.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        for start in eccodes.codes_extract_offsets(str(path), eccodes.CODES_PRODUCT_GRIB, True):
            end, place = start + int.from_bytes(content[start + 8 : start + 16]), start + 16
            day = content[start + 21 : start + 23]  # of edition 1
            while content[start + 7] == 2 and place < end - 4:
                if content[place + 4] == 1:
                    day = content[place + 14 : place + 16]
                place += int.from_bytes(content[place : place + 4]) or end
            if not (1 <= day[0] <= 12 and 1 <= day[1] <= 31):
                raise layout.unusable(f"{path}: month {day[0]}, day {day[1]} in the message of GRIB at byte {start:,}")
            if content[start + 7] == 2 and place != end - 4:
                raise layout.unusable(f"{path}: a damaged message of GRIB at byte {start:,}")
