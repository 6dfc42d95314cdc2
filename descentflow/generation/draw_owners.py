"""Assignment of draws to samples, and of what each is drawn: a context, an entry level, a mixture component."""

from dataclasses import dataclass
from math import ceil
from typing import ClassVar

import torch
from torch import Tensor

from descentflow.densities.entry_gate import EntryGate
from descentflow.generation.own_air_of_samples import OwnAir
from descentflow.generation.samplers import ConditionalSampler, GatedSampler, ResidualSampler, Sampler
from descentflow.representation.plausibility import Plausibility

BATCH = 10_000
"""Draws decoded at once: 10,000 descents on 228 levels are 18 MB a quantity."""

MAX_TRIES = 20
"""Draws after which a sample is drawn of another component: one that is hardly plausible would take the budget."""


def entry_levels_of(
    entry: Tensor | None, own: OwnAir | None, plausibility: Plausibility, n: int, generator: torch.Generator
) -> Tensor:
    """Indices (n,) of the samples' levels of entry.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> bounds, generator = load_representation("best.ckpt").plausibility, torch.Generator().manual_seed(0)
        >>> entry_levels_of(torch.tensor([150]), None, bounds, 3, generator)
        tensor([150, 150, 150])
    """
    if own is not None and own.of_entry is not None:
        assert entry is not None
        return entry[own.of_entry]
    return Interchangeable(entry).entries(plausibility, torch.arange(n), generator)


class _Draws:
    """Base of all kinds of draws."""

    def components(self, wanted: Tensor) -> Tensor | None:
        """The mixture components (m,) of the draws of a batch, where they are known."""
        return None

    def contexts(self, wanted: Tensor) -> Tensor | None:
        """The contexts (m, c) of the draws of a batch, where they have any."""
        return None

    def of_scale(self, wanted: Tensor) -> Tensor | None:
        """Uniform numbers (m,) that say how far draws stray from their components, where samples keep them."""
        return None

    def residual(
        self, model: Sampler | ConditionalSampler, wanted: Tensor, weights: Tensor, white: Tensor, seed: int
    ) -> Tensor:
        """Residual beyond the components of a batch of weights (m, d): standard normals, or by the model's law."""
        if not isinstance(model, ResidualSampler):
            return white
        held = self.components(wanted), self.of_scale(wanted)
        return model.residual(weights, white, seed, self.contexts(wanted), *held)


@dataclass(frozen=True)
class Interchangeable(_Draws):
    """Without a context any plausible draw may be the next sample.

    Example:
        >>> draws = Interchangeable(torch.tensor([150]))
        >>> draws.match(torch.tensor([1, 3, 4]), torch.arange(5), pending=torch.tensor([7, 9]))  # two are wanted
        (tensor([1, 3]), tensor([7, 9]))
    """

    entry: Tensor | None
    mend: ClassVar[str] = "train on more flights or with fewer components, or raise the draw budget"

    def wanted(self, pending: Tensor, drawn: int, plausible: int) -> Tensor:
        """The next batch: as many as should yield what is missing at the acceptance so far, and a little more."""
        acceptance = (plausible + 1) / (drawn + 1) if drawn else 0.9
        return torch.arange(min(int(len(pending) / acceptance * 1.05) + 16, BATCH))

    def weights(self, model: Sampler | ConditionalSampler, wanted: Tensor, seed: int) -> Tensor:
        """The weights of a batch."""
        return model.sample(len(wanted), seed)

    def entries(self, plausibility: Plausibility, wanted: Tensor, generator: torch.Generator) -> Tensor:
        """Indices of the levels where the descents of a batch start."""
        if self.entry is None:
            return plausibility.draw_entry(len(wanted), generator)
        return self.entry[torch.randint(len(self.entry), (len(wanted),), generator=generator)]

    def match(self, good: Tensor, wanted: Tensor, pending: Tensor) -> tuple[Tensor, Tensor]:
        """Positions of the plausible draws that are kept, and the samples that they become: in order."""
        kept = good[: len(pending)]
        return kept, pending[: len(kept)]


@dataclass(frozen=True)
class OfContexts(_Draws):
    """With contexts a draw is for one sample, whose context it has.

    Example:
        >>> draws = OfContexts(torch.tensor([[0.1], [0.2]]), None)
        >>> draws.contexts(torch.tensor([0, 3]))
        tensor([[0.1000],
                [0.2000]])
    """

    context: Tensor
    entry: Tensor | None
    mend: ClassVar[str] = "give a context like those of the training flights, or raise the draw budget"

    def wanted(self, pending: Tensor, drawn: int, plausible: int) -> Tensor:
        """Sample that each draw of the next batch is for: every pending one, repeatedly if few draws are plausible."""
        first = pending[:BATCH]
        times = min(ceil((drawn + 1) / (plausible + 1)), BATCH // len(first))
        return first.repeat(max(times, 1))

    def weights(self, model: Sampler | ConditionalSampler, wanted: Tensor, seed: int) -> Tensor:
        """The weights of a batch, each for its sample's context."""
        return model.sample(len(wanted), seed, self.contexts(wanted))  # type: ignore[call-arg]

    def contexts(self, wanted: Tensor) -> Tensor:
        """The context (m, c) of each draw's sample."""
        return self.context[wanted % len(self.context)]

    def entries(self, plausibility: Plausibility, wanted: Tensor, generator: torch.Generator) -> Tensor:
        """Indices of the levels where the descents of a batch start."""
        if self.entry is None:
            return plausibility.draw_entry(len(wanted), generator)
        return self.entry[wanted % len(self.context)]

    def match(self, good: Tensor, wanted: Tensor, pending: Tensor) -> tuple[Tensor, Tensor]:
        """Positions of the plausible draws that are kept, and the samples that they become: the first of each."""
        samples = wanted[good]
        order = samples.argsort(stable=True)
        new = torch.ones(len(samples), dtype=torch.bool)
        new[1:] = samples[order][1:] != samples[order][:-1]
        kept = good[order[new]]
        return kept, wanted[kept]


class OfSamples(_Draws):
    """A draw is for one sample, which keeps its entry level and its air until it is plausible.

    Example:
        >>> OfSamples(torch.tensor([150, 180])).match(torch.tensor([1]), torch.tensor([4, 6]), torch.tensor([4, 6]))
        (tensor([1]), tensor([6]))
    """

    mend = Interchangeable.mend

    def __init__(self, entry: Tensor) -> None:
        """Take the samples' levels of entry (n,), indices of the grid."""
        self.entry = entry

    def wanted(self, pending: Tensor, drawn: int, plausible: int) -> Tensor:
        """Sample that each draw of the next batch is for: every pending one."""
        return pending[:BATCH]

    def weights(self, model: Sampler | ConditionalSampler, wanted: Tensor, seed: int) -> Tensor:
        """The weights of a batch."""
        return model.sample(len(wanted), seed)

    def entries(self, plausibility: Plausibility, wanted: Tensor, generator: torch.Generator) -> Tensor:
        """Indices of the levels where the descents of a batch start."""
        return self.entry[wanted]

    def match(self, good: Tensor, wanted: Tensor, pending: Tensor) -> tuple[Tensor, Tensor]:
        """Positions of the plausible draws, and the samples that they become."""
        return good, wanted[good]


class OfEntries(OfSamples):
    """With a gate a draw is for one sample, which keeps entry level, component and scale until it is plausible.

    For the shares of both are shares of flights, which are all plausible.

    Example:
        >>> gate = EntryGate(torch.tensor([100]), torch.tensor([[1.0, 0.0], [0.0, 1.0]]))
        >>> draws = OfEntries(gate, torch.tensor([90, 110]))
        >>> draws.components(torch.tensor([0, 1]))  # none is drawn before it is wanted
        tensor([0, 0])
    """

    def __init__(self, gate: EntryGate, entry: Tensor) -> None:
        """Take the samples' levels of entry (n,), indices of the grid; components are drawn when they are wanted."""
        super().__init__(entry)
        self.gate = gate
        self.component, self.tries = torch.zeros_like(entry), torch.full_like(entry, MAX_TRIES)
        self.uniform = torch.zeros(len(entry), dtype=torch.float64)

    def weights(self, model: Sampler | ConditionalSampler, wanted: Tensor, seed: int) -> Tensor:
        """The weights of a batch, each of its sample's component: another one after so many tries in vain."""
        tired = wanted[self.tries[wanted] >= MAX_TRIES]
        generator = torch.Generator().manual_seed(seed)
        self.component[tired] = self.gate.draw(self.entry[tired], generator)
        self.uniform[tired] = torch.rand(len(tired), generator=generator, dtype=torch.float64)
        self.tries[tired] = 0
        self.tries[wanted] += 1
        assert isinstance(model, GatedSampler)
        return model.sample_of(self.component[wanted], seed)

    def components(self, wanted: Tensor) -> Tensor:
        """The component (m,) of each draw's sample."""
        return self.component[wanted]

    def of_scale(self, wanted: Tensor) -> Tensor:
        """Uniform numbers (m,) that say how far each draw's sample strays from its component."""
        return self.uniform[wanted]
