"""Proper scores and energy distances, with estimators whose expectation does not depend on the sample size.

KS and Wasserstein distances of finite samples are above zero even between samples of one distribution, more so for
small ones. These are not: the fair scores (Ferro, 2014, doi:10.1002/qj.2270) and the unbiased energy distance
(Székely and Rizzo, 2013, doi:10.1016/j.jspi.2013.03.018) compare samples of any sizes, and may fall below zero.
"""

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import by_chunks
from descentflow.evaluation.metrics.pooled import Pooled, pool

_PAIRS = 1 << 22
"""Distances held at once: 32 MB in float64."""


def crps(samples: Tensor, samples_mask: Tensor, real: Tensor, real_mask: Tensor) -> Tensor:
    """Fair continuous ranked probability score of the samples as one forecast of every real flight, per level.

    ``mean |X - y| - 1/2 mean |X - X'|`` over distinct pairs of samples X, averaged over the real values y; lower is
    better, and lowest in expectation for the distribution of the real values.

    Args:
        samples: (n, L) sampled values.
        samples_mask: (n, L) bool.
        real: (m, L) real values.
        real_mask: (m, L) bool.

    Returns:
        (L,) in the unit of the values; NaN with fewer than two samples or no real value.

    Raises:
        DataError: If an observed value is not finite.

    Example:
        >>> samples, real = torch.tensor([[0.0], [2.0]]), torch.tensor([[1.0]])
        >>> crps(samples, samples > -1, real, real > -1)
        tensor([0.], dtype=torch.float64)
    """

    def compare(*chunk: Tensor) -> tuple[Tensor, ...]:
        across, among_samples, _ = _mean_differences(pool(*chunk), unbiased=True)
        return (across - among_samples / 2,)

    (score,) = by_chunks(compare, samples, samples_mask, real, real_mask)
    return score


def energy_distance(
    first: Tensor, first_mask: Tensor, second: Tensor, second_mask: Tensor, *, unbiased: bool = True
) -> Tensor:
    """Squared energy distance ``2 E|X - Y| - E|X - X'| - E|Y - Y'|`` per level.

    Args:
        first: (n, L) values.
        first_mask: (n, L) bool.
        second: (m, L) values.
        second_mask: (m, L) bool.
        unbiased: Take distinct pairs within each set: zero in expectation between equal distributions, at any
            sizes. Else the distance of the empirical distributions, never negative, the square of
            ``scipy.stats.energy_distance``.

    Returns:
        (L,) in the unit of the values; NaN where a set has too few values.
    """

    def compare(*chunk: Tensor) -> tuple[Tensor, ...]:
        across, among_first, among_second = _mean_differences(pool(*chunk), unbiased)
        return (2 * across - among_first - among_second,)

    (distance,) = by_chunks(compare, first, first_mask, second, second_mask)
    return distance


def energy_score(samples: Tensor, real: Tensor) -> Tensor:
    """Fair energy score of the samples as one forecast of every real vector (Gneiting and Raftery, 2007, eq. 22).

    The CRPS in several dimensions, with Euclidean norms: for whole profiles or standardised weights. Gappy profiles
    have no norm; score them level by level.

    Args:
        samples: (n, d) sampled vectors, n at least 2.
        real: (m, d) real vectors.

    Returns:
        Scalar, averaged over the real vectors; NaN with fewer than two samples or no real vector.
    """
    n = len(samples)
    among = _sum_of_norms(samples, samples) / (n * (n - 1)) if n > 1 else samples.new_tensor(torch.nan)
    return _sum_of_norms(samples, real) / (n * len(real)) - among / 2 if n and len(real) else among * torch.nan


def _mean_differences(pooled: Pooled, unbiased: bool) -> tuple[Tensor, Tensor, Tensor]:
    """Mean absolute difference (K,) across the samples, within the first and within the second.

    ``E|X - Y|`` is the integral of ``F (1 - G) + G (1 - F)``, a sum of terms that are never negative.
    """
    n, m = pooled.n_first, pooled.n_second
    above_first, above_second = n - pooled.below_first, m - pooled.below_second
    pairs = (
        (pooled.below_first * above_second + pooled.below_second * above_first, n * m),
        (2 * pooled.below_first * above_first, n * (n - 1) if unbiased else n * n),
        (2 * pooled.below_second * above_second, m * (m - 1) if unbiased else m * m),
    )
    across, first, second = ((count * pooled.widths).sum(1) / total[:, 0] for count, total in pairs)
    return across, first, second


def _sum_of_norms(first: Tensor, second: Tensor) -> Tensor:
    """Sum of the Euclidean distances of all pairs, in float64."""
    step = max(_PAIRS // max(len(second), 1), 1)
    second = second.double()
    # Not by matrix products, which lose half of the digits of small distances.
    parts = [
        torch.cdist(part, second, compute_mode="donot_use_mm_for_euclid_dist").sum()
        for part in torch.split(first.double(), step)
    ]
    return torch.stack(parts).sum()
