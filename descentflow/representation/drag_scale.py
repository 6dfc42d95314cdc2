r"""The scale on which profiles of drag are linear in the weights.

What slows a descending flight down is drag minus idle thrust, :math:`F = D - T_{HR}`. At one angle of descent it goes
as one over BADA's energy share factor, which steps where a type hands over from a Mach number to a CAS, and at the
tropopause. Flights do not: the inferred force steps there so that the observed rates come back. So a force is taken
over the one with which training flights descend at that level and CAS at one and the same angle, :math:`F_l(v)`, which
steps alike. The rest is smooth from level to level, and so are the rates of whatever is made of it:

.. math:: z = \bar F \log \frac{F}{F_l(v)}, \qquad F_l(v) = F_l \left(1 + s_l (v - v_l)\right).

Forces spread by factors: some flights descend twice as fast as the median, and as many half as fast. On the logarithm
that is a symmetric spread, and every weight gives a flight that descends; ``newton`` leaves the logarithm out.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import torch
from torch import Tensor

from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.physics.idle_state import idle_state
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.profiles import Profiles

DragScaleName = Literal["log", "newton"]
LEAST_FORCE = 0.05
"""Of the typical force, the least whose logarithm is taken: of a flight that descends at some 100 ft/min."""
STEP_MPS = 1.0
"""Change of the CAS over which the slope is taken; the line is within 0.07 % of the factor 30 kt from its middle."""


class Observed(NamedTuple):
    """Profiles of n flights as their weights explain them: drag on its scale and CAS (m/s), each (n, L), and a mask.

    Example:
        >>> import polars as pl
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.densities.checkpoint import load_model
        >>> known = load_model("best.ckpt").representation
        >>> flights = encode_flights(pl.read_parquet("descents.parquet"), known)["test"].profiles
        >>> len(known.decoder.drag_scale.observed(flights).values)
        2
    """

    values: tuple[Tensor, Tensor]
    mask: Tensor


@dataclass(frozen=True)
class DragScale:
    """Drag to the scale of the weights, and back, at a CAS.

    Attributes:
        thrust_n: (L,) clean idle thrust at the speeds of the nominal descent.
        force_n: (L,) net retarding force of one typical angle of descent, at ``cas_mps``.
        cas_mps: (L,) mean CAS.
        growth_per_mps: (L,) relative change of the force at that angle with the CAS.
        unit_n: The typical force over all levels: about it a newton of drag is a newton on the scale.
        logarithm: Whether the logarithm is taken.

    Example:
        >>> one = torch.ones(1).double()
        >>> scale, cas = DragScale(1000 * one, 2e4 * one, 140 * one, 0.002 * one, 2e4), torch.tensor([[140.0], [150.0]])
        >>> drag_n = torch.tensor([[31_000.0], [31_000.0]]).double()
        >>> scale.scaled(drag_n, cas).round(), torch.allclose(scale.drag_n(scale.scaled(drag_n, cas), cas), drag_n)
        (tensor([[8109.],
                [7713.]], dtype=torch.float64), True)
    """

    thrust_n: Tensor
    force_n: Tensor
    cas_mps: Tensor
    growth_per_mps: Tensor
    unit_n: float
    logarithm: bool = True

    def typical_n(self, cas_mps: Tensor) -> Tensor:
        """Net retarding force (n, L) of the typical angle at a CAS (n, L) or (L,)."""
        growth, middle = self.growth_per_mps.to(cas_mps), self.cas_mps.to(cas_mps)
        return self.force_n.to(cas_mps) * (1 + growth * (cas_mps - middle))

    def scaled(self, drag_n: Tensor, cas_mps: Tensor) -> Tensor:
        """Drag (n, L) on the scale; on a logarithm, of flights that hardly descend that of the least force."""
        force = (drag_n - self.thrust_n.to(drag_n)) / self.typical_n(cas_mps)
        return self.unit_n * (force.clamp(min=LEAST_FORCE).log() if self.logarithm else force)

    def drag_n(self, scaled: Tensor, cas_mps: Tensor) -> Tensor:
        """Drag (n, L) in N of values on the scale."""
        force = scaled / self.unit_n
        return self.thrust_n.to(scaled) + self.typical_n(cas_mps) * (force.exp() if self.logarithm else force)

    def observed(self, flights: Profiles) -> Observed:
        """Profiles of flights as weights explain them."""
        return Observed((self.scaled(flights.drag_n, flights.cas_mps), flights.cas_mps), flights.mask)

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives from which :meth:`from_state` rebuilds it."""
        return {name: value.cpu() if isinstance(value, Tensor) else value for name, value in vars(self).items()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "DragScale":
        """Rebuild from :meth:`to_state`."""
        return cls(**state)


def fit_drag_scale(train: Profiles, aircraft: PerformanceModel, name: DragScaleName = "log") -> DragScale:
    """The scale about the net retarding forces of training flights.

    Args:
        train: Training flights on their grid; every level is observed by at least one.
        aircraft: Coefficients that inferred their drag.
        name: Whether the logarithm is taken.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> import polars as pl
        >>> train = profiles_from_frame(pl.read_parquet("descents.parquet"), aircraft("A320"), 150, 330)
        >>> scale = fit_drag_scale(train, aircraft("A320"))
        >>> 10_000 < scale.unit_n < 40_000, round(float(scale.force_n.log().diff().min()), 2)  # at the transition
        (True, -0.33)
    """
    altitude_m, mask, count = train.altitude_m, train.mask, train.mask.sum(0)

    def total(values: Tensor) -> Tensor:
        return torch.where(mask, values, 0.0).sum(0)

    thrust_n = idle_state(aircraft, aircraft.descent_cas_mps(altitude_m), altitude_m).thrust_n
    cas_mps = total(train.cas_mps) / count
    lower, upper = (1 / idle_state(aircraft, cas_mps + step, altitude_m).energy_share for step in (-STEP_MPS, STEP_MPS))
    growth = (upper - lower) / (upper + lower) / STEP_MPS
    angle = -train.rate_mps / cas_to_tas_mps(train.cas_mps, altitude_m)
    force_n = total(train.drag_n - thrust_n) / total(angle * (1 + growth * (train.cas_mps - cas_mps)))
    force_n = force_n * total(angle).sum() / count.sum()
    return DragScale(thrust_n, force_n, cas_mps, growth, float(force_n.nanmean()), name == "log")
