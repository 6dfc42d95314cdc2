"""Rejection sampling of plausible descents, bounded by a draw budget and accounting for every draw."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from descentflow.core.errors import SamplingError
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES, Plausibility

BATCH = 10_000
"""Draws decoded at once: 10,000 descents on 228 levels are 18 MB a quantity."""


class Sampler(Protocol):
    """Whatever draws standardised weights repeatably."""

    def sample(self, n: int, seed: int) -> Tensor:
        """Draw (n, d) weights."""


@dataclass(frozen=True)
class RejectionReport:
    """What became of every draw.

    A draw that breaks several rules counts under each of them, so ``broken`` may sum to more than ``rejected``.
    ``surplus`` draws were plausible but beyond the number asked for.
    """

    drawn: int
    accepted: int
    rejected: int
    surplus: int
    broken: dict[str, int]

    @property
    def acceptance(self) -> float:
        """Share of draws that were plausible."""
        return (self.accepted + self.surplus) / self.drawn if self.drawn else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Primitives for a JSON report."""
        return {**self.__dict__, "acceptance": self.acceptance}

    def __str__(self) -> str:
        """One line for a terminal."""
        reasons = ", ".join(f"{rule} {count}" for rule, count in self.broken.items() if count) or "none"
        return f"{self.accepted} samples from {self.drawn} draws ({self.acceptance:.1%} plausible; broken: {reasons})"


@dataclass(frozen=True)
class Samples:
    """Accepted descents: weights (n, d), trajectories, and the account of all draws."""

    weights: Tensor
    trajectories: Trajectories
    report: RejectionReport


@torch.no_grad()
def sample_descents(
    model: Sampler,
    decoder: DescentDecoder,
    plausibility: Plausibility,
    n: int,
    seed: int,
    *,
    entry: Tensor | None = None,
    draw_budget: int | None = None,
    compiled: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Samples:
    """Draw, decode and keep plausible descents until there are ``n``.

    Args:
        model: Latent model.
        decoder: Its decoder.
        plausibility: Bounds and entry levels.
        n: Number of descents wanted.
        seed: Makes the whole result repeatable on one machine.
        entry: (m,) entry-level indices to draw from with replacement, for instance those of the test flights
            (paper, section 4.2); the training flights' entries if absent.
        draw_budget: Most draws; 100 for each descent wanted (at least 10,000) if absent.
        compiled: Decode by compiled arithmetic, see :func:`descentflow.representation.decoder.trajectories.integrate`.
        progress: Called with the number of descents newly accepted.

    Raises:
        SamplingError: If the budget is spent first; the message names the rules that rejected most.
    """
    budget = max(100 * n, 10_000) if draw_budget is None else draw_budget
    generator = torch.Generator().manual_seed(seed)
    kept_weights, kept, n_kept, drawn = [], [], 0, 0
    broken = torch.zeros(len(RULES), dtype=torch.long)
    rejected = 0
    flown: Trajectories | None = None
    while n_kept < n and drawn < budget:
        size = min(_next_batch(n - n_kept, drawn, n_kept), budget - drawn)
        weights = model.sample(size, int(torch.randint(2**31, (), generator=generator)))
        # What was kept of the last batch was copied, so a batch of the same size may take its arrays.
        reused = flown if flown is not None and len(flown) == size else None
        begins = _draw_entry(plausibility, entry, size, generator).to(weights.device)
        flown = decoder(weights, begins, out=reused, compiled=compiled)
        rules = plausibility.broken_rules(flown)
        good = ~rules.any(1)
        drawn += size
        broken += rules.sum(0).cpu()
        rejected += size - int(good.sum())
        kept_weights.append(weights[good])
        kept.append(flown.subset(good))
        if progress is not None:
            progress(min(int(good.sum()), n - n_kept))
        n_kept += int(good.sum())
    counts = dict(zip(RULES, broken.tolist(), strict=True))
    report = RejectionReport(drawn, min(n_kept, n), rejected, max(n_kept - n, 0), counts)
    if n_kept < n:
        raise SamplingError(
            f"only {report}",
            expected=f"{n} plausible descents within {budget} draws",
            mend="train on more flights or with fewer components, or raise the draw budget",
        )
    first = slice(0, n)
    return Samples(torch.cat(kept_weights)[first], concatenate(kept).subset(torch.arange(n)), report)


def _draw_entry(plausibility: Plausibility, entry: Tensor | None, n: int, generator: torch.Generator) -> Tensor:
    if entry is None:
        return plausibility.draw_entry(n, generator)
    return entry[torch.randint(len(entry), (n,), generator=generator)]


def _next_batch(missing: int, drawn: int, kept: int) -> int:
    """Draws that should yield the missing descents at the acceptance seen so far, and a little more."""
    acceptance = (kept + 1) / (drawn + 1) if drawn else 0.9
    return min(int(missing / acceptance * 1.05) + 16, BATCH)
