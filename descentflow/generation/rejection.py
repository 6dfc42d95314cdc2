"""Rejection sampling of plausible descents, with or without a context, within a draw budget.

A sample keeps its level of entry, its context and its air until one of its draws is plausible: they were learnt as
shares of plausible flights, and drawing them anew would bias those shares. The bounds themselves are in
:mod:`descentflow.representation.plausibility`.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.counter_random import DrawNumbers
from descentflow.core.errors import SamplingError
from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import NO_CONTEXT
from descentflow.generation.samples import RejectionReport, Samples
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES
from descentflow.representation.representation import Representation

DRAWS_AT_ONCE = 10_000
"""Draws decoded at once: 10,000 descents on 228 levels are 18 MB a quantity."""
DRAWN_ENTRIES = torch.zeros(0, dtype=torch.int64)
"""In place of levels of entry: they are drawn as the training flights entered."""


FlyWhere = Callable[[PerformanceModel, Trajectories], Trajectories]
"""Descents that were flown in standard air, flown in an air that depends on where they are."""


@torch.no_grad()
def sample_descents(
    model: Density,
    representation: Representation,
    n: int,
    seed: int,
    *,
    context: Tensor = NO_CONTEXT,
    entry: Tensor = DRAWN_ENTRIES,
    air: LevelAir | FlyWhere | None = None,
    draw_budget: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Samples:
    """Draw, decode and keep plausible descents until there are ``n`` (paper, section 2.4).

    The draws of a sample double from one round to the next: rare samples cost what their acceptance asks for.

    Args:
        model: Density of the standardised weights.
        representation: Its representation.
        n: Number of descents wanted.
        seed: Makes the whole result repeatable on one machine.
        context: (m, c) encoded contexts, for a conditional density: sample i has context i modulo m. For
            others c is 0.
        entry: (m,) indices of entry levels. With contexts, one for each of them; without, the levels to draw from
            with replacement, for instance those of the test flights (paper, section 4.2). If absent, they are drawn
            as the training flights entered.
        air: Airs (k, L) that descents are flown in; standard air if absent. A sample's is that of its context where
            there are as many airs as contexts, that of the flight of its entry level where there are as many airs as
            entry levels, else drawn. Or a function that flies them in an air which depends on the place; the samples
            then do not hold theirs.
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
    budget = draw_budget or max(100 * n, 10_000)
    wanted = _Wanted(model, representation, n, seed, context, entry, air)
    drawn, plausible, n_kept, broken = 0, 0, 0, torch.zeros(len(RULES), dtype=torch.long)
    batches: list[tuple[Tensor, Trajectories]] = []
    for start in range(0, n, DRAWS_AT_ONCE):
        pending, tries = torch.arange(start, min(start + DRAWS_AT_ONCE, n)), 0
        while len(pending) and drawn < budget:
            asked, left = pending[: budget - drawn], budget - drawn
            times = max(min(tries, DRAWS_AT_ONCE // len(asked), left // len(asked)), 1)
            weights, flown = wanted.fly(asked, times, drawn)
            rules = representation.plausibility.broken_rules(flown).cpu()
            passes = ~rules.any(1).reshape(times, -1)
            drawn, plausible, broken = drawn + passes.numel(), plausible + int(passes.sum()), broken + rules.sum(0)
            if tries == 0:
                # One draw of each sample: those that are not plausible are overwritten by later draws.
                batches.append((weights, flown))
            else:
                _put_first_plausible(batches[-1], asked - start, passes, weights, flown)
            served = passes.any(0)
            n_kept += int(served.sum())
            pending, tries = torch.cat([asked[~served], pending[len(asked) :]]), tries + times
            if progress is not None:
                progress(int(served.sum()))
    counts = dict(zip(RULES, broken.tolist(), strict=True))
    report = RejectionReport(drawn, n_kept, drawn - plausible, plausible - n_kept, counts)
    if n_kept < n:
        raise SamplingError(
            f"only {report}",
            expected=f"{n} plausible descents within {budget} draws",
            mend="give a context like those of the training flights, or raise the draw budget"
            if context.shape[1]
            else "train on more flights or with fewer components, or raise the draw budget",
        )
    of_batches, parts_flown = zip(*batches, strict=True)
    return Samples(torch.cat(of_batches), concatenate(parts_flown), report, air=wanted.airs(torch.arange(n)))


def _put_first_plausible(
    batch: tuple[Tensor, Trajectories], places: Tensor, passes: Tensor, weights: Tensor, flown: Trajectories
) -> None:
    """Put the first plausible draw of each sample in its place of a batch.

    Args:
        batch: Weights and descents of the samples so far; changed in place.
        places: (m,) places of the samples that were drawn.
        passes: (times, m) whether each draw is plausible.
        weights: Those of the draws, one of each sample, then one of each again.
        flown: Descents of the draws.
    """
    served = passes.any(0)
    draws = torch.arange(passes.numel()).reshape(passes.shape)
    first = draws[passes.int().argmax(0)[served], served.nonzero()[:, 0]].to(weights.device)
    places = places[served].to(weights.device)
    kept_weights, kept = batch
    kept_weights[places] = weights[first]
    kept.put(places, flown.subset(first))


class _Wanted:
    """n samples: what each keeps until a draw of it is plausible, and the draws."""

    def __init__(
        self,
        model: Density,
        representation: Representation,
        n: int,
        seed: int,
        context: Tensor,
        entry: Tensor,
        air: LevelAir | FlyWhere | None,
    ) -> None:
        """Choose entry levels and airs."""
        self.model, self.representation, self.seed, self.context, self.air = model, representation, seed, context, air
        self.generator = torch.Generator().manual_seed(seed)
        everyone = torch.arange(n)
        # By a generator of its own, so that weights and entries are those of the seed in any air.
        n_airs = len(air) if isinstance(air, LevelAir) else 1
        self.air_row = torch.randint(n_airs, (n,), generator=torch.Generator().manual_seed(seed))
        if context.shape[1] and n_airs == len(context):
            self.air_row = everyone % n_airs
        if not len(entry):
            self.entry = representation.plausibility.draw_entry(n, self.generator)
        elif context.shape[1]:
            self.entry = entry[everyone % len(context)]
        elif isinstance(air, LevelAir) and n_airs == len(entry):
            self.entry = entry[self.air_row]
        else:
            self.entry = entry[torch.randint(len(entry), (n,), generator=self.generator)]

    def airs(self, samples: Tensor) -> LevelAir | None:
        """Airs of samples; None in standard air, or where it depends on the place."""
        return self.air.rows(self.air_row[samples]) if isinstance(self.air, LevelAir) else None

    def fly(self, asked: Tensor, times: int, drawn: int) -> tuple[Tensor, Trajectories]:
        """Weights and descents of so many draws for each of these samples (m,): one of each, then one of each again.

        Args:
            asked: Whose draws they are.
            times: Draws for each.
            drawn: Draws that all had.
        """
        samples, decoder = asked.repeat(times), self.representation.decoder
        own_seed = int(torch.randint(2**31, (), generator=self.generator))
        weights = self.model.sample(len(samples), own_seed, self.context[samples % len(self.context)])
        entry = self.entry[samples].to(weights.device)
        uniform = torch.rand(len(samples), generator=self.generator, dtype=torch.float64)
        residual = decoder.residuals.draw(weights, entry, uniform)
        flown = self.representation.fly(weights, entry, residual=residual, draws=DrawNumbers(self.seed, drawn))
        if isinstance(self.air, LevelAir):
            # Here and not above: samples in standard air do without the energy equation of other airs.
            from descentflow.representation.own_air import flown_in

            flown = flown_in(decoder.aircraft, flown, self.air.rows(self.air_row[samples]))
        elif self.air is not None:
            flown = self.air(decoder.aircraft, flown)
        return weights, flown
