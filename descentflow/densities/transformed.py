"""Densities that map standard normals to weights: one Gaussian and the flows, with the normals' law by entry level."""

from abc import abstractmethod
from math import log, pi
from typing import Any

import torch
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.densities.entry_gate import EntryGate
from descentflow.densities.entry_law import EntryLaw
from descentflow.densities.weight_draws import DrawByEntry, WeightDraw


class TransformedDensity(Density):
    """``log p(w | c) = log p(u) + log |det du/dw|``, with u standard normal, or by bins of the entry level.

    Where an :class:`~descentflow.densities.entry_law.EntryLaw` was learnt, u is a mixture over its bins, and a sampler
    that knows where a flight enters draws it of its own bin.

    Example:
        >>> from descentflow.densities.gaussian import GaussianDensity
        >>> density: TransformedDensity = GaussianDensity(dimension=2)
        >>> density.of_white(torch.zeros(1, 2)).tolist(), density.entry_gate is None
        ([[0.0, 0.0]], True)
    """

    def __init__(self, dimension: int, n_context: int = 0, entry_law: dict[str, Any] | None = None) -> None:
        """Take the law of the normals.

        Args:
            dimension: Number of weights d.
            n_context: Numbers of context c.
            entry_law: State of an :class:`~descentflow.densities.entry_law.EntryLaw`; standard normals if absent.
        """
        super().__init__(dimension, n_context)
        self.entry_law = None if entry_law is None else EntryLaw.from_state(entry_law)
        if self.entry_law is not None:
            self.entry_law.check(dimension)

    @abstractmethod
    def of_white(self, white: Tensor, context: Tensor | None = None) -> Tensor:
        """Weights (n, d) of normals (n, d), at context (n, c) if it takes one."""

    @abstractmethod
    def to_white(self, weights: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Normals (n, d) of weights (n, d), and the log-determinant (n,) of that map."""

    @property
    @abstractmethod
    def white_dtype(self) -> torch.dtype:
        """Precision in which normals are drawn."""

    @property
    def entry_gate(self) -> EntryGate | None:
        """The bins of the entry level as components, see :class:`~descentflow.generation.rejection.Sampler`."""
        return None if self.entry_law is None else self.entry_law.gate

    def weight_draw(self, dtype: torch.dtype) -> WeightDraw:
        """The map, with the law of the normals by the entry level before it."""
        plain = self.white_draw(dtype)
        return plain if self.entry_law is None else DrawByEntry(plain, self.entry_law)

    def white_draw(self, dtype: torch.dtype) -> WeightDraw:
        """The map of standard normals alone as one expression, see :meth:`weight_draw`."""
        return super().weight_draw(dtype)

    def settings(self) -> dict[str, Any]:
        """Numbers of context and the law of the normals, if there are any."""
        context = {"n_context": self.n_context} if self.n_context else {}
        return context if self.entry_law is None else {**context, "entry_law": self.entry_law.to_state()}

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats, at context (n, c) if it takes one."""
        white, log_det = self.to_white(weights, self.rows_of_context(context, self.n_flights(weights)))
        return self._log_normals(white) + log_det

    def log_prob_entering(self, weights: Tensor, entry: Tensor) -> Tensor:
        """Log density (n,) of the weights (n, d) of flights that enter at levels (n,), indices of the grid.

        Example:
            >>> from descentflow.densities.gaussian import GaussianDensity
            >>> density, weights = GaussianDensity(dimension=2), torch.zeros(1, 2)  # without a law it is that of all
            >>> bool(density.log_prob_entering(weights, torch.tensor([150])) == density.log_prob(weights))
            True
        """
        white, log_det = self.to_white(weights)
        law = self.entry_law
        return (self._log_normals(white) if law is None else law.log_prob(white, law.bins(entry))) + log_det

    def _log_normals(self, white: Tensor) -> Tensor:
        if self.entry_law is not None:
            return self.entry_law.log_prob(white)
        return standard_normal(white)

    def draw(self, n: int, generator: torch.Generator, context: Tensor | None = None) -> Tensor:
        """Draw (n, d); a draw that is not finite is left for the sampler to count."""
        if self.entry_law is None:
            return self.of_white(self._white(n, generator), context)
        shares = self.entry_law.shares.to(self.device)
        bins = torch.multinomial(shares, max(n, 1), replacement=True, generator=generator)[:n]
        return self.of_white(self.entry_law.of(self._white(n, generator), bins), context)

    def _white(self, n: int, generator: torch.Generator) -> Tensor:
        return torch.randn(n, self.dimension, generator=generator, dtype=self.white_dtype, device=self.device)

    @torch.no_grad()
    def sample_of(self, components: Tensor, seed: int) -> Tensor:
        """Draw weights (n, d), each of the bin (n,) of the entry level named.

        Example:
            >>> from descentflow.densities.gaussian import GaussianDensity
            >>> shift, root = torch.tensor([[0.0], [90.0]]), torch.ones(2, 1, 1)
            >>> law = EntryLaw(torch.tensor([100]), torch.tensor([0.5, 0.5]), shift, root)
            >>> GaussianDensity(1, entry_law=law.to_state()).sample_of(torch.tensor([1, 0, 1]), seed=0)[:, 0] > 45
            tensor([ True, False,  True])
        """
        assert self.entry_law is not None
        white = self._white(len(components), torch.Generator(self.device).manual_seed(seed))
        return self.of_white(self.entry_law.of(white, components.to(self.device)))


def standard_normal(white: Tensor) -> Tensor:
    """Log density (n,) of standard normals (n, d).

    Example:
        >>> round(float(standard_normal(torch.zeros(1, 2))), 4)  # -log(2 pi)
        -1.8379
    """
    return -0.5 * white.square().sum(1) - 0.5 * white.shape[1] * log(2 * pi)
