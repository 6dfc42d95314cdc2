"""Densities that map standard normals to weights: one Gaussian and the flows."""

from abc import abstractmethod
from math import log, pi
from typing import Any

import torch
from torch import Tensor

from descentflow.densities.density import Density


class TransformedDensity(Density):
    """``log p(w | c) = log p(u) + log |det du/dw|``, with u standard normal.

    Example:
        >>> from descentflow.densities.gaussian import GaussianDensity
        >>> density: TransformedDensity = GaussianDensity(dimension=2)
        >>> density.of_white(torch.zeros(1, 2)).tolist()
        [[0.0, 0.0]]
    """

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
        return self.of_white(white, context)


def standard_normal(white: Tensor) -> Tensor:
    """Log density (n,) of standard normals (n, d).

    Example:
        >>> round(float(standard_normal(torch.zeros(1, 2))), 4)  # -log(2 pi)
        -1.8379
    """
    return -0.5 * white.square().sum(1) - 0.5 * white.shape[1] * log(2 * pi)
