"""The ground path of descents, by the distance left to its end; geodesics of WGS84 by pyproj."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.core.tabular import pyproj

if TYPE_CHECKING:
    from pyproj import Geod

Array = NDArray[np.float64]
Point = tuple[float, float]
"""Latitude and longitude, degrees."""


@dataclass(frozen=True)
class GroundPath:
    """Geodesics that follow each other, ordered from the end point backwards.

    A place is given by the distance that it has left to the end point. Turns at fixes take no distance. Before the
    first fix the path goes on along the geodesic of its first leg.

    Attributes:
        end_latitude: (k,) degrees, where each leg ends; the first is the end point.
        end_longitude: (k,) degrees.
        back_azimuth: (k,) degrees, direction from the end of each leg back along it.
        start_m: (k,) distance left to the end point where each leg ends; the first is zero.

    Example:
        >>> straight = path_to((52.0, 4.0), track=90.0)
        >>> latitude, longitude, track = straight.at(np.array([0.0, 50_000.0]))
        >>> longitude.round(3), track.round(1)  # a great circle: eastwards at its end alone
        (array([4.   , 3.272]), array([90. , 89.4]))
    """

    end_latitude: Array
    end_longitude: Array
    back_azimuth: Array
    start_m: Array

    def at(self, to_go_m: Array) -> tuple[Array, Array, Array]:
        """Place and true track of flights with these distances (any shape) left to the end point.

        Beyond the end point (a negative distance) the last leg goes on.

        Returns:
            Latitude and longitude, degrees; track, degrees from 0 to 360.
        """
        leg = np.searchsorted(self.start_m, to_go_m, side="right").clip(min=1) - 1
        longitude, latitude, onwards = _geod().fwd(
            self.end_longitude[leg], self.end_latitude[leg], self.back_azimuth[leg], to_go_m - self.start_m[leg]
        )
        # pyproj's back azimuth looks from the new point to the old one: along the flight's own track.
        return np.asarray(latitude), np.asarray(longitude), np.asarray(onwards) % 360


def path_to(end: Point, track: float) -> GroundPath:
    """The geodesic that arrives at a point, for instance a runway's threshold, on a true track.

    Args:
        end: Latitude and longitude, degrees.
        track: True track at the end point, degrees.

    Raises:
        ConfigError: If the point or the track cannot be.

    Example:
        >>> path_to((51.47, -0.45), track=270.0).at(np.array([18_520.0]))[1].round(2)  # 10 NM before the threshold
        array([-0.18])
    """
    latitude, longitude = _checked(end)
    if not 0 <= track <= 360:
        raise ConfigError(f"a track of {track:g} degrees", expected="0 to 360", mend="pass a true track")
    return GroundPath(np.array([latitude]), np.array([longitude]), np.array([(track + 180) % 360]), np.zeros(1))


def path_along(route: Sequence[Point]) -> GroundPath:
    """The geodesics from fix to fix; the last fix is the end point.

    Args:
        route: Two or more fixes in the order in which they are flown.

    Raises:
        ConfigError: If there are fewer than two, one cannot be, or two that follow each other are the same.

    Example:
        >>> path = path_along([(52.0, 4.0), (52.0, 5.0), (51.5, 5.0)])
        >>> path.at(np.array([1000.0, 100_000.0]))[2].round(0)  # southbound at the end, eastbound before
        array([180.,  90.])
    """
    fixes = [_checked(point) for point in route]
    if len(fixes) < 2:
        raise ConfigError(
            f"a route of {len(fixes)} fix", expected="two or more", mend="add fixes, or give an end point and a track"
        )
    back, lengths = [], []
    for (latitude, longitude), (end_latitude, end_longitude) in pairwise(fixes):
        azimuth, _, length = _geod().inv(end_longitude, end_latitude, longitude, latitude)
        if length < 1:
            raise ConfigError(
                f"the fix {latitude:g},{longitude:g} twice", expected="each fix once in a row", mend="leave one out"
            )
        back.append(azimuth)
        lengths.append(length)
    ends = np.array(fixes[1:])[::-1]
    starts = np.concatenate([[0.0], np.cumsum(lengths[::-1])[:-1]])
    return GroundPath(ends[:, 0], ends[:, 1], np.array(back[::-1]), starts)


def _checked(point: Point) -> Point:
    latitude, longitude = point
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
        raise ConfigError(
            f"the point {latitude:g},{longitude:g}",
            expected="a latitude from -90 to 90 and a longitude from -180 to 360, degrees",
            mend="give the latitude first",
        )
    return float(latitude), float(longitude)


@cache
def _geod() -> "Geod | Any":
    return pyproj().Geod(ellps="WGS84")  # here: whatever draws samples without places would pay for it otherwise
