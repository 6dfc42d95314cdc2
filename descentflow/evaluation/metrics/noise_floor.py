"""Distances by level at equal sizes: samples against half of the flights, beside the other half against that half."""

from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import Distances, level_distances

Values = tuple[Tensor, Tensor]
"""Values and mask, (n, K) each; K levels, or one time."""


def split_distances(
    samples: Values,
    real: Values,
    *,
    seed: int = 0,
    n_splits: int = 20,
    progress: Callable[[int], None] | None = None,
) -> tuple[Distances, Distances]:
    """Distances of samples and of flights from the same random halves of the flights.

    Each split draws disjoint halves A and B of the flights and as many samples S, and measures S against A and B
    against A. Where gaps leave B and S with different counts at a level, the larger is cut at random to the smaller,
    so that samples of the flights' own distribution and B are exchangeable: both distances then have one expectation,
    whatever the counts and the gaps.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits; they are the same on every device.
        n_splits: Number of random halvings, at least one.
        progress: Called with 1 after each split.

    Returns:
        Distances of the samples, and the floor; every field is (n_splits, K).

    Example:
        >>> same, floor = split_distances((samples.cas_mps, samples.mask), (real.cas_mps, real.mask))
    """
    generator = torch.Generator().manual_seed(seed)
    flights, drawn = _seen(real), _seen(samples)
    half = half_size(samples, real)
    same, floor = [], []
    for _ in range(n_splits):
        order = torch.randperm(len(flights), generator=generator).to(flights.device)
        picked = torch.randperm(len(drawn), generator=generator)[:half].to(drawn.device)
        first = _take(real, flights[order[:half]])
        second = _take(real, flights[order[half : 2 * half]])
        stand_in, second = _equally_many(_take(samples, drawn[picked]), second)
        same.append(level_distances(*stand_in, *first))
        floor.append(level_distances(*second, *first))
        if progress is not None:
            progress(1)
    return _stack(same), _stack(floor)


def half_size(samples: Values, real: Values) -> int:
    """Flights in each half: half of those observed anywhere, or as many as there are samples if these are fewer."""
    return min(len(_seen(real)) // 2, len(_seen(samples)))


def _seen(values: Values) -> Tensor:
    """Positions of descents observed anywhere: the others say nothing; for times, only those spanning the grid do."""
    return torch.nonzero(values[1].any(1))[:, 0]


def _take(values: Values, index: Tensor) -> Values:
    return values[0][index], values[1][index]


def _equally_many(first: Values, second: Values) -> tuple[Values, Values]:
    """Hide values until both sets have the same count at each level; rows must be in random order."""
    limit = torch.minimum(first[1].sum(0), second[1].sum(0))
    cut = [(values, mask & (mask.cumsum(0) <= limit)) for values, mask in (first, second)]
    return cut[0], cut[1]


def _stack(splits: list[Distances]) -> Distances:
    return Distances(*(torch.stack(fields) for fields in zip(*splits, strict=True)))
