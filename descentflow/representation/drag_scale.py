r"""The scale on which profiles of drag are linear in the weights: newtons, or the logarithm of the net retarding force.

What slows a descending flight down is drag minus thrust, $F = D - T_{HR}$, which is positive for every flight that
descends and spreads by factors: some flights descend twice as fast as the median, and as many half as fast. On the
scale $z = \bar F \log(F / \bar F)$ that is a symmetric spread, and every weight gives a flight that descends. About the
typical force $\bar F$ a newton of z is a newton of drag.
"""

from dataclasses import dataclass
from typing import Any, Literal

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.physics.nominal_descent import nominal_state
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.profiles import Profiles

DragScaleName = Literal["log", "newton"]
LEAST_FORCE = 0.05
"""Of the typical force, the least whose logarithm is taken: of a flight that descends at some 100 ft/min."""


@dataclass(frozen=True)
class DragScale:
    """The logarithmic scale.

    Attributes:
        thrust_n: (L,) idle thrust of the nominal descent.
        force_n: The typical net retarding force.

    Example:
        >>> scale = DragScale(torch.tensor([1000.0]).double(), 20_000.0)
        >>> drag_n = torch.tensor([[21_000.0], [31_000.0]]).double()
        >>> scale.scaled(drag_n).round(), torch.allclose(scale.drag_n(scale.scaled(drag_n)), drag_n)
        (tensor([[   0.],
                [8109.]], dtype=torch.float64), True)
    """

    thrust_n: Tensor
    force_n: float

    def scaled(self, drag_n: Tensor) -> Tensor:
        """Drag (n, L) on the scale; of flights that hardly descend, that of the least force."""
        force = (drag_n - self.thrust_n.to(drag_n)).clamp(min=LEAST_FORCE * self.force_n)
        return self.force_n * (force / self.force_n).log()

    def drag_n(self, scaled: Tensor) -> Tensor:
        """Drag (n, L) in N of values on the scale."""
        return self.thrust_n.to(scaled) + self.force_n * (scaled / self.force_n).exp()

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives from which :meth:`from_state` rebuilds it."""
        return {"thrust_n": self.thrust_n.cpu(), "force_n": self.force_n}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "DragScale":
        """Rebuild from :meth:`to_state`."""
        return cls(state["thrust_n"], float(state["force_n"]))


def fit_drag_scale(train: Profiles, aircraft: PerformanceModel) -> DragScale:
    """The scale about the mean net retarding force of training flights.

    Args:
        train: Training flights on their grid.
        aircraft: Coefficients that inferred their drag.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> import polars as pl
        >>> train = profiles_from_frame(pl.read_parquet("descents.parquet"), aircraft("A320"), 150, 330)
        >>> scale = fit_drag_scale(train, aircraft("A320"))
        >>> 10_000 < scale.force_n < 40_000
        True
    """
    thrust_n = nominal_state(aircraft, train.levels_fl * FL_M).thrust_n
    force = torch.where(train.mask, train.drag_n - thrust_n, 0.0).sum() / train.mask.sum()
    return DragScale(thrust_n, float(force))
