"""Rows of plain ADS-B: flights of known airspeeds in a wind that formulas give, with what a receiver has of them."""

from pathlib import Path

import numpy as np
import polars as pl
import weather_toys
from surveillance_toys import fleet
from weather_toys import linear, linear_wind, standard_k, weather

from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.units import FPM_MPS, KT_MPS

HOURS = np.arange(-48.0, 25.0)
"""Of the field, from two days before its start: the rows' first day is 2024-03-01."""
METRES_OF_DEGREE = 60 * 1852.0


def truth(flights: int = 3, **options: float) -> pl.DataFrame:
    """Rows with IAS and Mach as flown, and the groundspeed, the track and the place that they make in the wind.

    True airspeed is that of the Mach number in the field's temperature; its part over the ground, the heading's vector
    and the wind make the ground vector, and its integral the place.
    """
    rows = fleet(flights, **options)
    return pl.concat(_over_ground(one, number) for number, one in enumerate(rows.partition_by("icao24")))


def _over_ground(flight: pl.DataFrame, number: int) -> pl.DataFrame:
    seconds = flight["timestamp"].dt.epoch("us").to_numpy() / 1e6
    hours = (seconds - weather_toys.START.astype(float)) / 3600
    level, heading = flight["altitude"].to_numpy() / 100, np.radians(30.0 + 100 * number)
    latitude, longitude = np.full(len(flight), 51.0), np.full(len(flight), 4.0)
    for _ in range(6):  # the wind is that of the place, which the wind makes
        deviation = linear(hours, level, latitude, longitude)
        east_wind, north_wind = linear_wind(hours, level, latitude, longitude)
        tas = flight["Mach"].to_numpy() * np.sqrt(KAPPA * R_AIR * (standard_k(level) + deviation))
        level_part = np.sqrt(tas**2 - (flight["vertical_rate"].to_numpy() * FPM_MPS) ** 2)
        east, north = level_part * np.sin(heading) + east_wind, level_part * np.cos(heading) + north_wind
        latitude = 51.0 + _integral(north, seconds) / METRES_OF_DEGREE
        longitude = 4.0 + _integral(east / np.cos(np.radians(latitude)), seconds) / METRES_OF_DEGREE
    values = {
        "groundspeed": np.hypot(east, north) / KT_MPS, "track": np.degrees(np.arctan2(east, north)) % 360,
        "latitude": latitude, "longitude": longitude, "u_component_of_wind": east_wind,
        "v_component_of_wind": north_wind, "temperature": standard_k(level) + deviation,
    }  # fmt: skip
    return flight.with_columns(**{name: pl.Series(value) for name, value in values.items()})


def _integral(values: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.diff(seconds) * (values[1:] + values[:-1]) / 2)])


def plain(rows: pl.DataFrame) -> pl.DataFrame:
    """The rows as ADS-B has them."""
    weather_columns = ("u_component_of_wind", "v_component_of_wind", "temperature")
    return rows.drop("IAS", "Mach", *weather_columns)


def field(path: Path, **options: object) -> Path:
    """The field of the formulas as a file."""
    return weather_toys.written(weather(linear, linear_wind, **{"hours": HOURS, **options}), path)
