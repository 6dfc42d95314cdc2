r"""The air of flights by a weather model: read along each flight where and when it was on each level.

The wind along the track that the energy equation needs grows by what the wind changes, seen along the track, and not by
what a turn changes: between two levels by :math:`(\mathbf W_{k+1} - \mathbf W_k) \cdot \mathbf e_{k+1/2}` with the
direction :math:`\mathbf e` of the track. On a straight track this is the wind along it; on others it differs from it by
what turns did, and has the same mean.
"""

from typing import NamedTuple

import numpy as np
import polars as pl
import torch
from numpy.typing import NDArray
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import FlightAirs, held
from descentflow.core.errors import DataError
from descentflow.core.isa import Array
from descentflow.measurements.level_channels import LevelGrid
from descentflow.weather.weather_field import Points, WeatherField, weather_field
from descentflow.weather.weather_file import WeatherSource
from descentflow.weather.weather_layout import EAST, NORTH, TEMPERATURE

PLACED = ("latitude", "longitude")
LEVELS_AROUND = 5
"""Levels on either side whose places give the track where none is reported: 1,000 ft, some 3 NM."""
CHUNK_FLIGHTS = 4096
"""Flights whose air is read at a time, in the order of their days: 2 million points of 228 levels."""


class FlightPaths(NamedTuple):
    """Places of n flights on L levels, (n, L) each; held above their highest and below their lowest known place.

    Attributes:
        unix_s: Seconds since 1970.
        latitude: Degrees.
        longitude: Degrees; across the date line it goes on beyond 180.
        track: Radians; NaN where neither reports nor places tell it.
        known: Between the highest and the lowest level whose place is known.
    """

    unix_s: Array
    latitude: Array
    longitude: Array
    track: Array
    known: NDArray[np.bool_]

    def rows(self, index: NDArray[np.int64]) -> "FlightPaths":
        """The flights at these positions."""
        unix_s, latitude, longitude, track = (values[index] for values in self[:4])
        return FlightPaths(unix_s, latitude, longitude, track, self.known[index])


def field_airs(
    frame: pl.DataFrame, levels_fl: Tensor, source: WeatherSource, *, wind: bool | None = None
) -> FlightAirs:
    """The air of each flight on levels, by a weather model; flights outside of it, or without a place, are counted.

    Places and times between two levels of a flight are linear in time.

    Args:
        frame: Prepared descents with ``latitude`` and ``longitude``, and ``track`` where it is reported.
        levels_fl: (L,) ascending whole flight levels.
        source: NetCDF or GRIB file, a folder of them, or several.
        wind: Whether the field must have a wind; if absent, it has where it has. If not, the air is still.

    Raises:
        ConfigError: If a library is missing.
        DataError: If the field cannot be used, or no level of a flight is inside of it.

    Example:
        >>> import xarray
        >>> axes = {"level": [600.0, 200.0], "latitude": [45.0, 60.0], "longitude": [-5.0, 15.0]}
        >>> standard = xarray.Dataset({"t": (tuple(axes), np.full((2, 2, 2), 250.0))}, axes)
        >>> standard.to_netcdf("weather.nc")
        >>> airs = field_airs(pl.read_parquet("descents.parquet"), torch.arange(150, 341), "weather.nc")
        >>> airs.air.deviation_k.shape, airs.without, airs.wind
        (torch.Size([120, 191]), 0, False)
    """
    frame = frame.with_columns(pl.col("timestamp").dt.epoch("us").truediv(1e6).alias("_unix_s"))
    names = [name for name in (*PLACED, "track") if name in frame.columns]
    grid = LevelGrid.of_frame(frame, float(levels_fl[0]), float(levels_fl[-1]), [*names, "_unix_s"])
    nowhere = DataError(
        "descents without places",
        expected="latitude and longitude of the rows, of flights that move, for the air of a weather field",
        mend="prepare rows with positions, or fit with data.air=measured or standard",
    )
    if grid is None or not set(PLACED) <= set(grid.values):
        raise nowhere
    paths = paths_of_flights(grid, grid.values["_unix_s"].numpy())
    with weather_field(source, (TEMPERATURE, EAST, NORTH) if wind else (TEMPERATURE,)) as field:
        windy = field.wind and wind is not False
        # A block of a few days reads each time of the field once.
        order = np.argsort(paths.unix_s[:, 0], kind="stable")
        blocks = np.array_split(order, max(-(-len(order) // CHUNK_FLIGHTS), 1))
        parts = [_airs_of(field, grid.levels_fl.numpy(), paths.rows(block), windy) for block in blocks]
        back = np.argsort(np.concatenate(blocks))
        deviation, tailwind, inside = (np.concatenate(part)[back] for part in zip(*parts, strict=True))
        if not inside.any():
            points = Points(paths.unix_s, grid.levels_fl.numpy(), paths.latitude, paths.longitude)
            field.check(points.rows(paths.known))
            raise nowhere
    known = torch.from_numpy(inside) & torch.from_numpy(paths.known) & grid.mask
    covered = torch.nonzero(known.any(1))[:, 0]
    reached = torch.from_numpy(inside)[covered]
    air = LevelAir(*(held(torch.from_numpy(values)[covered].nan_to_num(), reached) for values in (deviation, tailwind)))
    absent = torch.full_like(air.deviation_k, torch.nan)
    ids = tuple(grid.flight_ids[i] for i in covered.tolist())
    return FlightAirs(ids, air, known[covered], absent, absent, absent, len(grid.flight_ids) - len(covered), windy)


def paths_of_flights(grid: LevelGrid, unix_s: Array) -> FlightPaths:
    """Places, times and tracks of flights on every level: linear in time between those known, held outside of them.

    Args:
        grid: With ``latitude``, ``longitude`` and, where it is reported, ``track``.
        unix_s: (n, L) times, NaN where a flight was not seen.
    """
    latitude, longitude = (grid.values[name].numpy() for name in PLACED)
    track = np.radians(grid.values["track"].numpy()) if "track" in grid.values else np.full_like(latitude, np.nan)
    shape = latitude.shape
    unix, north, east, towards = (np.full(shape, np.nan) for _ in range(4))
    paths = FlightPaths(unix, north, east, towards, np.zeros(shape, dtype=bool))
    level = np.arange(shape[1], dtype=np.float64)
    for i in range(shape[0]):
        placed = np.isfinite(latitude[i]) & np.isfinite(longitude[i]) & np.isfinite(unix_s[i])
        if not placed.any():
            continue
        at = level[placed]
        # Times by level first, then all else by time: a level-off takes time and way, and no level.
        time = np.interp(level, level[np.isfinite(unix_s[i])], unix_s[i][np.isfinite(unix_s[i])])
        paths.unix_s[i] = time = np.clip(time, time[int(at[-1])], time[int(at[0])])
        paths.latitude[i] = _by_time(time, placed, latitude[i][placed])
        paths.longitude[i] = _by_time(time, placed, np.unwrap(longitude[i][placed], period=360.0))
        paths.known[i, int(at[0]) : int(at[-1]) + 1] = True
        reported = np.isfinite(track[i]) & np.isfinite(unix_s[i])
        if reported.any():
            paths.track[i] = _by_time(time, reported, np.unwrap(track[i][reported]))
        else:
            paths.track[i] = _course(paths.latitude[i], paths.longitude[i])
    return paths


def _by_time(time: Array, at: NDArray[np.bool_], values: Array) -> Array:
    """Values (L,) linear in time between those given at some levels, held outside; times fall with the level."""
    interpolated: Array = np.interp(-time, -time[at], values)
    return interpolated


def _course(latitude: Array, longitude: Array) -> Array:
    """True track (L,), radians, of places that follow each other downwards; NaN where the flight does not move."""
    number = np.arange(len(latitude))
    above, below = (number + LEVELS_AROUND).clip(max=len(number) - 1), (number - LEVELS_AROUND).clip(min=0)
    north = latitude[below] - latitude[above]
    east = (longitude[below] - longitude[above]) * np.cos(np.radians(latitude))
    return np.where(np.hypot(north, east) > 0, np.arctan2(east, north), np.nan)


def along_track(east_mps: Array, north_mps: Array, track: Array) -> Array:
    """Wind along the track (n, L) of which turns change nothing; see the module.

    Args:
        east_mps: (n, L) wind towards east.
        north_mps: (n, L) wind towards north.
        track: (n, L) radians.
    """
    sine, cosine = np.sin(track), np.cos(track)
    along = east_mps * sine + north_mps * cosine
    middle = [(part[:, 1:] + part[:, :-1]) / 2 for part in (sine, cosine)]
    grown = np.diff(east_mps) * middle[0] + np.diff(north_mps) * middle[1]
    whole = np.pad(np.nan_to_num(grown).cumsum(1), ((0, 0), (1, 0)))
    seen = np.isfinite(along)
    count = seen.sum(1, keepdims=True).clip(min=1)
    wind: Array = whole + np.where(seen, along - whole, 0.0).sum(1, keepdims=True) / count
    return wind


def _airs_of(
    field: WeatherField, levels_fl: Array, paths: FlightPaths, windy: bool
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Temperature deviation, wind along the track, and where both are inside of the field with their neighbours."""
    deviation, east, north = field.at(Points(paths.unix_s, levels_fl, paths.latitude, paths.longitude))
    inside = np.isfinite(deviation)
    tailwind = np.zeros_like(deviation)
    if windy:
        inside &= np.isfinite(east) & np.isfinite(north) & np.isfinite(paths.track)
        tailwind = along_track(east, north, paths.track)
    # A slope needs the levels on either side, but for those at the ends of the grid.
    beside = np.pad(inside, ((0, 0), (1, 1)), mode="edge")
    return deviation, tailwind, inside & beside[:, 2:] & beside[:, :-2]
