"""One or several causes injected in the flights of a world."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.cause_values import Values
from descentflow.simulation.causes.air_and_instruments import (
    AIRSPEED_BIAS,
    MEASUREMENT_NOISE,
    TEMPERATURE,
    VERTICAL_RATE_LAG,
    WIND_GRADIENT,
)
from descentflow.simulation.causes.cause import Cause, Fleet
from descentflow.simulation.causes.forces import (
    ANTI_ICE,
    COMPRESSIBILITY,
    DRAG_POLAR,
    IDLE_THRUST,
    INDUCED_DRAG,
    KEPT_THRUST,
    MASS,
    POWERED_DESCENT,
    SPEED_BRAKE,
    TURN,
)
from descentflow.simulation.causes.operation import GEOMETRIC_PATH, LEVEL_OFF, SPEED_SCHEDULE, VERTICAL_SPEED_MODE
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.plantable import complete

_STREAM, _DAY_STREAM, _AIRFRAME_STREAM = 4, 6, 7
"""Of random numbers of flights, days and airframes; a flight's own in the world are 0 to 3, and 5."""
_DRAWS = 6
CATALOGUED = (
    TEMPERATURE,
    WIND_GRADIENT,
    MASS,
    IDLE_THRUST,
    DRAG_POLAR,
    SPEED_BRAKE,
    TURN,
    GEOMETRIC_PATH,
    VERTICAL_SPEED_MODE,
    LEVEL_OFF,
    SPEED_SCHEDULE,
    AIRSPEED_BIAS,
    VERTICAL_RATE_LAG,
    MEASUREMENT_NOISE,
)
"""Causes that a diagnosis should name, if channels show them."""

OUTSIDE = (COMPRESSIBILITY, KEPT_THRUST, ANTI_ICE)
"""Causes that a diagnosis should call unknown."""

BETWEEN = (INDUCED_DRAG, POWERED_DESCENT)
"""Causes that come so near to one of the catalogue that either answer is right: a polar of the wrong shape is nearly
another mass, and thrust all the way down nearly less drag."""

_HELD_LAST = (GEOMETRIC_PATH, VERTICAL_SPEED_MODE)
_FIRST = tuple(cause for cause in (*CATALOGUED, *OUTSIDE, *BETWEEN) if cause not in _HELD_LAST)
CAUSES: dict[str, Cause] = {cause.name: cause for cause in (*_FIRST, *_HELD_LAST)}
"""Every cause by name, in the order in which they act: a path or a rate is planned for the speeds, the drag and the air
that the flight really meets."""


@dataclass(frozen=True)
class Injection:
    """Injects causes in the flights of a world: the ``inject`` of :func:`descentflow.simulation.world.simulate`.

    What a flight gets depends on the seed, its own number, its day, its airframe and the cause alone. Causes act in
    the order of :data:`~descentflow.simulation.causes.injection.CAUSES`. Values that are left out take their
    defaults.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> inject = Injection(aircraft, {"mass": {"factor": 0.9}}, seed=3)
        >>> plain = draw_parameters(aircraft, range(4), seed=3)
        >>> inject(plain).mass_kg / plain.mass_kg
        tensor([0.9000, 0.9000, 0.9000, 0.9000], dtype=torch.float64)
        >>> list(inject(plain).planted)  # what each flight has got
        ['mass_factor']
    """

    aircraft: PerformanceModel
    causes: Mapping[str, Values]
    """Values of each cause by its name."""
    seed: int

    def __post_init__(self) -> None:
        """Refuse causes and values that do not exist."""
        object.__setattr__(self, "causes", complete(self.causes))

    def __call__(self, parameters: FlightParameters) -> FlightParameters:
        """Inject every cause."""
        for name, cause in CAUSES.items():
            if name in self.causes:
                uniform = self._uniform(parameters.number, _STREAM, cause.stream, _DRAWS)
                daily = self._uniform(parameters.day, _DAY_STREAM, cause.stream, 1)
                airframe = self._uniform(parameters.airframe, _AIRFRAME_STREAM, cause.stream, 1)
                fleet = Fleet(self.aircraft, parameters, uniform, daily, airframe)
                parameters, own = cause.inject(fleet, self.causes[name])
                planted = {f"{name}_{value}": tensor for value, tensor in own.items()}
                parameters = replace(parameters, planted={**parameters.planted, **planted})
        return parameters

    def _uniform(self, numbers: Tensor, stream: int, cause: int, draws: int) -> Tensor:
        """Random numbers of shape (n, draws), a generator for each number."""
        known: dict[int, np.ndarray] = {}
        rows: Sequence[int] = numbers.tolist()
        for number in rows:
            if number not in known:
                known[number] = np.random.default_rng((self.seed, number, stream, cause)).random(draws)
        return torch.from_numpy(np.stack([known[number] for number in rows]))
