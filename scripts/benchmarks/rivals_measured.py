"""Inputs of the rivals: the same measured quantities and effect equations that the diagnosis itself uses."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from benchmarks.rivals_sets import RivalSet
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.effects import EFFECTS, Effect
from descentflow.measurements.quantities import quantities_of
from descentflow.measurements.quantity_registry import CHANNELS

STEP = 1e-4
"""Of differences, in sizes of a parameter that matter."""
FEW = 20
"""Flights whose shift is averaged: it varies little between them."""


@dataclass(frozen=True)
class EffectShifts:
    """Shifts of effects in compared flights."""

    compared: Compared
    catalogue: Mapping[str, Effect]

    def all_shift(self, name: str, theta: Tensor) -> Tensor:
        """Shift (n, p) that an effect would make in every flight."""
        return self.compared.vector(self.catalogue[name].shift(self.compared.state, theta))

    def jacobian(self, name: str, theta: Tensor) -> Tensor:
        """Its sensitivity (n, p, k)."""
        effect, columns = self.catalogue[name], []
        for i, parameter in enumerate(effect.parameters):
            step = torch.zeros_like(theta)
            step[i] = STEP * parameter.scale
            above, below = effect.clamp(theta + step), effect.clamp(theta - step)
            apart = self.all_shift(name, above) - self.all_shift(name, below)
            columns.append(apart / (above - below)[i].clamp(min=1e-12))
        return torch.stack(columns, 2)

    def start_of(self, name: str) -> Tensor:
        """Parameters (k,) at which sensitivities are taken."""
        return self.catalogue[name].start()


@dataclass(frozen=True)
class Measured:
    """Both sides as vectors, and what each effect would shift in them."""

    compared: Compared
    shifts: EffectShifts
    few: EffectShifts
    """The same of some of the simulator's flights, for thousands of evaluations."""

    @property
    def simulated(self) -> Tensor:
        """(n, p) of the simulator's flights, in spreads from their mean; NaN where not seen."""
        return self._in_spreads(~self.compared.real)

    @property
    def real(self) -> Tensor:
        """(n, p) of the real flights, in the simulator's spreads from the simulator's mean."""
        return self._in_spreads(self.compared.real)

    @property
    def scale(self) -> Tensor:
        """(p,) spread between flights."""
        return self.compared.scale

    def _in_spreads(self, side: Tensor) -> Tensor:
        c = self.compared
        return (c.y[side] - c.y[~c.real].nanmean(0)) / c.scale


def measured(one: RivalSet) -> Measured:
    """Measure both sides of a set on the levels that both reach."""
    aircraft = open_aircraft(one.typecode)
    nominal = Simulator(aircraft)
    (low_a, high_a), (low_b, high_b) = (nominal.levels(frame) for frame in (one.real, one.simulator))
    low, high = max(low_a, low_b), min(high_a, high_b)
    simulated, real = (quantities_of(frame, low, high, CHANNELS) for frame in (one.simulator, one.real))
    sides = compare(simulated, real, aircraft)
    some = torch.arange(min(FEW, int((~sides.real).sum())))
    part = replace(sides, y=sides.y[some], real=sides.real[some], state=sides.state.rows(some))
    return Measured(sides, EffectShifts(sides, EFFECTS), EffectShifts(part, EFFECTS))


def filled(values: Tensor) -> Tensor:
    """Gaps taken as the simulator's mean, for methods that know no gaps."""
    return torch.nan_to_num(values, nan=0.0)
