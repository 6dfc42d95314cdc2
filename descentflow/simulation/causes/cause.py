"""Base of a cause: its draw of values in a study, and its change of flights."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.injected import Injected
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.plantable import Values

Own = Mapping[str, Tensor]
"""Number of a cause -> what each flight has of it, (n,); NaN for flights that the cause does not take."""


@dataclass(frozen=True)
class Fleet:
    """Flights that a cause is injected in.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> from descentflow.simulation.parameters import draw_parameters
        >>> aircraft, one = open_aircraft("A320"), torch.tensor([[0.1], [0.4], [0.9]])
        >>> fleet = Fleet(aircraft, draw_parameters(aircraft, range(3), seed=0), one, daily=one, airframe=one)
        >>> fleet.chosen(0.5)
        tensor([ True,  True, False])
        >>> fleet.with_injected(rate_lag_s=12.0).injected.rate_lag_s
        tensor([12., 12., 12.], dtype=torch.float64)
    """

    aircraft: PerformanceModel
    parameters: FlightParameters
    uniform: Tensor
    """Random numbers of each flight for this cause, (n, 6) in [0, 1)."""
    daily: Tensor
    """Random numbers that flights of one day share, (n, 1)."""
    airframe: Tensor
    """Random numbers that flights of one aircraft share, (n, 1)."""

    @property
    def normal(self) -> Tensor:
        """The flights' own numbers as standard normal ones."""
        return normal(self.uniform)

    def chosen(self, share: float) -> Tensor:
        """Mask (n,) of the flights that the cause takes; the last random number decides."""
        return self.uniform[:, -1] < share

    def about(self, middle: float, half_width: float, index: int) -> Tensor:
        """A number of each flight's own, uniform about a middle, (n,)."""
        return middle + half_width * (2 * self.uniform[:, index] - 1)

    def with_parameters(self, **changes: Tensor) -> FlightParameters:
        """The flights with some parameters changed."""
        tensors: dict[str, Any] = dict(changes)
        return replace(self.parameters, **tensors)

    def with_injected(self, **changes: Tensor | float) -> FlightParameters:
        """The flights with some of :class:`~descentflow.simulation.injected.Injected` changed."""
        before = self.parameters.injected
        like = before.noise_factor
        tensors: dict[str, Any] = {name: like * 0 + value for name, value in changes.items()}
        injected: Injected = replace(before, **tensors)
        return replace(self.parameters, injected=injected)


def normal(uniform: Tensor) -> Tensor:
    """Uniform numbers as standard normal ones.

    Example:
        >>> normal(torch.tensor([0.5]))
        tensor([0.])
    """
    quantiles: Tensor = torch.special.ndtri(uniform.clamp(1e-9, 1 - 1e-9))
    return quantiles


Inject = Callable[[Fleet, Values], tuple[FlightParameters, Own]]
"""Changes flights by the values of a cause, and returns the value of each flight."""


def only(chosen: Tensor, **own: Tensor | float) -> dict[str, Tensor]:
    """Value of a cause in each flight; NaN where it is not taken.

    Args:
        chosen: (n,) which flights are taken.
        own: Values by name, (n,) or one for all.

    Example:
        >>> only(torch.tensor([True, False]), lag_s=12.0)
        {'lag_s': tensor([12., nan], dtype=torch.float64)}
    """
    nothing = torch.full(chosen.shape, torch.nan, dtype=torch.float64)
    return {name: torch.where(chosen, torch.zeros_like(nothing) + value, nothing) for name, value in own.items()}
