"""Proper scores of forecasts that differ from flight to flight: each flight has samples of its own.

The fair estimators of :mod:`descentflow.evaluation.metrics.proper` (Ferro, 2014, doi:10.1002/qj.2270), one number a
flight, so that two models can be compared flight by flight.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError


def crps_each(samples: Tensor, real: Tensor) -> Tensor:
    """Fair CRPS of every flight's own samples, ``mean |X - y| - 1/2 mean |X - X'|`` over distinct pairs.

    Args:
        samples: (n, m, ...) m samples for each of n flights.
        real: (n, ...) what came.

    Returns:
        (n, ...) in the unit of the values.

    Raises:
        ConfigError: If there are fewer than two samples a flight.

    Example:
        >>> crps_each(torch.tensor([[0.0, 2.0]]), torch.tensor([1.0]))
        tensor([0.])
    """
    m = samples.shape[1]
    _at_least_two(m)
    across = (samples - real[:, None]).abs().mean(1)
    # The sum over pairs of |x - x'| is a weighted sum of the ordered values.
    rank = torch.arange(m, dtype=samples.dtype, device=samples.device)
    weight = (2 * rank - m + 1).reshape(m, *([1] * (samples.ndim - 2)))
    within = (samples.sort(1).values * weight).sum(1) * 2 / (m * (m - 1))
    return across - within / 2


def energy_score_each(samples: Tensor, real: Tensor) -> Tensor:
    """Fair energy score (n,) of every flight's own samples (n, m, d) at real (n, d): the CRPS in several dimensions.

    Raises:
        ConfigError: If there are fewer than two samples a flight.
    """
    m = samples.shape[1]
    _at_least_two(m)
    across = (samples - real[:, None]).norm(dim=2).mean(1)
    within = [torch.cdist(one, one, compute_mode="donot_use_mm_for_euclid_dist").sum() for one in samples]
    score: Tensor = across - torch.stack(within) / (m * (m - 1)) / 2
    return score


@dataclass(frozen=True)
class Skill:
    """Mean of a score's difference over flights, with its 90 % bootstrap interval; below zero the first is better."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        """Mean and interval."""
        return f"{self.mean:+.3f} [{self.low:+.3f}, {self.high:+.3f}]"


def skill(scores: Tensor, reference: Tensor, seed: int = 0, n_resamples: int = 2000) -> Skill:
    """How much better a model does than a reference on the same flights, for scores where less is better.

    Args:
        scores: (n,) of the model, flight by flight (negative log density, CRPS, energy score).
        reference: (n,) of the reference.
        seed: Of the resampling.
        n_resamples: Resamples of the flights, with replacement.

    Example:
        >>> skill(torch.tensor([1.0, 2.0]), torch.tensor([2.0, 3.0])).mean
        -1.0
    """
    difference = (scores - reference).double()
    generator = torch.Generator().manual_seed(seed)
    chosen = torch.randint(len(difference), (n_resamples, len(difference)), generator=generator)
    low, high = difference[chosen].mean(1).quantile(torch.tensor([0.05, 0.95]).double()).tolist()
    return Skill(float(difference.mean()), low, high)


def _at_least_two(m: int) -> None:
    if m < 2:
        raise ConfigError(f"{m} sample(s) a flight", expected="two at the least", mend="draw more for every flight")
