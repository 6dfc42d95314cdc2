"""Winds: one for all levels, or one by level; fields of a weather model are in :mod:`.wind_field`."""

import re
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.core.units import KT_MPS

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
    found = [_WIND.fullmatch(part.strip()) for part in text.split(",")]
    rows = [(float(one["level"] or 0), float(one["direction"]), float(one["speed"]) * KT_MPS) for one in found if one]
    levels = [level for level, _, _ in rows]
    by_level = len(found) > 1
    odd = len(rows) < len(found) or any(direction > 360 for _, direction, _ in rows) or levels != sorted(set(levels))
    if odd or (by_level and any(one is not None and one["level"] is None for one in found)):
        raise ConfigError(
            f"the wind {text!r}",
            expected="DIRECTION/KNOTS, or LEVEL:DIRECTION/KNOTS,... with ascending flight levels",
            mend="write for instance 270/35 or 100:250/20,300:270/60, or name a .nc or .grib file",
        )
    level_fl, direction, speed = np.array(rows).T
    towards = np.radians(direction + 180)
    return WindByLevel(level_fl, speed * np.sin(towards), speed * np.cos(towards))
