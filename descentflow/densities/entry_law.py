r"""Law of a density's standard normals by bin of the entry level.

Over all flights the normals :math:`u` behind a Gaussian or a flow are standard. Within a bin b of the entry level they
are :math:`N(m_b, R_b R_b^T)`: the slow first stretch of a descent lies below its own entry, and flights that enter low
say nothing of the levels above. The density of all flights is that mixture over bins, pushed through the same map.
"""

from dataclasses import dataclass
from math import log, pi
from typing import Any

import torch
from torch import Tensor

from descentflow.densities.entry_gate import EntryGate


@dataclass(frozen=True)
class EntryLaw:
    """Normals of d numbers by b bins of the entry level.

    Attributes:
        edges: (b - 1,) highest entry, as an index of the grid, of each bin but the last.
        shares: (b,) of the flights.
        shift: (b, d) means.
        root: (b, d, d) lower Cholesky factors of the covariances.

    Example:
        >>> shift, root = torch.tensor([[0.0], [9.0]]).double(), torch.ones(2, 1, 1).double()
        >>> law = EntryLaw(torch.tensor([100]), torch.tensor([0.5, 0.5]).double(), shift, root)
        >>> law.of(torch.zeros(2, 1), torch.tensor([0, 1]))
        tensor([[0.],
                [9.]], dtype=torch.float64)
    """

    edges: Tensor
    shares: Tensor
    shift: Tensor
    root: Tensor

    @property
    def gate(self) -> EntryGate:
        """The bins as components of which each level of entry has one."""
        return EntryGate(self.edges, torch.eye(len(self.shares), dtype=torch.float64))

    def bins(self, entry: Tensor) -> Tensor:
        """Bins (n,) of entry levels (n,), indices of the grid."""
        return torch.bucketize(entry.to(self.edges), self.edges)

    def of(self, white: Tensor, bins: Tensor) -> Tensor:
        """The normals (n, d), float64, of flights of these bins (n,), made of standard ones (n, d)."""
        shift, root = (value.to(white.device)[bins] for value in (self.shift, self.root))
        return shift + (root @ white.double()[:, :, None])[:, :, 0]

    def log_prob(self, normals: Tensor, bins: Tensor | None = None) -> Tensor:
        """Log density (n,) at (n, d), of flights of these bins (n,) or of all flights, float64."""
        by_bin = self._log_by_bin(normals.double())
        if bins is not None:
            return by_bin.gather(1, bins.to(by_bin.device)[:, None])[:, 0]
        return (by_bin + self.shares.to(by_bin).log()).logsumexp(1)

    def _log_by_bin(self, normals: Tensor) -> Tensor:
        shift, root = self.shift.to(normals), self.root.to(normals)
        white = torch.linalg.solve_triangular(root, (normals - shift[:, None]).mT, upper=False)  # (b, d, n)
        constant = root.diagonal(dim1=1, dim2=2).log().sum(1) + 0.5 * normals.shape[1] * log(2 * pi)
        by_bin: Tensor = (-0.5 * white.square().sum(1) - constant[:, None]).T
        return by_bin

    def check(self, dimension: int) -> None:
        """See that a law that was read is one of so many numbers.

        Raises:
            ValueError: If it has other shapes, edges out of order, or values that are none.
        """
        bins = len(self.edges) + 1
        shapes = [tuple(value.shape) for value in (self.shares, self.shift, self.root)]
        if shapes != [(bins,), (bins, dimension), (bins, dimension, dimension)]:
            raise ValueError(f"an entry law of shapes {shapes}")
        finite = all(bool(value.isfinite().all()) for value in (self.shares, self.shift, self.root))
        positive = bool((self.shares > 0).all()) and bool((self.root.diagonal(dim1=1, dim2=2) > 0).all())
        if not finite or not positive or bool((self.edges.diff() <= 0).any()) or bool(self.root.triu(1).any()):
            raise ValueError("edges, shares, means or spreads of an entry law that are none")
        if not torch.allclose(self.shares.sum(), self.shares.new_ones(()), atol=1e-4):
            raise ValueError("shares of an entry law that do not sum to 1")

    def to_state(self) -> dict[str, Any]:
        """Primitives from which :meth:`from_state` rebuilds it."""
        return {name: getattr(self, name).tolist() for name in ("edges", "shares", "shift", "root")}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "EntryLaw":
        """Rebuild from :meth:`to_state`."""
        numbers = (torch.tensor(state[name], dtype=torch.float64) for name in ("shares", "shift", "root"))
        return cls(torch.tensor(state["edges"], dtype=torch.long), *numbers)
