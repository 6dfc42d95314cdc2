"""Rejection sampling of plausible descents, with or without a context, within a draw budget.

The bounds themselves are in :mod:`descentflow.representation.plausibility`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil
from typing import ClassVar, Protocol, runtime_checkable

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.counter_random import DrawNumbers
from descentflow.core.errors import SamplingError
from descentflow.densities.entry_gate import EntryGate
from descentflow.generation.own_conditions import AirWhereFlown, OwnConditions
from descentflow.generation.samples import RejectionReport, Samples
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES, Plausibility

BATCH = 10_000
"""Draws decoded at once: 10,000 descents on 228 levels are 18 MB a quantity."""

MAX_TRIES = 20
"""Draws after which a sample is drawn of another component: one that is hardly plausible would take the budget."""


class Sampler(Protocol):
    """Whatever draws standardised weights repeatably.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model: Sampler = load_model("best.ckpt")
        >>> torch.equal(model.sample(3, seed=1), model.sample(3, seed=1))
        True
    """

    def sample(self, n: int, seed: int) -> Tensor:
        """Draw (n, d) weights."""


class ConditionalSampler(Protocol):
    """Whatever draws standardised weights repeatably, for the contexts that it is given.

    Example:
        >>> class Shifted:
        ...     def sample(self, n: int, seed: int, context: torch.Tensor | None = None) -> torch.Tensor:
        ...         white = torch.randn(n, 2, generator=torch.Generator().manual_seed(seed))
        ...         return white if context is None else white + context
        >>> model: ConditionalSampler = Shifted()
        >>> model.sample(3, seed=0, context=torch.full((3, 1), 100.0)).mean().round(decimals=-1)
        tensor(100.)
    """

    def sample(self, n: int, seed: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) weights, row i for row i of context (n, c)."""


@runtime_checkable
class GatedSampler(Protocol):
    """Whatever draws of mixture components, which it knows by the level of entry where ``entry_gate`` is not None.

    Example:
        >>> from descentflow.densities.mixture import GaussianMixtureDensity
        >>> isinstance(GaussianMixtureDensity(dimension=2), GatedSampler)
        True
    """

    entry_gate: EntryGate | None

    def sample_of(self, components: Tensor, seed: int) -> Tensor:
        """Draw (n, d) weights of the components (n,)."""


@torch.no_grad()
def sample_descents(
    model: Sampler | ConditionalSampler,
    decoder: DescentDecoder,
    plausibility: Plausibility,
    n: int,
    seed: int,
    *,
    context: Tensor | None = None,
    entry: Tensor | None = None,
    air: LevelAir | AirWhereFlown | None = None,
    mass_kg: Tensor | None = None,
    draw_budget: int | None = None,
    compiled: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Samples:
    """Draw, decode and keep plausible descents until there are ``n`` (paper, section 2.4).

    A mixture draws each sample's component by its level of entry, and a rejected draw is drawn again of the same
    component from the same level: proportions are shares of flights, all of which are plausible, and rejection would
    change them. With m contexts, sample i has context i modulo m, and a rejected draw is drawn again with the same
    context, so that contexts whose draws are rejected more often are as frequent among the samples as the others.

    Args:
        model: Density of the standardised weights.
        decoder: Its decoder.
        plausibility: Bounds and entry levels.
        n: Number of descents wanted.
        seed: Makes the whole result repeatable on one machine.
        context: (m, c) encoded contexts, for a conditional density.
        entry: (m,) indices of entry levels. With contexts, one for each of them; without, the levels to draw from
            with replacement, for instance those of the test flights (paper, section 4.2). If absent, they are drawn
            as the training flights entered.
        air: Airs (k, L) that descents are flown in; standard air if absent. Each sample keeps its own until it is
            plausible. It is that of its context where there are as many airs as contexts, that of the flight of its
            entry level where there are as many airs as entry levels, else drawn. Or an air that depends on where they
            are flown; the samples then do not hold theirs.
        mass_kg: (k,) masses, likewise, and of the same flights where there are as many as airs; the mass that the
            decoder flies if absent.
        draw_budget: Most draws; 100 for each descent wanted (at least 10,000) if absent.
        compiled: Decode by compiled arithmetic, see :func:`descentflow.representation.decoder.trajectories.integrate`.
        progress: Progress callback: called with the number of descents newly accepted.

    Raises:
        SamplingError: If the budget is spent first; the message names the rules that rejected most.
        ConfigError: If the density does not take such a context.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> parts = model.representation
        >>> samples = sample_descents(model, parts.decoder, parts.plausibility, n=100, seed=0)
        >>> samples.report.accepted, samples.weights.shape[0]
        (100, 100)
    """
    budget = max(100 * n, 10_000) if draw_budget is None else draw_budget
    generator = torch.Generator().manual_seed(seed)
    draws: _Interchangeable | _OfContexts | _OfEntries | _OfSamples
    own = None if air is None and mass_kg is None else OwnConditions(air, mass_kg, n, seed, context, entry)
    if context is not None:
        draws = _OfContexts(context, entry)
    elif isinstance(model, GatedSampler) and model.entry_gate is not None:
        draws = _OfEntries(model.entry_gate, _entries(entry, own, plausibility, n, generator))
    elif own is not None:
        draws = _OfSamples(_entries(entry, own, plausibility, n, generator))
    else:
        draws = _Interchangeable(entry)
    pending, drawn, plausible = torch.arange(n), 0, 0
    broken = torch.zeros(len(RULES), dtype=torch.long)
    weights, kept, owners = [], [], []
    flown: Trajectories | None = None
    while len(pending) and drawn < budget:
        wanted = draws.wanted(pending, drawn, plausible)[: budget - drawn]
        size = len(wanted)
        tries = draws.weights(model, wanted, int(torch.randint(2**31, (), generator=generator)))
        entries = draws.entries(plausibility, wanted, generator).to(tries.device)
        # What was kept of the last batch was copied, so a batch of the same size may take its arrays.
        reused = flown if flown is not None and len(flown) == size else None
        white = torch.randn(size, decoder.n_white, generator=generator, dtype=torch.float64).to(tries)
        numbers = DrawNumbers(seed, drawn)
        flown = decoder(tries, entries, out=reused, compiled=compiled, draws=numbers, white=white)
        drag_n = flown.drag_n
        if own is not None:
            flown = own.fly(decoder.aircraft, flown, wanted)
        # Bounds of drag are those at the mass that the decoder flies.
        rules = plausibility.broken_rules(replace(flown, drag_n=drag_n))
        good = torch.nonzero(~rules.any(1).cpu())[:, 0]
        drawn, plausible, broken = drawn + size, plausible + len(good), broken + rules.sum(0).cpu()
        accepted, filled = draws.match(good, wanted, pending)
        weights.append(tries[accepted])
        kept.append(flown.subset(accepted))
        owners.append(filled)
        pending = pending[~torch.isin(pending, filled)]
        if progress is not None:
            progress(len(accepted))
    n_kept = n - len(pending)
    counts = dict(zip(RULES, broken.tolist(), strict=True))
    report = RejectionReport(drawn, n_kept, drawn - plausible, plausible - n_kept, counts)
    if len(pending):
        raise SamplingError(f"only {report}", expected=f"{n} plausible descents within {budget} draws", mend=draws.mend)
    order = torch.cat(owners).argsort()
    found = Samples(torch.cat(weights)[order], concatenate(kept).subset(order), report)
    everyone = torch.arange(n)
    return found if own is None else replace(found, air=own.airs(everyone), mass_kg=own.masses(everyone))


def _entries(
    entry: Tensor | None, own: OwnConditions | None, plausibility: Plausibility, n: int, generator: torch.Generator
) -> Tensor:
    """Indices (n,) of the samples' levels of entry."""
    if own is not None and own.of_entry is not None:
        assert entry is not None
        return entry[own.of_entry]
    return _Interchangeable(entry).entries(plausibility, torch.arange(n), generator)


@dataclass(frozen=True)
class _Interchangeable:
    """Without a context any plausible draw may be the next sample."""

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
class _OfContexts:
    """With contexts a draw is for one sample, whose context it has."""

    context: Tensor
    entry: Tensor | None
    mend: ClassVar[str] = "give a context like those of the training flights, or raise the draw budget"

    def wanted(self, pending: Tensor, drawn: int, plausible: int) -> Tensor:
        """Which sample each draw of the next batch is for: every pending one, repeatedly if few draws are plausible."""
        first = pending[:BATCH]
        times = min(ceil((drawn + 1) / (plausible + 1)), BATCH // len(first))
        return first.repeat(max(times, 1))

    def weights(self, model: Sampler | ConditionalSampler, wanted: Tensor, seed: int) -> Tensor:
        """The weights of a batch, each for its sample's context."""
        return model.sample(len(wanted), seed, self.context[wanted % len(self.context)])  # type: ignore[call-arg]

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


class _OfSamples:
    """A draw is for one sample, which keeps its entry level and its air until it is plausible."""

    mend = _Interchangeable.mend

    def __init__(self, entry: Tensor) -> None:
        """Take the samples' levels of entry (n,), indices of the grid."""
        self.entry = entry

    def wanted(self, pending: Tensor, drawn: int, plausible: int) -> Tensor:
        """Which sample each draw of the next batch is for: every pending one."""
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


class _OfEntries(_OfSamples):
    """With a gate a draw is for one sample, which keeps entry level and component until it is plausible."""

    def __init__(self, gate: EntryGate, entry: Tensor) -> None:
        """Take the samples' levels of entry (n,), indices of the grid; components are drawn when they are wanted."""
        super().__init__(entry)
        self.gate = gate
        self.component, self.tries = torch.zeros_like(entry), torch.full_like(entry, MAX_TRIES)

    def weights(self, model: Sampler | ConditionalSampler, wanted: Tensor, seed: int) -> Tensor:
        """The weights of a batch, each of its sample's component: another one after so many tries in vain."""
        tired = wanted[self.tries[wanted] >= MAX_TRIES]
        self.component[tired] = self.gate.draw(self.entry[tired], torch.Generator().manual_seed(seed))
        self.tries[tired] = 0
        self.tries[wanted] += 1
        assert isinstance(model, GatedSampler)
        return model.sample_of(self.component[wanted], seed)
