"""How far the scores depend on which flights were held out: bootstrap intervals over flights."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.evaluation.metrics.comparison import whole_distances
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.score_registry import (
    QUANTITIES,
    descent_statistics,
    level_statistics,
    parts_of,
    profile_statistics,
    rows,
)

MAX_SAMPLES = 2000
"""Samples that resampled flights are compared with: their own noise is small beside that of hundreds of flights."""
NORMAL_90 = 1.645


@dataclass(frozen=True)
class Interval:
    """A 90 % interval of one score.

    Example:
        >>> found = Interval("cas_below_transition", "wasserstein", low=1.2, high=2.0)
        >>> found.low <= 1.5 <= found.high
        True
    """

    quantity: str
    statistic: str
    low: float
    high: float


def score_intervals(
    samples: DescentSet,
    real: DescentSet,
    transition_fl: float,
    seed: int = 0,
    n_resamples: int = 50,
    *,
    costly: bool = False,
    progress: Callable[[int], None] | None = None,
) -> list[Interval]:
    """90 % intervals of the scores of :func:`descentflow.evaluation.metrics.scores.score`.

    Whole flights are drawn with replacement and scored again. A distance to resampled flights is larger than to the
    flights themselves, because repeats make them lumpier; so the spread of the distances is used, not their
    quantiles: the score, plus and minus 1.645 of their standard deviations, zero at the least.

    Args:
        samples: Sampled descents.
        real: Held-out flights on the same grid.
        transition_fl: Transition level of the type.
        seed: Of the resampling.
        n_resamples: How often, at least two.
        costly: Whether costly statistics are among them. The interval of the classifier's AUC takes the classifiers as
            they are: flights are judged again, not learnt from again.
        progress: Progress callback: called with 1 after each.

    Raises:
        ConfigError: If there are fewer than two resamples.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 40, seed=s).trajectories) for s in (1, 2))
        >>> found = {(i.quantity, i.statistic): i for i in score_intervals(one, two, 291.5, n_resamples=5)}
        >>> below = found["cas_below_transition", "wasserstein"]
        >>> below.low <= below.high
        True
    """
    if n_resamples < 2:
        raise ConfigError(f"{n_resamples} resamples", expected="at least two", mend="ask for 50")
    generator = torch.Generator().manual_seed(seed)
    few = samples.subset(torch.randperm(len(samples), generator=generator)[:MAX_SAMPLES])
    profiles = _profile_scores(samples, real, costly)
    resampled: list[Tensor] = []
    for _ in range(n_resamples):
        chosen = torch.randint(len(real), (len(real),), generator=generator)
        levels = _level_scores(few, real.subset(chosen), transition_fl)
        resampled.append(torch.cat([levels, profiles[:, chosen].nanmean(1)]))
        if progress is not None:
            progress(1)
    middle = torch.cat([_level_scores(samples, real, transition_fl), profiles.nanmean(1)])
    deviation = torch.stack(resampled).std(0)
    low, high = (middle - NORMAL_90 * deviation).clamp(min=0), middle + NORMAL_90 * deviation
    names = [(part.name, statistic.name) for part, statistic in rows(costly=costly)]
    ends = zip(low.tolist(), high.tolist(), strict=True)
    return [Interval(*name, *end) for name, end in zip(names, ends, strict=True)]


def _level_scores(samples: DescentSet, real: DescentSet, transition_fl: float) -> Tensor:
    """Scores by level, averaged over the levels of each part that have enough values, in the order of the table."""
    found = []
    for quantity in QUANTITIES:
        distances = whole_distances(quantity.of(samples), quantity.of(real))
        for part in parts_of(quantity):
            chosen = part.levels(real.levels_fl, transition_fl)
            found += [distances[statistic.name][chosen].nanmean() for statistic in level_statistics()]
    return torch.stack(found)


def _profile_scores(samples: DescentSet, real: DescentSet, costly: bool) -> Tensor:
    """Scores of whole profiles and descents, one for each flight: (rows, flights), in the order of the table."""
    found = [
        statistic.compute(quantity.of(samples), quantity.of(real))
        for quantity in QUANTITIES
        if quantity.by_level
        for statistic in profile_statistics()
    ]
    found += [one.compute(samples, real) for one in descent_statistics(costly=costly)]
    return torch.stack(found) if found else torch.zeros(0, len(real), dtype=torch.float64)
