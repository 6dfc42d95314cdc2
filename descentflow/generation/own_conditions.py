"""The air and the mass of each sample: those of its context or of the flight of its entry level, or drawn."""

from dataclasses import replace
from typing import Protocol

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.representation.decoder.flown_air import flown_in
from descentflow.representation.decoder.flown_mass import flown_at
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


class OwnConditions:
    """The air and the mass of each sample, which it keeps until it is plausible.

    Example:
        >>> airs = LevelAir(torch.tensor([[0.0], [10.0]]).double(), torch.zeros(2, 1).double())
        >>> own = OwnConditions(airs, None, 4, 0, context=torch.zeros(2, 1), entry=None)
        >>> own.airs(torch.arange(4)).deviation_k[:, 0]
        tensor([ 0., 10.,  0., 10.], dtype=torch.float64)
    """

    def __init__(
        self,
        air: LevelAir | AirWhereFlown | None,
        mass_kg: Tensor | None,
        n: int,
        seed: int,
        context: Tensor | None,
        entry: Tensor | None,
    ) -> None:
        """Choose by a generator of its own, so that weights and entries are those of the seed in any air.

        Args:
            air: Of k flights, or one that depends on where descents are flown; standard air if None.
            mass_kg: (k,) those of the same flights where there are as many as airs; the reference mass if None.
            n: Number of samples.
            seed: Of the choice.
            context: (m, c); with as many airs, or masses, each sample has those of its context.
            entry: (m,) entry levels; with as many, each sample has those of the flight of its entry level.
        """
        self.air, self.mass_kg = air, mass_kg
        counts = [len(one) for one in (air if isinstance(air, LevelAir) else None, mass_kg) if one is not None]
        generator = torch.Generator().manual_seed(seed)
        self._rows = {}
        for count in dict.fromkeys(counts):
            drawn = torch.randint(count, (n,), generator=generator)
            of_context = context is not None and count == len(context)
            self._rows[count] = torch.arange(n) % count if of_context else drawn
        as_entries = [count for count in counts if context is None and entry is not None and len(entry) == count]
        self.of_entry = self._rows[as_entries[0]] if as_entries else None

    def airs(self, samples: Tensor) -> LevelAir | None:
        """The airs of samples; None in standard air, and where it depends on the place."""
        return self.air.rows(self._rows[len(self.air)][samples]) if isinstance(self.air, LevelAir) else None

    def masses(self, samples: Tensor) -> Tensor | None:
        """The masses of samples; None at the reference mass."""
        return None if self.mass_kg is None else self.mass_kg[self._rows[len(self.mass_kg)][samples]]

    def fly(self, aircraft: Aircraft, flown: Trajectories, samples: Tensor) -> Trajectories:
        """Draws that were flown in standard air at the reference mass, flown at the mass and in the air of each.

        Args:
            aircraft: Coefficients that flew them.
            flown: The draws.
            samples: (n,) whose they are.
        """
        mass, air = self.masses(samples), self.airs(samples)
        if mass is not None:
            flown = flown_at(aircraft, flown, mass)
            aircraft = replace(aircraft, mass_reference_kg=mass.to(flown.cas_mps)[:, None])
        if air is not None:
            return flown_in(aircraft, flown, air)
        return flown if self.air is None or isinstance(self.air, LevelAir) else self.air.fly(aircraft, flown)
