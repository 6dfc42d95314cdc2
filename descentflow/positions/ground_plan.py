"""Ground under descents, as a user gives it: end point, route and wind."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TypedDict

from torch import Tensor

from descentflow.core.arguments import NotNegativeFloat, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.units import NM_M
from descentflow.positions.ground_path import GroundPath, Point, path_along, path_to
from descentflow.positions.placing import Positions, place
from descentflow.positions.wind import Wind, read_wind_field, wind_of_text
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.weather.weather_layout import names_weather


@dataclass(frozen=True)
class GroundPlan:
    """Path of descents over the ground; the default gives distances alone, in still air.

    Attributes:
        path: The line over the ground.
        wind: The wind; still air if None.
        to_go_nm: Distance left to the end point where the lowest level is passed.
        end_time: When the lowest level is passed.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0, wind="290/40", to_go_nm=45.0)
        >>> placed = plan.place(sample("best.ckpt", 5).trajectories)
        >>> (placed.to_go_m[:, 0] / 1852).round(6)
        array([45., 45., 45., 45., 45.])
    """

    path: GroundPath | None = None
    wind: Wind | None = None
    to_go_nm: float = 0.0
    end_time: datetime | None = None

    def place(self, flown: Trajectories, tailwind_mps: Tensor | float = 0.0) -> Positions:
        """Distances, groundspeeds and, with a path, places of descents, see :func:`~.placing.place`."""
        return place(
            flown, self.path, self.wind, to_go_m=self.to_go_nm * NM_M, end_time=self.end_time, tailwind_mps=tailwind_mps
        )


class Ground(TypedDict, total=False):
    """Arguments of :func:`ground_plan`: where descents are flown."""

    end: Point | None
    track: float | None
    route: Sequence[Point] | None
    wind: str | Path | Wind | None
    to_go_nm: float
    end_time: datetime | str | None


NOWHERE = GroundPlan()
"""Still air, and no place."""


@checked_arguments
def ground_plan(
    *,
    end: Point | None = None,
    track: float | None = None,
    route: Sequence[Point] | None = None,
    wind: str | Path | Wind | None = None,
    to_go_nm: NotNegativeFloat = 0.0,
    end_time: datetime | str | None = None,
) -> GroundPlan:
    """Put together where descents are flown.

    Args:
        end: Latitude and longitude (degrees) of the point where they end.
        track: True track (degrees) on which they arrive there; needs ``end``.
        route: In place of both, two or more fixes in the order in which they are flown.
        wind: ``"270/35"`` (from 270 degrees true, 35 kt), ``"100:250/20,300:270/60"`` by flight level, the path of a
            NetCDF or GRIB file, or a :class:`~descentflow.positions.wind.Wind`.
        to_go_nm: Distance (NM) left to the end point where the lowest level of the model is passed.
        end_time: When the lowest level is passed, UTC where it has no time zone.

    Raises:
        ConfigError: If these contradict each other, or one of them cannot be.
        DataError: If a file of winds cannot be read.

    Example:
        >>> ground_plan(route=[(52.0, 4.0), (52.0, 5.0), (51.5, 5.0)], wind="270/35").path is None
        False
        >>> ground_plan(end=(52.0, 4.0))
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: an end point without a track; expected both, or a route; ...
    """
    ways = {"an end point": end, "a track": track, "a route": route}
    given = {name for name, way in ways.items() if way is not None}
    for only, other in (("an end point", "a track"), ("a track", "an end point")):
        if only in given and other not in given:
            raise ConfigError(f"{only} without {other}", expected="both, or a route", mend=f"give {other} too")
    if {"an end point", "a route"} <= given:
        raise ConfigError("an end point and a route", expected="one of them", mend="leave one of them out")
    path = None
    if route is not None:
        path = path_along(route)
    elif end is not None and track is not None:
        path = path_to(end, track)
    if wind is not None and path is None:
        raise ConfigError(
            "a wind without a direction of flight",
            expected="an end point with a track, or a route",
            mend="give --end and --track, or --route",
        )
    return GroundPlan(path, _wind(wind), to_go_nm, _time(end_time))


def _wind(wind: str | Path | Wind | None) -> Wind | None:
    if isinstance(wind, Path) or names_weather(wind):
        return read_wind_field(wind)
    return wind_of_text(wind) if isinstance(wind, str) else wind


def _time(time: datetime | str | None) -> datetime | None:
    if not isinstance(time, str):
        return time
    try:
        return datetime.fromisoformat(time)
    except ValueError as error:
        raise ConfigError(
            f"the time {time!r}", expected="a time as in ISO 8601", mend="write for instance 2026-11-22T10:00:00Z"
        ) from error
