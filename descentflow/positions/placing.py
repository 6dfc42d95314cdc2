"""Lay descents over the ground: airspeed and wind integrated along a path, back from its end."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.core.units import KT_MPS
from descentflow.positions.ground_path import GroundPath
from descentflow.positions.wind import Wind
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.weather.weather_layout import STRONGEST_MPS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Positions:
    """Places of n descents on L ascending levels; values above a descent's entry level have no meaning.

    Attributes:
        distance_m: (n, L) flown over the ground since the entry level.
        to_go_m: (n, L) left to the end point.
        groundspeed_mps: (n, L).
        latitude: (n, L) degrees; None without a path.
        longitude: (n, L) degrees from -180 to 180; None without a path.
        track: (n, L) degrees, true; None without a path.
        unix_s: (n, L) seconds since 1970; None if no time was given.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> flown = sample("best.ckpt", 20, entry_fl=330).trajectories
        >>> where = place(flown)
        >>> bool((where.top_of_descent_m == where.distance_m[:, 0]).all()), where.latitude is None
        (True, True)
    """

    distance_m: Array
    to_go_m: Array
    groundspeed_mps: Array
    top_of_descent_m: Array
    """(n,) from the entry level to the end point."""
    latitude: Array | None = None
    longitude: Array | None = None
    track: Array | None = None
    unix_s: Array | None = None


def place(
    flown: Trajectories,
    path: GroundPath | None = None,
    wind: Wind | None = None,
    *,
    to_go_m: float = 0.0,
    end_time: datetime | None = None,
    tailwind_mps: Tensor | float = 0.0,
) -> Positions:
    r"""Integrate groundspeed over time, from the lowest level up to the entry level.

    With the track :math:`\chi` of the path, :math:`V \cos\gamma = \sqrt{V^2 - \dot h^2}` and the wind's components
    along and across the track, the aircraft holds the path by crabbing:
    :math:`V_g = \sqrt{V^2 \cos^2\gamma - w_\perp^2} + w_\parallel`. Between levels groundspeed is taken as linear in
    time; where wind depends on the place, the place is found by Heun's method.

    Args:
        flown: n descents.
        path: What they follow; without it, there are distances and groundspeeds and no places.
        wind: Still air if absent; without a path it is of no use.
        to_go_m: Distance left to the end point at the lowest level of the grid.
        end_time: When the lowest level is passed; with a time zone, or UTC.
        tailwind_mps: (n, L) wind along the track in which the descents were flown, where ``wind`` is absent.

    Raises:
        ConfigError: If the wind is stronger than the airspeed or than winds are, or there are two winds.
        DataError: If a field of wind does not hold a place or a time.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> from descentflow.positions.ground_path import path_to
        >>> from descentflow.positions.wind import wind_of_text
        >>> flown = sample("best.ckpt", 20, entry_fl=330).trajectories
        >>> westbound = path_to((52.0, 4.0), track=270.0)
        >>> into = place(flown, westbound, wind_of_text("270/50"))
        >>> bool((into.top_of_descent_m < place(flown, westbound).top_of_descent_m).all())
        True
    """
    air, tailwind = _Air.of(flown, end_time), np.asarray(tailwind_mps)
    if wind is not None and tailwind.any():
        raise ConfigError(
            "a wind over the ground next to descents that were flown in a wind of their own",
            expected="one of them",
            mend="leave the wind out, or fly in an air without wind",
        )
    if path is None or wind is None:
        to_go, groundspeed = _along(air, to_go_m, tailwind)
    else:
        to_go, groundspeed = _blown(air, path, wind, to_go_m)
    top = to_go[np.arange(len(flown)), flown.entry.cpu().numpy()]
    latitude, longitude, track = (None, None, None) if path is None else path.at(to_go)
    return Positions(top[:, None] - to_go, to_go, groundspeed, top, latitude, longitude, track, air.unix_s)


class _Air(NamedTuple):
    """Motion through the air: horizontal airspeed (n, L), times of legs (n, L - 1), at and below the entry."""

    levels_fl: Array
    flying: NDArray[np.bool_]
    speed_mps: Array
    leg_s: Array
    unix_s: Array | None

    @classmethod
    def of(cls, flown: Trajectories, end_time: datetime | None) -> "_Air":
        time_s, tas, rate = (v.detach().cpu().double().numpy() for v in (flown.time_s, flown.tas_mps, flown.rate_mps))
        mask = flown.mask.cpu().numpy()
        leg_s = np.where(mask[:, 1:], time_s[:, :-1] - time_s[:, 1:], 0.0)
        speed = np.sqrt(np.clip(tas**2 - rate**2, 0, None))
        unix_s = None
        if end_time is not None:
            unix_s = time_s - time_s[:, :1] + unix_of(end_time)
        return cls(flown.levels_fl.cpu().double().numpy(), mask, speed, leg_s, unix_s)


def unix_of(time: datetime) -> float:
    """Seconds since 1970; UTC where a time has no zone.

    Example:
        >>> unix_of(datetime(1970, 1, 1, 1))  # noqa: DTZ001
        3600.0
    """
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()


def _along(air: _Air, to_go_m: float, tailwind_mps: Array) -> tuple[Array, Array]:
    """Distance to go and groundspeed in still air, or in a wind along the track."""
    speed = air.speed_mps + tailwind_mps
    legs = 0.5 * (speed[:, 1:] + speed[:, :-1]) * air.leg_s
    return np.pad(legs.cumsum(1), ((0, 0), (1, 0))) + to_go_m, speed


def _blown(air: _Air, path: GroundPath, wind: Wind, to_go_m: float) -> tuple[Array, Array]:
    """Distance to go and groundspeed in a wind, level by level upwards; above the entry they stay as they were."""
    to_go, groundspeed = np.full_like(air.speed_mps, to_go_m), np.empty_like(air.speed_mps)
    groundspeed[:, 0] = _groundspeed(air, path, wind, 0, to_go[:, 0], slice(None))
    for k in range(1, to_go.shape[1]):
        on = air.flying[:, k]
        before, speed, leg = to_go[:, k - 1], groundspeed[:, k - 1], air.leg_s[:, k - 1]
        to_go[:, k], groundspeed[:, k] = before, speed
        reached = _groundspeed(air, path, wind, k, (before + speed * leg)[on], on)
        to_go[on, k] += 0.5 * (speed[on] + reached) * leg[on]
        groundspeed[on, k] = _groundspeed(air, path, wind, k, to_go[on, k], on)
    return to_go, groundspeed


def _groundspeed(
    air: _Air, path: GroundPath, wind: Wind, level: int, to_go_m: Array, on: NDArray[np.bool_] | slice
) -> Array:
    """Groundspeed of some flights at one level, so far from the end point."""
    latitude, longitude, track = path.at(to_go_m)
    east, north = wind.at(
        float(air.levels_fl[level]), latitude, longitude, None if air.unix_s is None else air.unix_s[on, level]
    )
    sine, cosine = np.sin(np.radians(track)), np.cos(np.radians(track))
    along, across = east * sine + north * cosine, east * cosine - north * sine
    speed = air.speed_mps[on, level]
    strength = np.hypot(along, across)
    # A tailwind in another unit leaves every flight on its track: no limit of the airspeed finds it.
    if (strength > STRONGEST_MPS).any():
        raise ConfigError(
            f"a wind of {float(strength.max()) / KT_MPS:.0f} kt at FL{air.levels_fl[level]:.0f}",
            expected=f"up to {STRONGEST_MPS / KT_MPS:.0f} kt, beyond which no wind on earth is",
            mend="check its speed and unit: it is FROM/KT as 270/35 on the command line, m/s in a file",
        )
    groundspeed: Array = np.sqrt(np.clip(speed**2 - across**2, 0, None)) + along
    if (np.abs(across) >= speed).any() or (groundspeed <= 0).any():
        strongest = float(strength.max()) / KT_MPS
        raise ConfigError(
            f"a wind of {strongest:.0f} kt at FL{air.levels_fl[level]:.0f}, in which a flight cannot hold its track",
            expected="less wind than airspeed",
            mend="check the wind's unit: it is kt on the command line, m/s in a file",
        )
    return groundspeed
