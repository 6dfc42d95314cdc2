"""Air of each sample: that of its context or of the flight of its entry level, or drawn."""

from typing import Protocol

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.flown_air import flown_in
from descentflow.representation.decoder.trajectories import Trajectories


class AirWhereFlown(Protocol):
    """An air that depends on where a descent is flown.

    Example:
        >>> class Warm:
        ...     def fly(self, aircraft, flown):
        ...         return flown_in(aircraft, flown, LevelAir.uniform(flown.levels_fl, 10.0))
        >>> warm: AirWhereFlown = Warm()
    """

    def fly(self, aircraft: PerformanceModel, flown: Trajectories) -> Trajectories:
        """Descents that were flown in standard air, flown in this one."""


class OwnAir:
    """Air of each sample, which it keeps until it is plausible.

    Example:
        >>> airs = LevelAir(torch.tensor([[0.0], [10.0]]).double(), torch.zeros(2, 1).double())
        >>> own = OwnAir(airs, 4, 0, context=torch.zeros(2, 1), entry=None)
        >>> own.airs(torch.arange(4)).deviation_k[:, 0]
        tensor([ 0., 10.,  0., 10.], dtype=torch.float64)
    """

    def __init__(
        self, air: LevelAir | AirWhereFlown, n: int, seed: int, context: Tensor | None, entry: Tensor | None
    ) -> None:
        """Choose by a generator of its own, so that weights and entries are those of the seed in any air.

        Args:
            air: Of k flights, or one that depends on where descents are flown.
            n: Number of samples.
            seed: Of the choice.
            context: (m, c); with as many airs, each sample has that of its context.
            entry: (m,) entry levels; with as many, each sample has that of the flight of its entry level.
        """
        self.air, self.of_entry = air, None
        if isinstance(air, LevelAir):
            drawn = torch.randint(len(air), (n,), generator=torch.Generator().manual_seed(seed))
            of_context = context is not None and len(air) == len(context)
            self._rows = torch.arange(n) % len(air) if of_context else drawn
            if context is None and entry is not None and len(entry) == len(air):
                self.of_entry = self._rows

    def airs(self, samples: Tensor) -> LevelAir | None:
        """Airs of samples; None where it depends on the place."""
        return self.air.rows(self._rows[samples]) if isinstance(self.air, LevelAir) else None

    def fly(self, aircraft: PerformanceModel, flown: Trajectories, samples: Tensor) -> Trajectories:
        """Draws that were flown in standard air, flown in the air of each.

        Args:
            aircraft: Coefficients that flew them.
            flown: The draws.
            samples: (n,) whose they are.
        """
        if isinstance(self.air, LevelAir):
            return flown_in(aircraft, flown, self.air.rows(self._rows[samples]))
        return self.air.fly(aircraft, flown)
