"""Descents flown in a weather field along a path over the ground: each in the air where and when it is there."""

import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.air.field_air import along_track
from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import held
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.units import NM_M
from descentflow.physics.performance_model import PerformanceModel
from descentflow.positions.ground_plan import GroundPlan
from descentflow.positions.placing import Positions, unix_of
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.own_air import flown_in
from descentflow.weather.weather_field import Points, WeatherField

Array = NDArray[np.float64]
TURNS = 3
"""Times that air and places are found of each other: in a front of 5 K in 100 km 13 m, 3 cm and 0.1 mm are left."""


class Along(NamedTuple):
    """Descents in the field: as they are flown there, the air of each, and where they are.

    Example:
        >>> Along._fields
        ('flown', 'air', 'positions')
    """

    flown: Trajectories
    air: LevelAir
    positions: Positions


class AirAlongPath:
    """A weather field along a path, for descents that end there.

    The air decides how far out a descent begins, and where it is decides its air: both are found of each other in
    turns, from still standard air.

    Args:
        field: Open for as long as this is used.
        plan: With a path, and with the time of the end where the field has several.

    Raises:
        ConfigError: If there is no path, a second wind, or no time where one is needed.

    Warns:
        DescentflowWarning: If the field has no wind.

    Example:
        >>> import xarray
        >>> from descentflow.weather.weather_file import weather_file_of
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> axes = {"level": [600.0, 200.0], "latitude": [50.0, 53.0], "longitude": [0.0, 8.0]}
        >>> values = {"t": ("K", 272.0, 230.0), "u": ("m/s", 5.0, 25.0), "v": ("m/s", 0.0, 0.0)}
        >>> warm = xarray.Dataset(
        ...     {
        ...         name: (tuple(axes), np.array(two)[:, None, None] + np.zeros((1, 2, 2)), {"units": unit})
        ...         for name, (unit, *two) in values.items()
        ...     },
        ...     axes,
        ... )
        >>> along = AirAlongPath(WeatherField([weather_file_of(warm, "warm.nc")]), ground_plan(end=(52, 4), track=270))
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> there = along.flown(decoder.aircraft, decoder(model.sample(3, seed=0), torch.full((3,), 150)))
        >>> there.air.deviation_k.shape == there.flown.time_s.shape, there.positions.latitude.shape[0]
        (True, 3)
    """

    def __init__(self, field: WeatherField, plan: GroundPlan) -> None:
        """Check path, wind and time of the ground against the field."""
        if plan.path is None:
            raise ConfigError(
                "the air of a weather field without a path",
                expected="where descents end and which way they come",
                mend="give --end and --track, or --route (in Python: plan=ground_plan(...))",
            )
        if plan.wind is not None:
            raise ConfigError("a wind next to a weather field", expected="one of them", mend="leave --wind out")
        if not field.wind:
            warnings.warn("a weather field has no wind: still air of its temperature", DescentflowWarning, stacklevel=2)
        self.field, self.path, self.to_go_m = field, plan.path, plan.to_go_nm * NM_M
        self.timed = plan.end_time is not None
        self.end_s = field.only_time if plan.end_time is None else unix_of(plan.end_time)

    def fly(self, aircraft: PerformanceModel, flown: Trajectories) -> Trajectories:
        """Descents that were flown in standard air, flown in the field."""
        return self.flown(aircraft, flown).flown

    def flown(self, aircraft: PerformanceModel, standard: Trajectories, turns: int = TURNS) -> Along:
        """The same, with the air of each and where it is.

        Args:
            aircraft: Coefficients that flew them; its reference mass is the mass.
            standard: n descents in standard air.
            turns: See :data:`TURNS`.

        Raises:
            ConfigError: If the wind is stronger than the airspeed.
            DataError: If a descent leaves the field.
        """
        return self._settled(standard, turns, lambda air: flown_in(aircraft, standard, air))

    def found(self, flown: Trajectories) -> Along:
        """The air and the places of descents that were flown in the field."""
        return self._settled(flown, TURNS, lambda _: flown)

    def _settled(self, flown: Trajectories, turns: int, fly: Callable[[LevelAir], Trajectories]) -> Along:
        across = np.zeros(flown.time_s.shape)
        groundspeed, to_go = self._along(flown, across, across)
        for _ in range(turns):
            latitude, longitude, track = self.path.at(to_go)
            air, east, north = self._read(flown, latitude, longitude, track)
            flown = fly(air)
            sine, cosine = np.sin(np.radians(track)), np.cos(np.radians(track))
            groundspeed, to_go = self._along(flown, east * sine + north * cosine, east * cosine - north * sine)
        top = to_go[np.arange(len(to_go)), flown.entry.cpu().numpy()]
        unix_s = self._unix_s(flown) if self.timed else None
        distance = top[:, None] - to_go
        return Along(flown, air, Positions(distance, to_go, groundspeed, top, *self.path.at(to_go), unix_s))

    def _along(self, flown: Trajectories, along_mps: Array, across_mps: Array) -> tuple[Array, Array]:
        """Groundspeed and distance to go of descents that hold the path; above the entry level as there."""
        time, tas, rate = (v.detach().cpu().double().numpy() for v in (flown.time_s, flown.tas_mps, flown.rate_mps))
        on = flown.mask.cpu().numpy()
        over_ground = np.sqrt(np.clip(tas**2 - rate**2 - across_mps**2, 0, None)) + along_mps
        if (over_ground[on] <= 0).any():
            raise ConfigError(
                "a wind in which a flight cannot hold its track",
                expected="less wind than airspeed",
                mend="check the unit of the weather field's wind",
            )
        legs = 0.5 * (over_ground[:, 1:] + over_ground[:, :-1]) * np.where(on[:, 1:], time[:, :-1] - time[:, 1:], 0.0)
        return over_ground, self.to_go_m + np.pad(legs.cumsum(1), ((0, 0), (1, 0)))

    def _unix_s(self, flown: Trajectories) -> Array:
        """Times (n, L), above the entry level as there; that of the field where none is said."""
        if not self.timed:
            return np.full(flown.time_s.shape, self.end_s)
        time: Array = flown.time_s.detach().cpu().double().numpy()
        return self.end_s + np.where(flown.mask.cpu().numpy(), time, 0.0) - time[:, :1]

    def _read(
        self, flown: Trajectories, latitude: Array, longitude: Array, track: Array
    ) -> tuple[LevelAir, Array, Array]:
        """The air of each descent, and the wind towards east and north (n, L)."""
        points = Points(self._unix_s(flown), flown.levels_fl.cpu().double().numpy(), latitude, longitude)
        deviation, east, north = self.field.at(points)
        on, inside = flown.mask.cpu().numpy(), np.isfinite(deviation) & np.isfinite(east) & np.isfinite(north)
        if not inside[on].all():
            self.field.check(points.rows(on))
        known = torch.from_numpy(inside)
        tailwind = along_track(east, north, np.radians(track))
        air = LevelAir(*(held(torch.from_numpy(values).nan_to_num(), known) for values in (deviation, tailwind)))
        return air, np.nan_to_num(east), np.nan_to_num(north)
