"""Proportions of a mixture given the level of entry.

A density of weights knows nothing of where a flight enters, but flights do: the slow first stretch of a descent lies
below its own entry, and components of flights that enter low say nothing of the levels above. The gate is a mixture's
proportions by bins of the entry level, learnt with its components held.
"""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

BINS = 4
"""Bins of the entry level, of equally many flights where levels allow: an audit's choice, of its few runs the best."""
PRIOR_FLIGHTS = 5.0
"""Flights of the mixture's own proportions that each bin begins with."""
STEPS = 20
"""EM steps, of proportions alone."""


@dataclass(frozen=True)
class EntryGate:
    """Proportions of k mixture components by bins of the entry level.

    Attributes:
        edges: (b - 1,) highest entry, as an index of the grid, of each bin but the last.
        shares: (b, k).

    Example:
        >>> gate = EntryGate(torch.tensor([100]), torch.tensor([[1.0, 0.0], [0.0, 1.0]]))
        >>> gate.draw(torch.tensor([100, 101]), torch.Generator().manual_seed(0))
        tensor([0, 1])
    """

    edges: Tensor
    shares: Tensor

    def of(self, entry: Tensor) -> Tensor:
        """Proportions (n, k) of flights that enter at these levels (n,)."""
        return self.shares[torch.bucketize(entry.to(self.edges), self.edges)]

    def draw(self, entry: Tensor, generator: torch.Generator) -> Tensor:
        """Components (n,) of flights that enter at these levels (n,)."""
        return torch.multinomial(self.of(entry), 1, replacement=True, generator=generator)[:, 0]

    def check(self, n_components: int) -> None:
        """See that a gate that was read is one of so many components.

        Raises:
            ValueError: If it has other bins or components, edges out of order, or shares that are none.
        """
        if self.shares.shape != (len(self.edges) + 1, n_components):
            raise ValueError(f"shares of an entry gate of shape {tuple(self.shares.shape)}")
        if bool((self.edges.diff() <= 0).any()) or not bool((self.shares >= 0).all() & self.shares.isfinite().all()):
            raise ValueError("edges or shares of an entry gate that are none")
        if not torch.allclose(self.shares.sum(1), self.shares.new_ones(()), atol=1e-4):
            raise ValueError("shares of an entry gate that do not sum to 1")

    def to_state(self) -> dict[str, Any]:
        """Primitives from which :meth:`from_state` rebuilds it."""
        return {"edges": self.edges.tolist(), "shares": self.shares.tolist()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "EntryGate":
        """Rebuild from :meth:`to_state`."""
        return cls(torch.tensor(state["edges"], dtype=torch.long), torch.tensor(state["shares"], dtype=torch.float64))


def bin_edges(entry: Tensor) -> Tensor:
    """The highest entry level of each bin but the last, of flights that enter at these levels (n,).

    Example:
        >>> bin_edges(torch.arange(8)), bin_edges(torch.full((8,), 200))  # all alike: one bin
        (tensor([1, 3, 5]), tensor([], dtype=torch.int64))
    """
    quantiles = torch.quantile(entry.double(), torch.arange(1, BINS).double() / BINS, interpolation="lower").long()
    edges: Tensor = quantiles.unique()  # type: ignore[no-untyped-call]
    return edges[edges < entry.max()].cpu()


def learn_gate(entry: Tensor, log_likelihood: Tensor, probs: Tensor) -> EntryGate:
    """The proportions by bin under which training flights are most probable.

    Args:
        entry: (n,) entry levels, as indices of the grid.
        log_likelihood: (n, k) of what each flight shows under each component, without proportions.
        probs: (k,) the mixture's proportions, which begin.

    Example:
        >>> entry = torch.arange(200)
        >>> told = torch.where((entry < 100)[:, None], torch.tensor([0.0, -9.0]), torch.tensor([-9.0, 0.0])).double()
        >>> learn_gate(entry, told, torch.tensor([0.5, 0.5]).double()).shares[[0, 3], [0, 1]] > 0.9
        tensor([True, True])
    """
    edges = bin_edges(entry)
    bins = torch.bucketize(entry.cpu(), edges).to(probs.device)
    of_bin = torch.nn.functional.one_hot(bins, len(edges) + 1).to(probs)
    shares = probs.expand(len(edges) + 1, -1)
    for _ in range(STEPS):
        responsibilities = (log_likelihood + shares[bins].log()).softmax(1)
        counts = of_bin.T @ responsibilities + PRIOR_FLIGHTS * probs
        shares = counts / counts.sum(1, keepdim=True)
    return EntryGate(edges, shares.cpu())
