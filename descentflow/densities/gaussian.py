"""Densities that map standard normals to weights, and the simplest of them: one Gaussian.

Its mean is linear in the context if there is one (paper, section 2.3 and appendix C).
"""

from abc import abstractmethod
from math import log, pi
from typing import Any

import torch
from torch import Tensor, nn

from descentflow.densities.density import Density
from descentflow.densities.importance import widened
from descentflow.densities.mixture_parameters import Mixture


class TransformedDensity(Density):
    """``log p(w | c) = log p(u) + log |det du/dw|``, with u standard normal.

    Example:
        >>> from descentflow.densities.gaussian import GaussianDensity
        >>> density: TransformedDensity = GaussianDensity(dimension=2)
        >>> density.of_white(torch.zeros(1, 2), torch.zeros(1, 0)).tolist()
        [[0.0, 0.0]]
    """

    @abstractmethod
    def of_white(self, white: Tensor, context: Tensor) -> Tensor:
        """Weights (n, d) of normals (n, d), at contexts (n, c)."""

    @abstractmethod
    def to_white(self, weights: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
        """Normals (n, d) of weights (n, d), and the log-determinant (n,) of that map."""

    @property
    @abstractmethod
    def white_dtype(self) -> torch.dtype:
        """Precision in which normals are drawn."""

    def settings(self) -> dict[str, Any]:
        """Numbers of context, if there are any."""
        return {"n_context": self.n_context} if self.n_context else {}

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats, at context (n, c) if it takes one."""
        white, log_det = self.to_white(weights, self.rows_of_context(context, self.n_flights(weights)))
        return standard_normal(white) + log_det

    def draw(self, n: int, generator: torch.Generator, context: Tensor | None = None) -> Tensor:
        """Draw (n, d); a draw that is not finite is left for the sampler to count."""
        white = torch.randn(n, self.dimension, generator=generator, dtype=self.white_dtype, device=self.device)
        return self.of_white(white, self.rows_of_context(context, n))


def standard_normal(white: Tensor) -> Tensor:
    """Log density (n,) of standard normals (n, d).

    Example:
        >>> round(float(standard_normal(torch.zeros(1, 2))), 4)  # -log(2 pi)
        -1.8379
    """
    return -0.5 * white.square().sum(1) - 0.5 * white.shape[1] * log(2 * pi)


class GaussianDensity(TransformedDensity):
    """``w = loc + slope c + scale_tril u``, a standard normal until it is fitted.

    Example:
        >>> density = GaussianDensity(dimension=2)
        >>> round(density.log_prob(torch.zeros(1, 2)).exp().item(), 4)  # 1 / (2 pi)
        0.1592
    """

    def __init__(self, dimension: int, n_context: int = 0) -> None:
        """A standard normal of d weights.

        Args:
            dimension: Number of weights d.
            n_context: Numbers of context c.
        """
        super().__init__(dimension, n_context)
        self.loc = nn.Parameter(torch.zeros(dimension, dtype=torch.float64))
        self.scale_tril = nn.Parameter(torch.eye(dimension, dtype=torch.float64))
        if n_context:
            self.slope = nn.Parameter(torch.zeros(dimension, n_context, dtype=torch.float64))

        else:
            self.register_buffer("slope", torch.zeros(dimension, 0, dtype=torch.float64), persistent=False)

    @property
    def mixture(self) -> Mixture:
        """The density as a mixture of one."""
        one, gate = self.loc.new_ones(1), self.loc.new_zeros(1, self.n_context)
        return Mixture(one, self.loc[None], self.scale_tril[None], self.slope[None], gate)

    @mixture.setter
    @torch.no_grad()
    def mixture(self, mixture: Mixture) -> None:
        self.loc.copy_(mixture.locs[0])
        self.scale_tril.copy_(mixture.scale_trils[0])
        self.slope.copy_(mixture.slopes[0])

    @torch.no_grad()
    def wide_gaussian(self, context: Tensor) -> Mixture:
        """The Gaussian, widened."""
        return widened(self.mixture)

    @property
    def white_dtype(self) -> torch.dtype:
        """Double precision, as the parameters."""
        return self.loc.dtype

    def of_white(self, white: Tensor, context: Tensor) -> Tensor:
        """Weights (n, d) of normals (n, d), at contexts (n, c)."""
        return self._locs(context) + (self.scale_tril @ white.to(self.loc.dtype)[..., None])[..., 0]

    def to_white(self, weights: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
        """Normals (n, d) of weights (n, d), and the log-determinant (n,) of that map."""
        off = weights.to(self.loc.dtype) - self._locs(context)
        white = torch.linalg.solve_triangular(self.scale_tril, off.T, upper=False).T
        return white, -self.scale_tril.diagonal().log().sum().expand(len(weights))

    def _locs(self, context: Tensor) -> Tensor:
        return self.loc + context.to(self.loc.dtype) @ self.slope.T
