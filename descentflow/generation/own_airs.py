"""The air of each sample: that of its context or of the flight of its entry level, or drawn of several."""

from typing import Protocol

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.aircraft_types.aircraft import Aircraft
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

    def fly(self, aircraft: Aircraft, flown: Trajectories) -> Trajectories:
        """Descents that were flown in standard air, flown in this one."""


class OwnAirs:
    """The air of each sample, which it keeps until it is plausible.

    Example:
        >>> airs = LevelAir(torch.tensor([[0.0], [10.0]]).double(), torch.zeros(2, 1).double())
        >>> OwnAirs(airs, 4, 0, context=torch.zeros(2, 1), entry=None).of(torch.arange(4)).deviation_k[:, 0]
        tensor([ 0., 10.,  0., 10.], dtype=torch.float64)
    """

    def __init__(self, air: LevelAir, n: int, seed: int, context: Tensor | None, entry: Tensor | None) -> None:
        """Choose by a generator of its own, so that weights and entries are those of the seed in any air."""
        self.air, count = air, len(air)
        drawn = torch.randint(count, (n,), generator=torch.Generator().manual_seed(seed))
        of_context = context is not None and count == len(context)
        self.row = torch.arange(n) % count if of_context else drawn
        self.of_entry = context is None and entry is not None and len(entry) == count

    def of(self, samples: Tensor) -> LevelAir:
        """The airs of samples."""
        return self.air.rows(self.row[samples])

    def fly(self, aircraft: Aircraft, flown: Trajectories, samples: Tensor) -> Trajectories:
        """Draws for these samples, flown in standard air, flown in the air of each."""
        return flown_in(aircraft, flown, self.of(samples))
