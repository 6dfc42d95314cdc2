"""What an effect is: parameters with bounds, channels that it needs, and the shift it makes in what is measured."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from descentflow.effects.flight_state import FlightState

Law = Literal["constant", "gaussian", "window mixture", "measured covariate"]
STEP = 1e-4
"""Of differences, in sizes of a parameter that matter."""
Shift = Mapping[str, Tensor]
"""Quantity -> change (n, K) at every band, or (n,) for quantities of a whole flight."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, zero where the effect is absent unless ``start`` says otherwise."""

    name: str
    low: float
    high: float
    unit: str
    scale: float
    """A size that matters: steps and practical size are measured in it."""
    start: float = 0.0
    inexact: float = 0.0
    """Standard error that comes on top of the data's: how well the equations of the effect place it."""
    by_law: bool = False
    """Set by :meth:`Effect.learn_law` from how flights differ, and not by their mean."""


class Effect(ABC):
    """A physical or operational cause.

    A subclass in a file of its own states parameters, needs and :meth:`shift`; nothing else has to change. Quantities
    that may shift, see :data:`descentflow.measurements.quantities.QUANTITIES`.

    Example:
        >>> class GustierAir(Effect):
        ...     name, law, parameters, needs = "gustier_air", "constant", (Parameter("ratio", 0, 2, "1", 0.2),), ()
        ...     def shift(self, state, theta):
        ...         return {"noise_rate": theta[0].expand(len(state.cas_mps))}
        >>> diagnose("flights.parquet", "best.ckpt", catalogue={**EFFECTS, "gustier_air": GustierAir()})
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    law: ClassVar[Law] = "constant"
    needs: ClassVar[tuple[str, ...]] = ()
    """Channels without which the effect shows nowhere."""
    splits: ClassVar[tuple[str, ...]] = ()
    """Channels that would tell it from the effects that look like it."""
    sensor: ClassVar[bool] = False
    """Whether it changes what is reported and not what is flown."""
    inherited_from: ClassVar[float | None] = None
    """Size of the first parameter from which it shows against physics alone, when the simulator's own flights have it
    too; None where inferred drag hides it then."""
    rate_follows_cas: ClassVar[bool] = False
    """Whether a shift of CAS carries the rate along as between flights that fly slower and faster."""
    says: ClassVar[str] = ""
    """One clause for readers who are no specialists: '... than the simulator assumes'."""

    @abstractmethod
    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Change of the measured quantities at parameters theta (k,), smooth in theta."""

    def starts(self, state: FlightState) -> list[Tensor]:
        """Parameter vectors from which a fit may start: where sensitivities are taken. One, unless windows vary."""
        return [torch.tensor([p.start for p in self.parameters], dtype=torch.float64)]

    def neighbours(self, theta: Tensor) -> list[Tensor]:
        """Parameters to try beside a fit's, where derivatives may have led nowhere; none, unless windows vary."""
        return []

    def sensitivity(self, state: FlightState, theta: Tensor, first: int | None = None) -> dict[str, Tensor]:
        """Jacobian of the shift: quantity -> (n, K, k) or (n, k), by central differences.

        They need two plain evaluations a parameter, which is several times cheaper here than dual numbers, ask nothing
        of an effect but its shift, and are good to some 1e-8: steps of 1e-4 of a size that matters.

        Args:
            state: The flights.
            theta: Where it is taken.
            first: Only so many of the parameters; all if absent.
        """
        columns: list[dict[str, Tensor]] = []
        for i, parameter in enumerate(self.parameters[:first]):
            step = torch.zeros_like(theta)
            step[i] = STEP * parameter.scale
            # Within the bounds, outside which a shift need not be defined.
            above, below = self.clamp(theta + step), self.clamp(theta - step)
            up, down = self.shift(state, above), self.shift(state, below)
            width = float(above[i] - below[i])
            scale = 0.0 if parameter.by_law or width == 0.0 else 1.0 / width
            columns.append({quantity: (up[quantity] - down[quantity]) * scale for quantity in up})
        return {quantity: torch.stack([column[quantity] for column in columns], -1) for quantity in columns[0]}

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """Whether these parameters can be what they say: an estimate driven to a bound other than zero cannot."""
        return all(
            p.by_law or value == 0.0 or p.low + 1e-6 < value < p.high - 1e-6
            for p, value in zip(self.parameters, theta.tolist(), strict=True)
        )

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        """Share of the flights that have the effect, and its parameters in those.

        One where all have it alike, or where the parameters do not say how many have it.
        """
        return 1.0, theta

    def learn_law(self, state: FlightState, theta: Tensor, excess: Tensor) -> Tensor:
        """Parameters of the law over flights, from the rates themselves.

        Args:
            state: Real flights.
            theta: Parameters so far.
            excess: (n, K) ln rate of each flight beyond what is normal and what other effects explain; NaN if not seen.
        """
        return theta

    def clamp(self, theta: Tensor) -> Tensor:
        """Parameters within their physical bounds."""
        low = torch.tensor([p.low for p in self.parameters], dtype=theta.dtype)
        high = torch.tensor([p.high for p in self.parameters], dtype=theta.dtype)
        return torch.minimum(torch.maximum(theta, low), high)
