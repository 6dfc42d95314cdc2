r"""What the components leave out of a flight, given its weights: by mixture component, and not alike for all flights.

The directions beyond the kept components have a standard normal each over all flights. But most flights follow the
components closely and a few stray far, and drag beyond the components goes with CAS. Given weights $w$ and mixture
component $k$, what is left out is therefore $r \mid w, k \sim N(a_k + B w, \operatorname{diag}(s_k^2))$: one slope for
all components, an offset and a spread for each. A standard normal is $a = B = 0$, $s = 1$.
"""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.observed import locations, log_proportions


@dataclass(frozen=True)
class ResidualLaw:
    """Law of R residual numbers given d weights, of k mixture components.

    Attributes:
        offset: (k, R).
        slope: (R, d).
        spread: (k, R), positive.

    Example:
        >>> law = ResidualLaw(torch.tensor([[0.0], [9.0]]), torch.tensor([[2.0]]), torch.tensor([[0.1], [1.0]]))
        >>> law.of(torch.tensor([[1.0], [1.0]]), torch.tensor([[1.0], [1.0]]), torch.tensor([0, 1]))
        tensor([[ 2.1000],
                [12.0000]])
    """

    offset: Tensor
    slope: Tensor
    spread: Tensor

    @classmethod
    def standard(cls, n_components: int, n_residual: int, n_weights: int) -> "ResidualLaw":
        """Standard normals, whatever weights and component."""
        zero = torch.zeros(n_components, n_residual, dtype=torch.float64)
        return cls(zero, zero.new_zeros(n_residual, n_weights), zero + 1)

    def first(self, n_residual: int) -> "ResidualLaw":
        """Of the first residual numbers alone."""
        return ResidualLaw(self.offset[:, :n_residual], self.slope[:n_residual], self.spread[:, :n_residual])

    def of(self, weights: Tensor, white: Tensor, components: Tensor) -> Tensor:
        """Residual numbers (n, R) of flights.

        Args:
            weights: (n, d).
            white: (n, r) standard normals, at most R of them: the first.
            components: (n,) of the mixture.
        """
        law = self.first(white.shape[1])
        mean = law.offset.to(weights)[components] + weights @ law.slope.to(weights).T
        return mean + law.spread.to(weights)[components] * white

    def joint_means(self, locs: Tensor) -> Tensor:
        """Means (..., k, d + R) of weights and residual numbers, where those of the weights are (..., k, d)."""
        return torch.cat([locs, self.offset + locs @ self.slope.T], -1)

    def joint_precisions(self, scale_trils: Tensor) -> Tensor:
        """Precisions (k, d + R, d + R) of weights and residual numbers together.

        Args:
            scale_trils: (k, d, d) lower Cholesky factors of the weights' covariances.
        """
        own = self.spread**-2
        across = -own[:, :, None] * self.slope
        upper = torch.cat([torch.cholesky_inverse(scale_trils) - self.slope.T @ across, across.mT], 2)
        return torch.cat([upper, torch.cat([across, torch.diag_embed(own)], 2)], 1)

    def joint_roots(self, scale_trils: Tensor) -> Tensor:
        """Lower triangular roots (k, d + R, d + R) of the covariances of both together."""
        upper = torch.nn.functional.pad(scale_trils, (0, self.slope.shape[0]))
        return torch.cat([upper, torch.cat([self.slope @ scale_trils, torch.diag_embed(self.spread)], 2)], 1)

    def check(self, n_components: int, n_weights: int) -> None:
        """See that a law that was read is one of so many components and weights.

        Raises:
            ValueError: If it has other shapes, or a number that is not finite, or a negative spread.
        """
        if len(self.slope) and self.slope.shape[1:] != (n_weights,):
            raise ValueError(f"slope of a residual law of shape {tuple(self.slope.shape)}")
        if not self.offset.shape == self.spread.shape == (n_components, len(self.slope)):
            raise ValueError(f"offset and spread of a residual law, of shape {tuple(self.spread.shape)}")
        finite = all(bool(part.isfinite().all()) for part in (self.offset, self.slope, self.spread))
        if not finite or not bool((self.spread >= 0).all()):
            raise ValueError("numbers of a residual law that are not finite, or a negative spread")

    def to_state(self) -> dict[str, Any]:
        """Primitives from which :meth:`from_state` rebuilds it."""
        return {name: getattr(self, name).tolist() for name in ("offset", "slope", "spread")}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "ResidualLaw":
        """Rebuild from :meth:`to_state`."""
        return cls(*(torch.tensor(state[name], dtype=torch.float64) for name in ("offset", "slope", "spread")))


def components_given(mixture: Mixture, weights: Tensor, context: Tensor | None, uniform: Tensor) -> Tensor:
    """Mixture components (n,) of weights, drawn of what is probable given these.

    Args:
        mixture: k components.
        weights: (n, d).
        context: (n, c) where the mixture follows one.
        uniform: (n,) in [0, 1).

    Example:
        >>> two = Mixture(torch.ones(2) / 2, torch.tensor([[0.0], [90.0]]), torch.ones(2, 1, 1))
        >>> components_given(two, torch.tensor([[1.0], [89.0]]), None, torch.tensor([0.5, 0.5]))
        tensor([0, 1])
    """
    normals = torch.distributions.MultivariateNormal(
        locations(mixture, context), scale_tril=mixture.scale_trils, validate_args=False
    )
    told: Tensor = normals.log_prob(weights[:, None].to(mixture.locs))  # type: ignore[no-untyped-call]
    cumulative = (told + log_proportions(mixture, context)).softmax(1).cumsum(1)
    return (uniform[:, None].to(cumulative) > cumulative[:, :-1]).sum(1)
