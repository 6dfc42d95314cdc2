"""How far the scores depend on which flights were held out: bootstrap intervals over flights."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError
from descentflow.evaluation.metrics.comparison import STATISTICS, whole_distances
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.noise_floor import Values
from descentflow.evaluation.metrics.scores import QUANTITIES, parts_of

MOST_SAMPLES = 2000
"""Samples that resampled flights are compared with: their own noise is small beside that of hundreds of flights."""
NORMAL_90 = 1.645


@dataclass(frozen=True)
class Interval:
    """A 90 % interval of one score."""

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
        progress: Called with 1 after each.

    Raises:
        ConfigError: If there are fewer than two resamples.

    Example:
        >>> {(i.quantity, i.statistic): (i.low, i.high) for i in score_intervals(drawn, held_out, 291.5)}
    """
    if n_resamples < 2:
        raise ConfigError(f"{n_resamples} resamples", expected="at least two", mend="ask for 50")
    generator = torch.Generator().manual_seed(seed)
    few = samples.subset(torch.randperm(len(samples), generator=generator)[:MOST_SAMPLES])
    resampled: list[Tensor] = []
    for _ in range(n_resamples):
        chosen = torch.randint(len(real), (len(real),), generator=generator)
        resampled.append(_scores(few, real.subset(chosen), transition_fl))
        if progress is not None:
            progress(1)
    middle = _scores(samples, real, transition_fl)
    deviation = torch.stack(resampled).std(0)
    low, high = (middle - NORMAL_90 * deviation).clamp(min=0), middle + NORMAL_90 * deviation
    names = [(name, statistic) for name, _, _ in _parts(real, transition_fl) for statistic in STATISTICS]
    ends = zip(low.flatten().tolist(), high.flatten().tolist(), strict=True)
    return [Interval(*name, *end) for name, end in zip(names, ends, strict=True)]


def _parts(real: DescentSet, transition_fl: float) -> list[tuple[str, Callable[[DescentSet], Values], Tensor]]:
    """Name, values and levels of each row of the table."""
    return [
        (name, quantity.of, part)
        for quantity in QUANTITIES
        for name, part in parts_of(quantity, real.levels_fl, transition_fl)
    ]


def _scores(samples: DescentSet, real: DescentSet, transition_fl: float) -> Tensor:
    """Scores (parts, 3), averaged over the levels of each part that have enough values."""
    found: dict[Callable[[DescentSet], Values], Tensor] = {}
    rows = []
    for _, of, part in _parts(real, transition_fl):
        if of not in found:
            found[of] = whole_distances(of(samples), of(real))
        rows.append(found[of][:, part].nanmean(1))
    return torch.stack(rows)
