"""One Gaussian over the weights (paper, section 2.3 and appendix C)."""

import torch
from torch import Tensor, nn

from descentflow.densities.base import Density
from descentflow.densities.em import Mixture


class GaussianDensity(Density):
    """``log p(w) = log N(w; loc, scale_tril scale_tril')``, a standard normal until it is fitted."""

    def __init__(self, dimension: int) -> None:
        """A standard normal of d weights."""
        super().__init__(dimension)
        self.loc = nn.Parameter(torch.zeros(dimension, dtype=torch.float64))
        self.scale_tril = nn.Parameter(torch.eye(dimension, dtype=torch.float64))

    @property
    def distribution(self) -> torch.distributions.MultivariateNormal:
        """The density as a torch distribution."""
        return torch.distributions.MultivariateNormal(self.loc, scale_tril=self.scale_tril, validate_args=False)

    @property
    def mixture(self) -> Mixture:
        """The density as a mixture of one."""
        return Mixture(torch.ones(1, dtype=self.loc.dtype), self.loc[None], self.scale_tril[None])

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d)."""
        log_prob: Tensor = self.distribution.log_prob(weights.to(self.loc.dtype))  # type: ignore[no-untyped-call]
        return log_prob

    def draw(self, n: int) -> Tensor:
        """Draw (n, d)."""
        return self.distribution.sample((n,))
