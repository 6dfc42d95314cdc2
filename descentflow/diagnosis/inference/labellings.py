"""Sides dealt to whole aircraft, the true ones first: what tests by permutation compare the true sides with."""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Compared

AT_ONCE = 250
"""Labellings that are multiplied at a time: their numbers in double precision take 2 kB an aircraft."""


@dataclass(frozen=True)
class Labellings:
    """Labellings of aircraft.

    Shapes: ``sides`` (1 + b, c), one for real aircraft and zero for the simulator's, or signs where there is one side
    only; ``aircraft`` (n,) position of each flight's aircraft.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> dealt = labellings(sides.airframe, sides.real, 9, seed=0)
        >>> len(dealt), bool((dealt.flights(0) == sides.real).all()), int(dealt.flights(1).sum())
        (10, True, 80)
    """

    sides: Tensor
    aircraft: Tensor
    two_sided: bool

    def __len__(self) -> int:
        """Number of labellings, the true one among them."""
        return len(self.sides)

    def flights(self, k: int) -> Tensor:
        """Labels (n,) of the flights under one of them: true for real, or signs where there is one side only."""
        found = self.sides[k][self.aircraft]
        return found > 0 if self.two_sided else found.double()

    def by_aircraft(self, values: Tensor) -> Tensor:
        """Sums (c, k) of what flights show (n, k)."""
        total = torch.zeros(self.sides.shape[1], *values.shape[1:], dtype=values.dtype)
        return total.index_add_(0, self.aircraft, values)

    def sums(self, of_aircraft: Tensor) -> Tensor:
        """Sums (1 + b, k) over the real aircraft, or with signs, of what aircraft show (c, k)."""
        return torch.cat([part.to(of_aircraft.dtype) @ of_aircraft for part in torch.split(self.sides, AT_ONCE)])

    def __iter__(self) -> Iterator[Tensor]:
        """Labels of flights, see :meth:`flights`, one labelling after another."""
        return (self.flights(k) for k in range(len(self)))


def labellings(airframe: Tensor, real: Tensor, count: int, seed: int) -> Labellings:
    """The true labelling and permuted ones.

    Args:
        airframe: (n,) aircraft of each flight; all flights of one are on one side.
        real: (n,) bool. Where all are real, what physics claims to be zero has a random sign in each aircraft.
        count: Labellings beside the true one.
        seed: Of the permutations.

    Example:
        >>> dealt = labellings(torch.tensor([3, 3, 5, 8]), torch.tensor([True, True, False, False]), 2, seed=0)
        >>> dealt.sums(dealt.by_aircraft(torch.ones(4, 1).double()))[0]  # two flights are real
        tensor([2.], dtype=torch.float64)
    """
    names, index = torch.unique(airframe, return_inverse=True)
    generator = torch.Generator().manual_seed(seed)
    if bool(real.all()):
        signs = torch.randint(0, 2, (count, len(names)), generator=generator, dtype=torch.int8) * 2 - 1
        return Labellings(torch.cat([torch.ones(1, len(names), dtype=torch.int8), signs]), index, False)
    owner = torch.zeros(len(names), dtype=torch.int8)
    owner[index] = real.to(torch.int8)
    dealt = [owner[torch.randperm(len(names), generator=generator)] for _ in range(count)]
    return Labellings(torch.stack([owner, *dealt]), index, True)


def labellings_of(compared: Compared, count: int, seed: int) -> Labellings:
    """Labellings of compared flights.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> len(labellings_of(example_sides(), 9, seed=0))
        10
    """
    return labellings(compared.airframe, compared.real, count, seed)
