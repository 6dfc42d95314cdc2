"""What an effect is: parameters with bounds, channels that it needs, and the shift it makes in what is measured."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor
from torch.func import jacfwd

from descentflow.gap.physics import FlightState

Law = Literal["constant", "gaussian", "window mixture", "measured covariate"]
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


class Effect(ABC):
    """A physical or operational cause.

    A subclass in a file of its own states parameters, needs and :meth:`shift`; nothing else has to change. Quantities
    that may shift, see :data:`descentflow.gap.quantities.QUANTITIES`.

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
    rate_follows_cas: ClassVar[bool] = False
    """Whether a shift of CAS carries the rate along as between flights that fly slower and faster."""
    says: ClassVar[str] = ""
    """One clause for readers who are no specialists: '... than the simulator assumes'."""

    @abstractmethod
    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Change of the measured quantities at parameters theta (k,), differentiable in theta."""

    def starts(self, state: FlightState) -> list[Tensor]:
        """Parameter vectors from which a fit may start: where sensitivities are taken. One, unless windows vary."""
        return [torch.tensor([p.start for p in self.parameters], dtype=torch.float64)]

    def sensitivity(self, state: FlightState, theta: Tensor) -> dict[str, Tensor]:
        """Jacobian of the shift: quantity -> (n, K, k) or (n, k), by forward-mode differentiation."""
        found: dict[str, Tensor] = jacfwd(lambda t: dict(self.shift(state, t)))(theta)
        return found

    def clamp(self, theta: Tensor) -> Tensor:
        """Parameters within their physical bounds."""
        low = torch.tensor([p.low for p in self.parameters], dtype=theta.dtype)
        high = torch.tensor([p.high for p in self.parameters], dtype=theta.dtype)
        return torch.minimum(torch.maximum(theta, low), high)
