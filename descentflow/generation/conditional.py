"""Rejection sampling of plausible descents of given contexts."""

from collections.abc import Callable
from math import ceil
from typing import Protocol

import torch
from torch import Tensor

from descentflow.core.errors import SamplingError
from descentflow.generation.rejection import BATCH, RejectionReport, Samples
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import concatenate
from descentflow.representation.plausibility import RULES, Plausibility


class ConditionalSampler(Protocol):
    """Whatever draws standardised weights of given contexts repeatably."""

    def sample(self, n: int, seed: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) weights given context (n, c)."""


@torch.no_grad()
def sample_given(
    model: ConditionalSampler,
    decoder: DescentDecoder,
    plausibility: Plausibility,
    context: Tensor,
    n: int,
    seed: int,
    *,
    entry: Tensor | None = None,
    draw_budget: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Samples:
    """Draw, decode and keep plausible descents until there are ``n``; sample i is of context i modulo m.

    A draw that is rejected is drawn again with the same context: contexts whose draws are rejected more often are as
    frequent among the samples as the others.

    Args:
        model: Conditional density.
        decoder: Its decoder.
        plausibility: Bounds and entry levels.
        context: (m, c) encoded contexts.
        n: Number of descents wanted.
        seed: Makes the whole result repeatable on one machine.
        entry: (m,) index of the entry level of each context; drawn from the training flights' entries if absent.
        draw_budget: Most draws; 100 for each descent wanted (at least 10,000) if absent.
        progress: Called with the number of descents newly accepted.

    Raises:
        SamplingError: If the budget is spent first; the message names the rules that rejected most.
        ConfigError: If the density takes no such context.

    Example:
        >>> context = model.representation.context.given({"deviation_k": 10, "operator": "FST"})
        >>> sample_given(model, parts.decoder, parts.plausibility, context, n=1000, seed=0).report.accepted
        1000
    """
    budget = max(100 * n, 10_000) if draw_budget is None else draw_budget
    generator = torch.Generator().manual_seed(seed)
    row = torch.arange(n) % len(context)
    pending = torch.arange(n)
    weights, kept, owners = [], [], []
    broken = torch.zeros(len(RULES), dtype=torch.long)
    drawn = plausible = 0
    while len(pending) and drawn < budget:
        slots = _slots(pending, drawn, plausible)[: budget - drawn]
        tries = model.sample(len(slots), int(torch.randint(2**31, (), generator=generator)), context[row[slots]])
        begins = plausibility.draw_entry(len(slots), generator) if entry is None else entry[row[slots]]
        flown = decoder(tries, begins.to(tries.device))
        rules = plausibility.broken_rules(flown)
        good = torch.nonzero(~rules.any(1).cpu())[:, 0]
        drawn, plausible, broken = drawn + len(slots), plausible + len(good), broken + rules.sum(0).cpu()
        first = good[_first_of_each(slots[good])]
        weights.append(tries[first])
        kept.append(flown.subset(first))
        owners.append(slots[first])
        pending = pending[~torch.isin(pending, slots[first])]
        if progress is not None:
            progress(len(first))
    counts = dict(zip(RULES, broken.tolist(), strict=True))
    accepted = n - len(pending)
    report = RejectionReport(drawn, accepted, drawn - plausible, plausible - accepted, counts)
    if len(pending):
        raise SamplingError(
            f"only {report}",
            expected=f"{n} plausible descents within {budget} draws",
            mend="give a context like those of the training flights, or raise the draw budget",
        )
    order = torch.cat(owners).argsort()
    return Samples(torch.cat(weights)[order], concatenate(kept).subset(order), report)


def _slots(pending: Tensor, drawn: int, plausible: int) -> Tensor:
    """Which sample each of the next draws is for: all pending ones, several times where few draws are plausible."""
    first = pending[:BATCH]
    times = min(ceil((drawn + 1) / (plausible + 1)), BATCH // len(first))
    return first.repeat(max(times, 1))


def _first_of_each(slots: Tensor) -> Tensor:
    """Positions of the first entry of every sample."""
    order = slots.argsort(stable=True)
    new = torch.ones(len(slots), dtype=torch.bool)
    new[1:] = slots[order][1:] != slots[order][:-1]
    return order[new]
