"""Axes, variables and units of a weather model's file: what is certain is read, everything else is refused by name."""

from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import DataError
from descentflow.core.isa import Array, standard_altitude_m
from descentflow.core.units import FL_M, KT_MPS

GRIB = (".grib", ".grb", ".grib2", ".grb2")
SUFFIXES = (".nc", ".nc4", *GRIB)
STRONGEST_MPS = 200.0
"""Beyond it no wind is on earth."""
AXES = {
    "time": ("valid_time", "time"),
    "pressure": ("isobaricInhPa", "isobaricInPa", "pressure_level", "level", "plev", "isobaric"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon"),
}
"""Axis -> its names in files: ecCodes', those of both layouts of the Climate Data Store, and CF's.

Besides the valid time, GRIB has the time at which a forecast began.
"""
TEMPERATURE, EAST, NORTH = "air_temperature", "eastward_wind", "northward_wind"
VARIABLE_NAMES = {TEMPERATURE: ("t", "ta"), EAST: ("u", "ua"), NORTH: ("v", "va")}
"""Standard name -> other names of the variable; the first is GRIB's."""
VERSION = "expver"
"""ERA5 of the last months has a dimension of both versions, each missing where the other is not."""
_KELVIN = dict.fromkeys(("k", "kelvin", ""), 0.0) | dict.fromkeys(("c", "degc", "celsius", "degrees_celsius"), 273.15)
"""Unit -> what it lacks to K: values tell K from Celsius, so it may be left out."""
_MPS = dict.fromkeys(("m/s", "ms-1", "m.s-1"), 1.0) | dict.fromkeys(("kt", "kts", "knot", "knots"), KT_MPS)
"""Unit -> m/s: values do not tell m/s from knots."""
_HPA = dict.fromkeys(("hpa", "mb", "mbar", "millibar", "millibars"), 1.0) | {"pa": 0.01}
_AIR_K, _LOWEST_HPA = (150.0, 350.0), (150.0, 1100.0)
"""Temperatures of air, and where the lowest level of a field of descents is; in Celsius and in Pa none is within."""


def names_weather(source: object) -> TypeGuard[str | Path]:
    """True for the path of a weather file or of a folder, as a command or an argument names it."""
    return isinstance(source, str | Path) and (Path(source).suffix.lower() in SUFFIXES or Path(source).is_dir())


class Axis(NamedTuple):
    """An axis in ascending order, each place once."""

    values: Array
    order: NDArray[np.int64]
    """Position of each in the file."""
    first: NDArray[np.int64]
    """Of each position in the file, the first one of the same place."""

    @classmethod
    def of(cls, values: Array, period: float = np.inf) -> "Axis":
        """The axis of a file's values, of which 0.0001 is the smallest step."""
        key = np.round(values, 4)
        _, order, back = np.unique(key % period, return_index=True, return_inverse=True)
        return cls(values[order], order, order[back])

    @classmethod
    def eastwards(cls, longitude: Array) -> "Axis":
        """Meridians from the east end of the widest gap on; around the globe, the first one ends them again.

        So a region across Greenwich or the date line is one region, however its longitudes are counted.
        """
        _, order, first = cls.of(longitude, 360.0)
        gaps = (longitude[np.roll(order, -1)] - longitude[order]) % 360
        globe = len(order) > 1 and gaps.max() <= gaps.min() + 1e-3
        start = np.argmin((longitude[order] + 180) % 360) if globe else np.argmax(gaps) + 1
        order = np.roll(order, -int(start))
        west = (longitude[order[0]] + 180) % 360 - 180
        values = west + (longitude[order] - longitude[order[0]]) % 360
        if globe:
            values, order = np.append(values, west + 360), np.append(order, order[0])
        return cls(values, order, first)


def axis_name(data: Any, axis: str, path: str) -> str | None:
    """Name of the coordinate that is an axis of a dataset; None for a time that it has not."""
    coordinates = [name for name in AXES[axis] if name in data.coords]
    if not coordinates and axis != "time":
        raise unusable(f"{path} without a coordinate {' or '.join(AXES[axis])}")
    if coordinates and data[coordinates[0]].ndim > 1:
        raise unusable(f"{path}: {coordinates[0]} over {', '.join(data[coordinates[0]].dims)}")
    return coordinates[0] if coordinates else None


def place_axis(coordinate: Any, axis: str, path: str) -> Axis:
    """The axis of flight levels, latitudes or longitudes that a coordinate gives."""
    unit, values = unit_of(coordinate), np.atleast_1d(coordinate.to_numpy())
    if values.dtype.kind not in "fiu" or not values.size or not np.isfinite(values).all():
        raise unusable(f"{path}: {coordinate.name} with no values, or with some that are no numbers")
    values = values.astype(np.float64)
    shown = f"{path}: {coordinate.name} of {values.min():g} to {values.max():g} {unit or 'without a unit'}"
    if axis == "pressure":
        hpa = values * _HPA.get(unit, 1.0 if values.max() <= _LOWEST_HPA[1] else 0.01)
        if unit not in (*_HPA, "") or hpa.min() <= 0 or not _LOWEST_HPA[0] <= hpa.max() <= _LOWEST_HPA[1]:
            raise unusable(shown)
        return Axis.of(standard_altitude_m(100 * hpa) / FL_M)
    if (unit and not unit.startswith("deg")) or (axis == "latitude" and np.abs(values).max() > 90):
        raise unusable(shown)
    return Axis.of(values) if axis == "latitude" else Axis.eastwards(values)


def seconds_of(time: Any, path: str) -> Array:
    """Seconds since 1970, (t,), of a coordinate of times."""
    stamps = np.atleast_1d(time.to_numpy())
    if stamps.dtype.kind != "M" or not stamps.size or np.isnat(stamps).any():
        raise unusable(f"{path}: {time.name} with no values, or with some that are no times of the calendar")
    return np.asarray(stamps.astype("datetime64[us]").astype(np.int64) / 1e6)


def variable_of(data: Any, standard: str, dimensions: set[str], path: str) -> Any | None:
    """The variable of a standard name over all dimensions; None if there is none."""
    named = [field for field in data.data_vars.values() if _standard_name(field, path) == standard]
    whole = [field for field in named if set(field.dims) - {VERSION} == dimensions and field.dtype.kind in "fiu"]
    whole = [field for field in whole if unit_of(field) in _units(standard)]
    if named and len(whole) != 1:
        those = (
            f"{one.name} over {', '.join(one.dims)} ({one.dtype}, unit {unit_of(one) or 'missing'})" for one in named
        )
        raise unusable(f"{path}: {standard} as {' and '.join(those)}")
    return whole[0] if whole else None


def values_of(variable: Any, standard: str, path: str) -> Array:
    """Values in K or m/s; NaN where there is none."""
    values: Array = variable.to_numpy().astype(np.float64)
    unit = unit_of(variable)
    number = _units(standard)[unit]
    values, (low, high) = (
        (values + number, _AIR_K) if standard == TEMPERATURE else (values * number, (-STRONGEST_MPS, STRONGEST_MPS))
    )
    odd = values[(values < low) | (values > high)]
    if len(odd):
        raise unusable(
            f"{path}: {len(odd):,} of {values.size:,} values of {variable.name} in {unit or 'K, for want of a unit,'} "
            f"that no air has: {odd.min():g} to {odd.max():g} {'K' if standard == TEMPERATURE else 'm/s'}"
        )
    return values


def unit_of(variable: Any) -> str:
    """Unit in small letters, without blanks and signs of powers; empty if there is none."""
    return str(variable.attrs.get("units", "")).lower().replace("**", "").replace("^", "").replace(" ", "")


def unusable(got: str) -> DataError:
    """The error for a file that is not such a field."""
    return DataError(
        got,
        expected="temperature (K, degC) or both winds (m/s, kt) with units, by pressure level, latitude and longitude",
        mend="set the attribute `units` of each variable, or cut such a file from an analysis, as ERA5's t, u and v",
    )


def _standard_name(variable: Any, path: str) -> str:
    """Quantity of a variable by its standard name, or by its own name where it has none."""
    given = str(variable.attrs.get("standard_name", "unknown"))
    by_name = next((standard for standard, names in VARIABLE_NAMES.items() if variable.name in names), given)
    if given in VARIABLE_NAMES and by_name != given:
        raise unusable(f"{path}: {variable.name} with the standard name {given}")
    return by_name if given == "unknown" else given


def _units(standard: str) -> dict[str, float]:
    return _KELVIN if standard == TEMPERATURE else _MPS
