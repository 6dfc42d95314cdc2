"""One quantity of sampled and real descents compared level by level, whole and by halves of the real flights."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import Distances, level_distances, observed_mean
from descentflow.evaluation.metrics.noise_floor import Values, half_size, split_distances

STATISTICS = ("ks", "wasserstein", "mae")
MIN_VALUES = 4
"""Fewest values of each set at a level, or of times, from which a distance is taken: below that, a distance says
more about the count than about the flights. By the 25 % rule for the top of the grid, 32 flights leave about 4 in
each half at the highest level."""


@dataclass(frozen=True)
class Comparison:
    """Statistics in the order of :data:`STATISTICS`, NaN at levels with fewer than :data:`MIN_VALUES` of a set.

    Shapes: ``whole`` (3, K), all samples against all flights; ``equal_size`` and ``floor`` (n_splits, 3, K), samples
    against one half of the flights and the other half against it (:func:`split_distances`), NaN at the same places;
    ``n_half`` flights in a half.
    """

    whole: Tensor
    equal_size: Tensor
    floor: Tensor
    n_half: int


def compare(
    samples: Values, real: Values, seed: int, n_splits: int, progress: Callable[[int], None] | None = None
) -> Comparison:
    """Compare samples with real flights, and halves of the flights with each other.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits.
        n_splits: How many.
        progress: Called with 1 after each split.
    """
    same, floor = (
        _stack(side) for side in split_distances(samples, real, seed=seed, n_splits=n_splits, progress=progress)
    )
    return Comparison(whole_distances(samples, real), same, floor, half_size(samples, real))


def whole_distances(samples: Values, real: Values) -> Tensor:
    """Statistics (3, K) of all samples against all flights, NaN at levels with too few values of a set."""
    return _stack(level_distances(*samples, *real))


def nominal_error(nominal: Values, real: Values) -> Tensor:
    """Absolute difference (K,) of the one nominal descent and the mean flight; NaN where nominal is not given."""
    error = (observed_mean(*real) - nominal[0][0]).abs()
    return error.where(nominal[1][0], torch.nan)


def _stack(distances: Distances) -> Tensor:
    """Statistics (..., 3, K) where there are enough values of both sets.

    Within a split, both comparisons have the same counts, and so lack the same levels.
    """
    enough = torch.minimum(distances.n_first, distances.n_second) >= MIN_VALUES
    return torch.stack([getattr(distances, name).where(enough, torch.nan) for name in STATISTICS], -2)
