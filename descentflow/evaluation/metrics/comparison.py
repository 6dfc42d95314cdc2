"""One quantity of sampled and real descents compared: whole, and at one fixed size beside its noise floor."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.level_distances import Distances, level_distances
from descentflow.evaluation.metrics.noise_floor import (
    MIN_VALUES,
    matched_size,
    split_descent_scores,
    split_distances,
    split_profile_scores,
)
from descentflow.evaluation.metrics.pooled import Values
from descentflow.evaluation.metrics.score_registry import DescentStatistic, ProfileStatistic


@dataclass(frozen=True)
class Comparison:
    """Statistics by name; NaN where there are too few values.

    Level statistics: ``whole`` (K,), all samples against all flights; ``same`` and ``floor`` (n_splits, K), samples
    and other flights against ``n_each`` flights, as many of each (:func:`split_distances`). A statistic of whole
    profiles has one value for each of the m flights in ``whole`` (m,), and means in ``same`` and ``floor``
    (n_splits, 1). Statistics without a noise floor are not in ``same`` and ``floor``.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> found = compare(samples, real, seed=0, n_splits=5)
        >>> found.whole["mae"], found.floor["mae"].shape, found.n_each
        (tensor([3.], dtype=torch.float64), torch.Size([5, 1]), 4)
    """

    whole: Mapping[str, Tensor]
    same: Mapping[str, Tensor]
    floor: Mapping[str, Tensor]
    n_each: int


def compare(
    samples: Values,
    real: Values,
    seed: int,
    n_splits: int,
    progress: Callable[[int], None] = lambda _: None,
) -> Comparison:
    """Compare samples with real flights level by level, and flights with each other.

    Args:
        samples: Values and mask of the sampled descents.
        real: Values and mask of the real flights, on the same levels.
        seed: Of the splits.
        n_splits: How many.
        progress: Progress callback: called with the number of splits that have been compared since it was last called.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> found = compare(samples, real, seed=0, n_splits=5)
        >>> found.whole["mae"], found.same["mae"].shape  # the means are 9.5 and 6.5
        (tensor([3.], dtype=torch.float64), torch.Size([5, 1]))
    """
    splits = split_distances(samples, real, seed=seed, n_splits=n_splits, progress=progress)
    same, noise = (_enough(side) for side in splits)
    return Comparison(whole_distances(samples, real), same, noise, matched_size(samples, real))


def compare_profiles(
    statistic: ProfileStatistic, samples: Values, real: Values, seed: int, n_splits: int
) -> Comparison:
    """As :func:`compare`, by a statistic of whole profiles.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import profile_statistics
        >>> (energy,) = profile_statistics()
        >>> values = torch.arange(24.0)[:, None].expand(24, 3)
        >>> samples, real = (values, values > -1), (values[:10], values[:10] > -1)
        >>> found = compare_profiles(energy, samples, real, seed=0, n_splits=2)
        >>> found.whole["energy"].shape, found.floor["energy"].shape
        (torch.Size([10]), torch.Size([2, 1]))
    """
    name, whole = statistic.name, _enough_flights(statistic.compute(samples, real))
    if not statistic.has_floor:
        return Comparison({name: whole}, {}, {}, matched_size(samples, real))
    same, floor = split_profile_scores(statistic, samples, real, seed=seed, n_splits=n_splits)
    return Comparison({name: whole}, {name: same[:, None]}, {name: floor[:, None]}, matched_size(samples, real))


def compare_descents(
    statistic: DescentStatistic, samples: DescentSet, real: DescentSet, seed: int, n_splits: int
) -> Comparison:
    """As :func:`compare`, by a statistic of whole descents.

    Example:
        >>> from descentflow.evaluation.metrics.score_registry import STATISTICS
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> compare_descents(STATISTICS["joint_energy"], one, two, seed=0, n_splits=2).n_each
        30
    """
    name, whole = statistic.name, _enough_flights(statistic.compute(samples, real))
    same, floor = split_descent_scores(statistic, samples, real, seed=seed, n_splits=n_splits)
    n_each = matched_size((samples.mask, samples.mask), (real.mask, real.mask))
    return Comparison({name: whole}, {name: same[:, None]}, {name: floor[:, None]}, n_each)


def whole_distances(samples: Values, real: Values) -> dict[str, Tensor]:
    """Level statistics (K,) of all samples against all flights, NaN at levels with too few values of a set.

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(8.0)[:, None] + 3
        >>> samples, real = (samples, samples > -1), (real, real > -1)
        >>> whole_distances(samples, real)["mae"]
        tensor([3.], dtype=torch.float64)
        >>> three = real[0][:3], real[1][:3]
        >>> whole_distances(samples, three)["mae"]  # too few
        tensor([nan], dtype=torch.float64)
    """
    return _enough(level_distances(*samples, *real))


def resampled_levels(samples: Values, real: Values, drawn: Tensor) -> dict[str, Tensor]:
    """Level statistics (n_resamples, K) of all samples against the flights at positions ``drawn`` (n_resamples, m).

    Example:
        >>> samples, real = torch.arange(20.0)[:, None], torch.arange(4.0)[:, None]
        >>> drawn = torch.tensor([[0, 1, 2, 3], [3, 3, 3, 3]])
        >>> resampled_levels((samples, samples > -1), (real, real > -1), drawn)["mae"][:, 0]
        tensor([8.0000, 6.5000], dtype=torch.float64)
    """
    values, mask = real
    found = [whole_distances(samples, (values[one], mask[one])) for one in drawn]
    return {name: torch.stack([one[name] for one in found]) for name in found[0]}


def _enough_flights(whole: Tensor) -> Tensor:
    """Scores by flight, all NaN where too few flights have one."""
    return whole if int((~whole.isnan()).sum()) >= MIN_VALUES else torch.full_like(whole, torch.nan)


def _enough(distances: Distances) -> dict[str, Tensor]:
    """Statistics where there are enough values of both sets.

    Within a split, both comparisons have the same counts, and so lack the same levels.
    """
    enough = torch.minimum(distances.n_first, distances.n_second) >= MIN_VALUES
    return {name: values.where(enough, torch.nan) for name, values in distances.by_name.items()}
