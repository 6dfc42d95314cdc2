"""Evidence of observed levels on flights' weights, which every density is fitted to and scored by.

A flight shows some levels only. It does not have weights, then, but a likelihood of them, which is Gaussian because
profiles are linear in the weights (paper, equation 4); :mod:`~descentflow.representation.linear_curves` computes it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import log, pi

import torch
from torch import Tensor

LEAST_PRECISION = 1e-9
"""Precision below which a direction counts as not seen; the weights have unit variance."""
CHUNK = 2048
"""Flights whose d x d posteriors are held at once."""
BLOCK, ROW = 512, 128
"""Places of a :class:`Block`, which then stays in the processor's cache, and of a row of it."""


@dataclass(frozen=True)
class Block:
    """Flights that share few matrices, as rows of one matrix each: then a matrix is multiplied by all of its flights.

    Attributes:
        index: (r, m) which flights; a place that is not taken repeats the row's first one.
        taken: (r, m) 1 or 0.
        points: (r, m, d), as in :class:`Evidence`.
        shift: (r, m, d) precision times point.
        precisions: (r, d, d).
        log_scale: (r,), as in :class:`Evidence`.
    """

    index: Tensor
    taken: Tensor
    points: Tensor
    shift: Tensor
    precisions: Tensor
    log_scale: Tensor


# Lightning's precision of 64 bits copies a batch field by field, which a frozen class does not let it.
@dataclass(eq=False)
class Evidence:
    r"""Log-likelihood of the weights w of n flights, each up to a constant: $-(w - p_i)^T A_i (w - p_i) / 2$.

    Flights that observe the same levels have the same $A_i$, which is held once. Where nothing is missing, and where
    the components have no model of what they leave out, the weights are *known*: there is no matrix at all.

    Attributes:
        points: (n, d) weights of greatest likelihood, of all such the shortest; the weights themselves if known.
        group: (n,) which of the matrices is the flight's.
        precisions: (U, d, d) matrices $A$; U = 0 if the weights are known.

    Example:
        >>> evidence = Evidence.of_weights(torch.randn(10, 3))
        >>> len(evidence), evidence.known, evidence.rows(torch.tensor([0, 4])).points.shape
        (10, True, torch.Size([2, 3]))
    """

    points: Tensor
    group: Tensor
    precisions: Tensor

    @classmethod
    def of_weights(cls, weights: Tensor) -> "Evidence":
        """Evidence of flights whose weights (n, d) are known."""
        points = weights.to(torch.float64)
        d = points.shape[1]
        return cls(points, torch.zeros(len(points), dtype=torch.long, device=points.device), points.new_zeros(0, d, d))

    @classmethod
    def of_information(cls, precisions: Tensor, shift: Tensor, group: Tensor) -> "Evidence":
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

    def rows(self, index: Tensor) -> "Evidence":
        """The flights at these positions, with the matrices that they need."""
        if self.known:
            return Evidence(self.points[index], self.group[index], self.precisions)
        used, group = self.group[index].unique(return_inverse=True)  # type: ignore[no-untyped-call]
        return Evidence(self.points[index], group, self.precisions[used])

    def chunks(self, size: int = CHUNK) -> Iterator[tuple[Tensor, "Evidence"]]:
        """Positions and evidence of some flights at a time, those with the same matrix together."""
        for index in torch.split(self.group.argsort(stable=True), size):
            yield index, self.rows(index)

    def blocks(self) -> Iterator[Block]:
        """All flights, those with the same matrix in rows that are padded to a power of two.

        Example:
            >>> evidence = Evidence(torch.randn(6, 2), torch.tensor([0, 1, 0, 2, 0, 2]), torch.eye(2).expand(3, 2, 2))
            >>> [block.index.tolist() for block in evidence.blocks()]
            [[[1]], [[3, 5]], [[0, 2, 4, 0]]]
        """
        order = self.group.argsort(stable=True).cpu()
        rows: list[Tensor] = []
        for mine in torch.split(order, torch.bincount(self.group, minlength=len(self.precisions)).tolist()):
            rows += torch.split(mine, ROW)
        width_of = torch.tensor([1 << (len(row) - 1).bit_length() for row in rows])
        for width in width_of.unique().tolist():  # type: ignore[no-untyped-call]
            alike = [rows[i] for i in (width_of == width).nonzero()[:, 0].tolist()]
            for start in range(0, len(alike), max(BLOCK // width, 1)):
                yield self._block(alike[start : start + max(BLOCK // width, 1)], width)

    def _block(self, rows: list[Tensor], width: int) -> Block:
        counts = torch.tensor([len(row) for row in rows])
        places = torch.arange(width).expand(len(rows), -1)
        taken = places < counts[:, None]
        first = counts.cumsum(0) - counts
        index = torch.cat(rows)[first[:, None] + torch.where(taken, places, 0)].to(self.group.device)
        flight = index[:, 0]
        return Block(
            index, taken.to(self.points), self.points[index], self.shift[index], self.precisions[self.group[flight]],
            self.log_scale[flight],
        )  # fmt: skip

    def to(self, device: torch.device | str) -> "Evidence":
        """The same on another device (Lightning moves batches by this)."""
        return Evidence(self.points.to(device), self.group.to(device), self.precisions.to(device))


def as_evidence(weights: Tensor | Evidence) -> Evidence:
    """Evidence as it is, or that of known weights (n, d).

    Example:
        >>> as_evidence(torch.zeros(2, 3)).known
        True
    """
    return weights if isinstance(weights, Evidence) else Evidence.of_weights(weights)


def _times(matrices: Tensor, vectors: Tensor, group: Tensor) -> Tensor:
    """Each vector (n, d) times its matrix of (U, d, e)."""
    return torch.cat(
        [
            (matrices[g] @ v[:, :, None])[:, :, 0]
            for g, v in zip(torch.split(group, CHUNK), torch.split(vectors, CHUNK), strict=True)
        ]
    )
