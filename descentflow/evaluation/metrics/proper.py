"""Proper scores, with estimators whose expectation does not depend on the sample size.

KS and Wasserstein distances of finite samples are above zero even between samples of one distribution, more so for
small ones. These are not: the fair scores (Ferro, 2014, doi:10.1002/qj.2270) compare samples of any sizes, and may fall
below zero.

Both take the samples as one forecast of all flights.
"""

import torch
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import Pooled, Values, level_spreads, observed_mean

_PAIRS = 1 << 22
"""Distances held at once: 32 MB in float64."""
MIN_MEMBERS = 4
"""Samples below which a profile is not scored."""
MAX_MEMBERS = 5_000
"""Samples that make the forecast of a profile: the noise of thousands is small against that of hundreds of flights."""
WITHIN_PAIRS = 1_000
"""Pairs of samples that tell how far apart samples are, or as many as there are samples if these are more."""
PROFILE_LEVELS = 40
"""Levels of a profile, at the least and if the grid has as many: every fifth of 200, since neighbours are alike."""


def crps_of(pooled: Pooled) -> Tensor:
    """Fair continuous ranked probability score of the samples (first) as one forecast of every real flight, per level.

    ``mean |X - y| - 1/2 mean |X - X'|`` over distinct pairs of samples X, averaged over the real values y; lower is
    better, and lowest in expectation for the distribution of the real values.

    Returns:
        (K,) in the unit of the values; NaN with fewer than two samples or no real value.

    Example:
        >>> samples, real = torch.tensor([[0.0], [2.0]]), torch.tensor([[3.0]])
        >>> from descentflow.evaluation.metrics.distances import pool
        >>> crps_of(pool(samples, samples > -1, real, real > -1))  # 2 - 2 / 2
        tensor([1.], dtype=torch.float64)
    """
    n, m = pooled.n_first, pooled.n_second
    return _across(pooled) / (n * m)[:, 0] - _among(pooled.below_first, n, pooled) / (n * (n - 1))[:, 0] / 2


def crps_of_one(forecast: Values, real: Values) -> Tensor:
    """CRPS (K,) of one descent as a certain forecast: its mean absolute difference from the real ones.

    Example:
        >>> one, real = torch.tensor([[2.0]]), torch.tensor([[1.0], [5.0]])
        >>> crps_of_one((one, one > 0), (real, real > 0))
        tensor([2.], dtype=torch.float64)
    """
    values, mask = real
    total = torch.where(mask, (values - forecast[0]).abs(), 0.0).sum(0, dtype=torch.float64)
    return (total / mask.sum(0)).where(forecast[1][0], torch.nan)


def energy_scores(samples: Values, real: Values) -> Tensor:
    """Fair energy score of the samples as one forecast of each real profile, over the levels where it was observed.

    ``mean |X - y| - 1/2 mean |X - X'|`` with the root mean square over the levels where the profile y was observed as
    norm; members X are the samples that are there at all of these levels. Lower is better, and lowest in expectation
    for the distribution of the real profiles. The second mean is over pairs of neighbours in a random ring of the
    members, which keeps it unbiased at any size and needs no work for each of all pairs.

    On grids of many levels every k-th is taken, so that :data:`PROFILE_LEVELS` or more are left: the score of those
    levels is as proper, close to that of all, and costs a fraction.

    Args:
        samples: Values and mask (n, L) of sampled profiles.
        real: Values and mask (m, L) of real profiles.

    Returns:
        (m,) in the unit of the values; NaN for profiles with fewer than :data:`MIN_MEMBERS` members.

    Example:
        >>> samples, real = torch.randn(50, 9).double(), torch.randn(20, 9).double()
        >>> everywhere = torch.ones(50, 9) > 0, torch.ones(20, 9) > 0
        >>> energy_scores((samples, everywhere[0]), (real, everywhere[1])).shape
        torch.Size([20])
    """
    n, m = len(samples[0]), len(real[0])
    if n < MIN_MEMBERS or m == 0:
        return torch.full((m,), torch.nan, dtype=torch.float64, device=real[0].device)
    order = torch.randperm(n, generator=torch.Generator().manual_seed(0))[:MAX_MEMBERS].to(samples[0].device)
    every = max(samples[0].shape[1] // PROFILE_LEVELS, 1)
    members = samples[0][order, ::every], samples[1][order, ::every]
    step = max(_PAIRS // len(order), 1)
    parts = [(real[0][at : at + step, ::every], real[1][at : at + step, ::every]) for at in range(0, m, step)]
    return torch.cat([_energy_scores(members, part) for part in parts])


def energy_scores_of_one(forecast: Values, real: Values) -> Tensor:
    """Energy scores (m,) of one profile as a certain forecast: its root mean square difference from each real one.

    Example:
        >>> one, real = torch.zeros(1, 2), torch.tensor([[3.0, 3.0], [1.0, -1.0]])
        >>> energy_scores_of_one((one, one == 0), (real, real != 0))
        tensor([3., 1.], dtype=torch.float64)
    """
    mask = real[1] & forecast[1]
    squares = torch.where(mask, (real[0] - forecast[0]).double().square(), 0.0).sum(1)
    return (squares / mask.sum(1)).sqrt().where((mask == real[1]).all(1), torch.nan)


def _energy_scores(members: Values, real: Values) -> Tensor:
    n = len(members[0])
    seen = real[1].double()
    n_levels = seen.sum(1)
    # Counted from the mean, squares of small differences are not lost in products of large values.
    centre = torch.where(real[1], real[0], 0.0).sum(0, dtype=torch.float64) / real[1].sum(0).clamp(min=1)
    x = torch.where(members[1], members[0].double() - centre, 0.0)
    y = torch.where(real[1], real[0].double() - centre, 0.0)
    there = (~members[1]).float() @ seen.float().T == 0  # counts are exact in single precision
    squares = x.square() @ seen.T - 2 * x @ y.T + y.square().sum(1)
    across = _mean_root(squares / n_levels, there)
    within = torch.zeros_like(across)
    pairs = torch.zeros_like(across)
    for step in range(1, max(min(WITHIN_PAIRS // n, n - 1), 1) + 1):
        both = there & there.roll(-step, 0)
        squares = (x - x.roll(-step, 0)).square() @ seen.T
        within += (squares / n_levels).sqrt_().mul_(both).nan_to_num_(0.0).sum(0)
        pairs += both.sum(0)
    enough = (there.sum(0) >= MIN_MEMBERS) & (pairs > 0)
    return (across - within / pairs / 2).where(enough, torch.nan)


def _mean_root(squares: Tensor, chosen: Tensor) -> Tensor:
    """Mean (m,) of the roots of the chosen (n, m); NaN where none is."""
    return squares.clamp_(min=0).sqrt_().mul_(chosen).nan_to_num_(0.0).sum(0) / chosen.sum(0)


def _across(pooled: Pooled) -> Tensor:
    """Sum (K,) of absolute differences of all pairs of a first and a second value.

    ``E|X - Y|`` is the integral of ``F (1 - G) + G (1 - F)``, a sum of terms that are never negative.
    """
    above_first, above_second = pooled.n_first - pooled.below_first, pooled.n_second - pooled.below_second
    return ((pooled.below_first * above_second + pooled.below_second * above_first) * pooled.widths).sum(1)


def _among(below: Tensor, n: Tensor, pooled: Pooled) -> Tensor:
    """Sum (K,) of absolute differences of all ordered pairs of one set, of which ``below`` (K, N) counts the values."""
    return (2 * below * (n - below) * pooled.widths).sum(1)


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
    mean, spread = observed_mean(real, real_mask), level_spreads(real, real_mask)
    known = spread > 0
    return ((samples - mean) / spread, samples_mask & known), ((real - mean) / spread, real_mask & known)
