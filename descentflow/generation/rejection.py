"""Rejection sampling of plausible descents, with or without a context, within a draw budget.

The bounds themselves are in :mod:`descentflow.representation.plausibility`.
"""

from collections.abc import Callable
from dataclasses import replace

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.counter_random import DrawNumbers, seed_for_index
from descentflow.core.errors import SamplingError
from descentflow.generation.draw_owners import (
    Interchangeable,
    OfContexts,
    OfEntries,
    OfSamples,
    entry_levels_of,
)
from descentflow.generation.own_air_of_samples import AirWhereFlown, OwnAir
from descentflow.generation.samplers import ConditionalSampler, GatedSampler, Sampler
from descentflow.generation.samples import RejectionReport, Samples
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES
from descentflow.representation.representation import Representation


@torch.no_grad()
def sample_descents(
    model: Sampler | ConditionalSampler,
    parts: Representation,
    n: int,
    seed: int,
    *,
    context: Tensor | None = None,
    entry: Tensor | None = None,
    air: LevelAir | AirWhereFlown | None = None,
    draw_budget: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Samples:
    """Draw, decode and keep plausible descents until there are ``n`` (paper, section 2.4).

    A density with a gate draws each sample's component by its level of entry, and a rejected draw is drawn again of
    the same component from the same level: proportions are shares of flights, all of which are plausible, and rejection
    would change them. With m contexts, sample i has context i modulo m, and a rejected draw is drawn again with the
    same context, so that contexts whose draws are rejected more often are as frequent among the samples as the others.

    Args:
        model: Density of the standardised weights.
        parts: Its representation.
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
        draw_budget: Most draws; 100 for each descent wanted (at least 10,000) if absent.
        progress: Progress callback: called with the number of descents newly accepted.

    Raises:
        SamplingError: If the budget is spent first; the message names the rules that rejected most.
        ConfigError: If the density does not take such a context.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> samples = sample_descents(model, model.representation, n=100, seed=0)
        >>> samples.report.accepted, samples.weights.shape[0]
        (100, 100)
    """
    decoder, plausibility = parts.decoder, parts.plausibility
    budget = draw_budget or max(100 * n, 10_000)
    generator = torch.Generator().manual_seed(seed)
    draws: Interchangeable | OfContexts | OfEntries | OfSamples
    own = None if air is None else OwnAir(air, n, seed, context, entry)
    if context is not None:
        draws = OfContexts(context, entry)
    elif isinstance(model, GatedSampler) and model.entry_gate is not None:
        draws = OfEntries(model.entry_gate, entry_levels_of(entry, own, plausibility, n, generator))
    elif own is not None:
        draws = OfSamples(entry_levels_of(entry, own, plausibility, n, generator))
    else:
        draws = Interchangeable(entry)
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
        white = draws.residual(model, wanted, tries, white, seed_for_index(seed, drawn))
        numbers = DrawNumbers(seed, drawn)
        flown = parts.fly(tries, entries, white=white, draws=numbers, out=reused)
        if own is not None:
            flown = own.fly(decoder.aircraft, flown, wanted)
        rules = plausibility.broken_rules(flown)
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
    return found if own is None else replace(found, air=own.airs(everyone))
