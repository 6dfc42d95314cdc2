"""Bootstrap intervals of scores over held-out flights."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.noise_floor import whole_distances
from descentflow.evaluation.metrics.score_registry import QUANTITIES, parts_of, statistics_of
from descentflow.evaluation.metrics.score_table import ScoreTable
from descentflow.evaluation.metrics.statistic_kinds import LevelStatistic

MAX_SAMPLES = 2000
"""Samples that resampled flights are compared with: their own noise is small next to that of hundreds of flights."""
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
    scores: ScoreTable,
    samples: DescentSet,
    real: DescentSet,
    transition_fl: float,
    seed: int = 0,
    n_resamples: int = 50,
) -> list[Interval]:
    """90 % intervals of scores, one for each row of their table.

    Whole flights are drawn with replacement and scored again. A distance to resampled flights is larger than to the
    flights themselves, because repeats make them lumpier; so the spread of the distances is used, not their
    quantiles: the score, plus and minus 1.645 of their standard deviations, zero at the least. Statistics of whole
    profiles and descents are means over flights, drawn again as they are: the interval of the classifier's AUC takes
    the classifiers as trained.

    Args:
        scores: What :func:`descentflow.evaluation.metrics.scores.score` found for the same samples and flights.
        samples: Sampled descents.
        real: Held-out flights on the same grid.
        transition_fl: Transition level of the type.
        seed: Of the resampling.
        n_resamples: How often, at least two.

    Raises:
        ConfigError: If there are fewer than two resamples.

    Example:
        >>> from descentflow.evaluation.metrics.scores import score
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 40, seed=s).trajectories) for s in (1, 2))
        >>> table = score(one, two, 291.5, n_splits=2)
        >>> found = {(i.quantity, i.statistic): i for i in score_intervals(table, one, two, 291.5, n_resamples=5)}
        >>> below = found["cas_below_transition", "wasserstein"]
        >>> below.low <= below.high
        True
    """
    generator = torch.Generator().manual_seed(seed)
    few = samples.subset(torch.randperm(len(samples), generator=generator)[:MAX_SAMPLES])
    drawn = torch.randint(len(real), (n_resamples, len(real)), generator=generator)
    spreads = _level_spreads(few, real, transition_fl, drawn)
    spreads |= {name: flights[drawn].double().nanmean(1).std() for name, flights in scores.by_flight.items()}
    intervals = []
    for row in scores:
        half = NORMAL_90 * float(spreads[row.quantity, row.statistic])
        # NaN, of a score that could not be told, stays NaN: comparisons with it are false.
        low = 0.0 if row.score - half < 0 else row.score - half
        intervals.append(Interval(row.quantity, row.statistic, low, row.score + half))
    return intervals


def _level_spreads(
    samples: DescentSet, real: DescentSet, transition_fl: float, drawn: Tensor
) -> dict[tuple[str, str], Tensor]:
    """Standard deviation over the resamples of each score by level, averaged over the levels of each part."""
    spreads = {}
    for quantity in QUANTITIES:
        values, mask = quantity.of(real)
        each = [whole_distances(quantity.of(samples), (values[draw], mask[draw])) for draw in drawn]
        distances = {name: torch.stack([draw[name] for draw in each]) for name in each[0]}
        for part in parts_of(quantity):
            chosen = part.levels(real.levels_fl, transition_fl)
            for draw in statistics_of(LevelStatistic):
                spreads[part.name, draw.name] = distances[draw.name][:, chosen].nanmean(1).std()
    return spreads
