"""Profiles with gaps, made ready for probabilistic PCA by EM."""

import torch
from torch import Tensor

from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.judged_by_others import roughness_and_length
from descentflow.representation.fpca.roughness import smoothed

MAX_ITERATIONS = 100
"""Bound on the iterations of EM. Components of CAS take all of them, and would go on growing at levels that few flights
show: of 4,102 B738 flights, the model's variance at the top is 1.6 times that of the values shown there, and 3.1 times
after ten times as many iterations, which miss levels that are hidden from other flights by more."""
TOLERANCE = 1e-5
"""EM stops when the mean log-likelihood per observed value gains less (nats)."""


class GappyProfiles:
    """Profiles centred by the mean of what is observed at each level, and divided by their spread.

    Example:
        >>> curves = torch.randn(200, 1).double() + 0.1 * torch.randn(200, 20).double()
        >>> flights = GappyProfiles(curves, torch.arange(20) < torch.randint(10, 25, (200, 1)))
        >>> round(float(flights.model(1).noise_variance * flights.scale**2), 2)
        0.01
    """

    def __init__(self, values: Tensor, mask: Tensor) -> None:
        """Centre and divide.

        Args:
            values: (n, L) float64, zero where missing.
            mask: (n, L) observed.
        """
        self.values, self.mask = values, mask
        self.largest = values.abs().amax()
        self.mean = ppca.observed_mean(values, mask)
        self.centred = torch.where(mask, values - self.mean, 0.0)
        self.scale = torch.linalg.vector_norm(self.centred) / mask.count_nonzero().sqrt()
        # Of flights that are all alike rounding is left, or nothing.
        self.centred /= self.scale.clamp(min=1e-300)

    def model(self, q: int) -> ppca.PPCA:
        """Probabilistic PCA with q latent dimensions."""
        return _by_em(self.centred, self.mask, q)

    def learnt(self, q: int) -> tuple[float, float]:
        """Weight of the prior against roughness, and length of the noise."""
        return roughness_and_length(
            self.centred,
            self.mask,
            self.mean / self.scale,
            lambda some, seen: _by_em(some, seen, min(q, len(some) - 1)),
        )

    def smoothed(self, fitted: ppca.PPCA, weight: float) -> ppca.PPCA:
        """A model under the prior against roughness."""
        return smoothed(fitted, weight, self.centred, self.mask, self.mean / self.scale)


def _by_em(centred: Tensor, mask: Tensor, q: int) -> ppca.PPCA:
    return ppca.em(centred, mask, q, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE)
