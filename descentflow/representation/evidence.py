"""Evidence of observed levels on flights' weights, by which every density is scored.

A flight shows some levels only. It does not have weights, then, but a likelihood of them, which is Gaussian because
profiles are linear in the weights (paper, equation 4); :mod:`~descentflow.representation.linear_curves` computes it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import log, pi
from typing import Literal

import torch
from torch import Tensor

Gaps = Literal["marginal", "filled"]
"""Treatment of levels that a flight does not show: left open, or filled by their expectation."""
LEAST_PRECISION = 1e-9
"""Precision below which a direction counts as not seen; the weights have unit variance."""
FLIGHTS_AT_ONCE = 2048
"""Flights whose d x d posteriors are held at once."""


# Lightning's precision of 64 bits copies a batch field by field, which a frozen class does not let it.
@dataclass(eq=False)
class WeightEvidence:
    r"""Log-likelihood of the weights w of n flights, each up to a constant: $-(w - p_i)^T A_i (w - p_i) / 2$.

    Flights that observe the same levels have the same $A_i$, which is held once. Where nothing is missing, and where
    the components have no model of what they leave out, the weights are *known*: there is no matrix at all.

    Attributes:
        points: (n, d) weights of greatest likelihood, of all such the shortest; the weights themselves if known.
        group: (n,) which of the matrices is the flight's.
        precisions: (U, d, d) matrices $A$; U = 0 if the weights are known.

    Example:
        >>> evidence = WeightEvidence.of_weights(torch.randn(10, 3))
        >>> len(evidence), evidence.known, evidence.rows(torch.tensor([0, 4])).points.shape
        (10, True, torch.Size([2, 3]))
    """

    points: Tensor
    group: Tensor
    precisions: Tensor

    @classmethod
    def of_weights(cls, weights: Tensor) -> "WeightEvidence":
        """Evidence of flights whose weights (n, d) are known."""
        points = weights.to(torch.float64)
        d = points.shape[1]
        return cls(points, torch.zeros(len(points), dtype=torch.long, device=points.device), points.new_zeros(0, d, d))

    @classmethod
    def of_information(cls, precisions: Tensor, shift: Tensor, group: Tensor) -> "WeightEvidence":
        """Evidence of log-likelihoods ``shift' w - w' precision w / 2``.

        Args:
            precisions: (U, d, d), one for each set of observed levels.
            shift: (n, d).
            group: (n,) which precision is the flight's.
        """
        values, vectors = torch.linalg.eigh(precisions)
        seen = values > LEAST_PRECISION
        kept = torch.where(seen, values, 0.0)
        inverse = torch.where(seen, 1 / values.clamp(min=LEAST_PRECISION), 0.0)
        whole = (vectors * kept[:, None]) @ vectors.mT
        turned = _times(vectors.mT, shift, group)
        points = _times(vectors, turned * inverse[group], group)
        return cls(points, group, (whole + whole.mT) / 2)

    @property
    def known(self) -> bool:
        """True where the points are the weights themselves."""
        return len(self.precisions) == 0

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.points)

    @cached_property
    def shift(self) -> Tensor:
        """Precision times point (n, d)."""
        return _times(self.precisions, self.points, self.group)

    @cached_property
    def log_scale(self) -> Tensor:
        r"""Constant (n,) that :func:`~descentflow.densities.mixture_parameters.log_observed` adds to likelihoods.

        It makes the score of a flight seen precisely the log density of its weights, and that of a flight which shows
        nothing zero: $\frac12 \log|I + A| - \frac12 \log 2\pi \, \mathrm{tr}\, A (I + A)^{-1}$. No density changes it,
        so differences between densities are those of the log-likelihood of the observed levels.
        """
        values = torch.linalg.eigvalsh(self.precisions).clamp(min=0.0)
        by_mask: Tensor = 0.5 * values.log1p().sum(1) - 0.5 * log(2 * pi) * (values / (1 + values)).sum(1)
        of_flight: Tensor = by_mask[self.group]
        return of_flight

    def rows(self, index: Tensor) -> "WeightEvidence":
        """The flights at these positions, with the matrices that they need."""
        if self.known:
            return WeightEvidence(self.points[index], self.group[index], self.precisions)
        used, group = self.group[index].unique(return_inverse=True)  # type: ignore[no-untyped-call]
        return WeightEvidence(self.points[index], group, self.precisions[used])

    def chunks(self, size: int = FLIGHTS_AT_ONCE) -> Iterator[tuple[Tensor, "WeightEvidence"]]:
        """Positions and evidence of some flights at a time, those with the same matrix together."""
        for index in torch.split(self.group.argsort(stable=True), size):
            yield index, self.rows(index)

    def to(self, device: torch.device | str) -> "WeightEvidence":
        """The same on another device (Lightning moves batches by this)."""
        return WeightEvidence(self.points.to(device), self.group.to(device), self.precisions.to(device))


def _times(matrices: Tensor, vectors: Tensor, group: Tensor) -> Tensor:
    """Each vector (n, d) times its matrix of (U, d, e)."""
    return torch.cat(
        [
            (matrices[g] @ v[:, :, None])[:, :, 0]
            for g, v in zip(torch.split(group, FLIGHTS_AT_ONCE), torch.split(vectors, FLIGHTS_AT_ONCE), strict=True)
        ]
    )
