"""What a cause is, how its size is drawn, and how one or several are injected in the flights of a world."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.errors import ConfigError
from descentflow.simulation.injected import Injected, neutral
from descentflow.simulation.parameters import FlightParameters

_STREAM = 4
"""Of a flight's random numbers; the world's own are 0 to 3."""
_DRAWS = 6


@dataclass(frozen=True)
class Fleet:
    """Flights that a cause is injected in.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> fleet = Fleet(aircraft, draw_parameters(aircraft, range(3), seed=0), torch.tensor([[0.1], [0.4], [0.9]]))
        >>> fleet.chosen(0.5)
        tensor([ True,  True, False])
        >>> fleet.with_injected(rate_lag_s=12.0).injected.rate_lag_s
        tensor([12., 12., 12.], dtype=torch.float64)
    """

    aircraft: Aircraft
    parameters: FlightParameters
    uniform: Tensor
    """Random numbers of each flight for this cause, (n, 6) in [0, 1)."""

    @property
    def normal(self) -> Tensor:
        """The same numbers as standard normal ones."""
        normal: Tensor = torch.special.ndtri(self.uniform.clamp(1e-9, 1 - 1e-9))
        return normal

    def chosen(self, share: float) -> Tensor:
        """Which flights the cause takes, (n,); the last random number decides."""
        return self.uniform[:, -1] < share

    def with_parameters(self, **changes: Tensor) -> FlightParameters:
        """The flights with some parameters changed."""
        tensors: dict[str, Any] = dict(changes)
        return replace(self.parameters, **tensors)

    def with_injected(self, **changes: Tensor | float) -> FlightParameters:
        """The flights with some of :class:`~descentflow.simulation.injected.Injected` changed."""
        before = self.parameters.injected or neutral(len(self.parameters))
        like = before.noise_factor
        tensors: dict[str, Any] = {name: like * 0 + value for name, value in changes.items()}
        injected: Injected = replace(before, **tensors)
        return replace(self.parameters, injected=injected)


@dataclass(frozen=True)
class Cause:
    """Something that makes real flights differ from a simulator's.

    Example:
        >>> from descentflow.simulation.causes import CAUSES
        >>> CAUSES["mass"].values(np.random.default_rng(0), 1.0)
        {'factor': 1.1}
    """

    name: str
    units: Mapping[str, str]
    """Unit of every value."""
    values: Callable[[np.random.Generator, float], dict[str, float]]
    """Draws the values for a size; 1 is the full size, 0.5 the half size."""
    inject: Callable[[Fleet, Mapping[str, float]], FlightParameters]
    """Changes flights."""
    channels: tuple[str, ...] = ()
    """Reported fields without which this cause cannot be distinguished from others."""


def sign(generator: np.random.Generator) -> float:
    """Plus or minus one.

    Example:
        >>> sorted({sign(np.random.default_rng(seed)) for seed in range(9)})
        [-1.0, 1.0]
    """
    return float(generator.choice([-1.0, 1.0]))


@dataclass(frozen=True)
class Injection:
    """Injects causes in the flights of a world: the ``inject`` of :func:`descentflow.simulation.world.simulate`.

    A flight depends on the seed, its own number and the cause alone. Causes act in the order of the registry, so that
    a constant path is planned for the drag and the air that the flight really meets.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft = open_aircraft("A320")
        >>> inject = Injection(aircraft, {"mass": {"factor": 0.9}}, seed=3)
        >>> plain = draw_parameters(aircraft, range(4), seed=3)
        >>> inject(plain).mass_kg / plain.mass_kg
        tensor([0.9000, 0.9000, 0.9000, 0.9000], dtype=torch.float64)
    """

    aircraft: Aircraft
    causes: Mapping[str, Mapping[str, float]]
    """Values of each cause by its name."""
    seed: int

    def __post_init__(self) -> None:
        """Refuse causes and values that do not exist."""
        for name, values in self.causes.items():
            known = _registry()
            if name not in known or set(values) != set(known[name].units):
                raise ConfigError(
                    f"to inject {name} with {', '.join(values) or 'nothing'}",
                    expected="; ".join(f"{cause.name} with {', '.join(cause.units)}" for cause in known.values()),
                    mend="name a cause and all of its values",
                )

    def __call__(self, parameters: FlightParameters) -> FlightParameters:
        """Inject every cause."""
        for index, (name, cause) in enumerate(_registry().items()):
            if name in self.causes:
                uniform = _uniform(self.seed, parameters.number.tolist(), index)
                parameters = cause.inject(Fleet(self.aircraft, parameters, uniform), self.causes[name])
        return parameters


def _registry() -> dict[str, Cause]:
    from descentflow.simulation.causes import CAUSES

    return CAUSES


def _uniform(seed: int, numbers: Sequence[int], index: int) -> Tensor:
    rows = [np.random.default_rng((seed, number, _STREAM, index)).random(_DRAWS) for number in numbers]
    return torch.from_numpy(np.stack(rows))
