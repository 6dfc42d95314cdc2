"""Energy score of whole descents: CAS and rate at all levels as one vector, so that their dependence is scored too."""

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import observed_mean
from descentflow.evaluation.metrics.pooled import Values
from descentflow.evaluation.metrics.proper import energy_scores

MIN_FLIGHTS = 4
"""Fewest flights at a level that tell its spread; levels with fewer are left out."""


def joint_energy_scores(samples: DescentSet, real: DescentSet) -> Tensor:
    """Fair energy score (m,) of the samples as one forecast of each flight's CAS and rate at all its levels.

    Every level of either quantity counts in standard deviations of the flights there, so that the norm, a root mean
    square, gives CAS and rate one weight. See :func:`~descentflow.evaluation.metrics.proper.energy_scores`.

    Args:
        samples: n descents.
        real: m flights on the same grid.

    Returns:
        In spreads of the flights; NaN for flights with too few samples at all of their levels.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 40, seed=s).trajectories) for s in (1, 2))
        >>> joint_energy_scores(one, two).shape
        torch.Size([40])
    """
    parts = [_in_spreads(getattr(samples, name), samples.mask, getattr(real, name), real.mask) for name in _SCORED]
    drawn, seen = (
        (torch.cat([part[side][0] for part in parts], 1), torch.cat([part[side][1] for part in parts], 1))
        for side in (0, 1)
    )
    return energy_scores(drawn, seen)


_SCORED = ("cas_mps", "rate_mps")


def _in_spreads(samples: Tensor, samples_mask: Tensor, real: Tensor, real_mask: Tensor) -> tuple[Values, Values]:
    """Both sets minus the flights' mean in their standard deviations, without levels where these are not known."""
    n, mean = real_mask.sum(0), observed_mean(real, real_mask)
    spread = (torch.where(real_mask, real - mean, 0.0).double().square().sum(0) / (n - 1)).sqrt()
    known = (n >= MIN_FLIGHTS) & (spread > 0)
    return ((samples - mean) / spread, samples_mask & known), ((real - mean) / spread, real_mask & known)
