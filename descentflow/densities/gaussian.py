"""One Gaussian over the weights (paper, section 2.3 and appendix C), its mean linear in the context if there is one."""

from typing import Any

import torch
from torch import Tensor, nn

from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import Mixture


class GaussianDensity(Density):
    """``log p(w | c) = log N(w; loc + slope c, scale_tril scale_tril')``, a standard normal until it is fitted.

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

    def settings(self) -> dict[str, Any]:
        """Numbers of context, if there are any."""
        return {"n_context": self.n_context} if self.n_context else {}

    @property
    def mixture(self) -> Mixture:
        """The density as a mixture of one."""
        one = self.loc.new_ones(1)
        if not self.n_context:
            return Mixture(one, self.loc[None], self.scale_tril[None])
        gate = self.loc.new_zeros(1, self.n_context)
        return Mixture(one, self.loc[None], self.scale_tril[None], self.slope[None], gate)

    @mixture.setter
    @torch.no_grad()
    def mixture(self, mixture: Mixture) -> None:
        self.loc.copy_(mixture.locs[0])
        self.scale_tril.copy_(mixture.scale_trils[0])
        if mixture.slopes is not None:
            self.slope.copy_(mixture.slopes[0])

    def _locs(self, context: Tensor | None) -> Tensor:
        return self.loc if context is None else self.loc + context.to(self.loc.dtype) @ self.slope.T

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats, at context (n, c) if it takes one."""
        locs = self._locs(self.rows_of_context(context, len(weights)))
        normal = torch.distributions.MultivariateNormal(locs, scale_tril=self.scale_tril, validate_args=False)
        log_prob: Tensor = normal.log_prob(weights.to(self.loc.dtype))  # type: ignore[no-untyped-call]
        return log_prob

    def draw(self, n: int, generator: torch.Generator, context: Tensor | None = None) -> Tensor:
        """Draw (n, d)."""
        white = torch.randn(n, self.dimension, generator=generator, dtype=self.loc.dtype, device=self.loc.device)
        return self._locs(context) + (self.scale_tril @ white[..., None])[..., 0]
