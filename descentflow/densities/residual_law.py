r"""Law of a flight's residual given its weights, by mixture component, with scales that differ between flights.

The directions beyond the kept components have a standard normal each over all flights. But most flights follow the
components closely and a few stray far, and drag beyond the components goes with CAS. Given weights $w$, mixture
component $k$ and a scale $j$ of the flight's own, of probability $p_j$, what is left out is therefore

$$r \mid w, k, j \sim N(a_k + B w, \operatorname{diag}(c_j^2 s_k^2)):$$

one slope for all components, an offset and a spread for each, and a scale mixture of normals (Andrews and Mallows 1974,
doi:10.1111/j.2517-6161.1974.tb00989.x) about them: a flight that strays at one level strays at others. A standard
normal is $a = B = 0$, $s = 1$ and the one scale $c = 1$.
"""

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import torch
from torch import Tensor

from descentflow.densities.mixture_parameters import Mixture, locations, log_proportions
from descentflow.representation.linear_curves import Information


@dataclass(frozen=True)
class ResidualLaw:
    """Law of R residual numbers given d weights, of k mixture components.

    Attributes:
        offset: (k, R).
        slope: (R, d).
        spread: (k, R), positive.
        scales: (J, R), positive multiples of the spread, of which one is a flight's.
        scale_probs: (J,) how probable they are.

    Example:
        >>> one = torch.ones(1, 1)
        >>> law = ResidualLaw(torch.tensor([[0.0], [9.0]]), 2 * one, torch.tensor([[0.1], [1.0]]), one, one[0])
        >>> law.of(torch.tensor([[1.0], [1.0]]), torch.tensor([[1.0], [1.0]]), torch.tensor([0, 1]))
        tensor([[ 2.1000],
                [12.0000]])
    """

    offset: Tensor
    slope: Tensor
    spread: Tensor
    scales: Tensor
    scale_probs: Tensor

    @classmethod
    def standard(cls, n_components: int, n_residual: int, n_weights: int) -> "ResidualLaw":
        """Standard normals, whatever weights and component."""
        zero = torch.zeros(n_components, n_residual, dtype=torch.float64)
        return cls.of_one_scale(zero, zero.new_zeros(n_residual, n_weights), zero + 1)

    @classmethod
    def of_one_scale(cls, offset: Tensor, slope: Tensor, spread: Tensor) -> "ResidualLaw":
        """Normals about the lines: every flight strays as its component does."""
        return cls(offset, slope, spread, torch.ones_like(spread[:1]), spread.new_ones(1))

    def first(self, n_residual: int) -> "ResidualLaw":
        """Of the first residual numbers alone."""
        n = n_residual
        parts = self.offset[:, :n], self.slope[:n], self.spread[:, :n], self.scales[:, :n]
        return ResidualLaw(*parts, self.scale_probs)

    def of(self, weights: Tensor, white: Tensor, components: Tensor, scales: Tensor | None = None) -> Tensor:
        """Residual numbers (n, R) of flights.

        Args:
            weights: (n, d).
            white: (n, r) standard normals, at most R of them: the first.
            components: (n,) of the mixture.
            scales: (n,) which scale is each flight's, see :meth:`drawn_scales`; the first if absent.
        """
        law = self.first(white.shape[1])
        mean = law.offset.to(weights)[components] + weights @ law.slope.to(weights).T
        own = law.scales.to(weights)[:1] if scales is None else law.scales.to(weights)[scales]
        return mean + law.spread.to(weights)[components] * own * white

    def drawn_scales(self, uniform: Tensor) -> Tensor:
        """Scale (n,) of each flight, by uniform numbers (n,): the inverse of the cumulative probabilities."""
        cumulative = (self.scale_probs / self.scale_probs.sum()).cumsum(0)[:-1]
        return (uniform[:, None] > cumulative.to(uniform)).sum(1)

    def by_scale(self, mixture: Mixture) -> tuple[Mixture, "ResidualLaw"]:
        """The same law of weights and residual numbers with each scale of a component as a component of its own.

        Component k and scale j become component k J + j, of a law of one scale.

        Args:
            mixture: Of the weights.

        Example:
            >>> law = ResidualLaw(*torch.ones(3, 1, 1), torch.tensor([[0.5], [2.0]]), torch.tensor([0.75, 0.25]))
            >>> both, normal = law.by_scale(Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1)))
            >>> both.probs, normal.spread.flatten()
            (tensor([0.7500, 0.2500]), tensor([0.5000, 2.0000]))
        """
        n = len(self.scale_probs)
        if n == 1 and bool((self.scales == 1).all()):
            return mixture, self
        probs = (mixture.probs[:, None] * self.scale_probs.to(mixture.probs)).flatten()
        line = (None if one is None else one.repeat_interleave(n, 0) for one in (mixture.slopes, mixture.gate))
        locs, scale_trils = (one.repeat_interleave(n, 0) for one in (mixture.locs, mixture.scale_trils))
        spread = (self.spread[:, None] * self.scales).flatten(0, 1)
        law = self.of_one_scale(self.offset.repeat_interleave(n, 0), self.slope, spread)
        return Mixture(probs, locs, scale_trils, *line), law

    def joint_means(self, locs: Tensor) -> Tensor:
        """Means (..., k, d + R) of weights and residual numbers, where those of the weights are (..., k, d)."""
        return torch.cat([locs, self.offset + locs @ self.slope.T], -1)

    def joint_precisions(self, scale_trils: Tensor) -> Tensor:
        """Precisions (k, d + R, d + R) of weights and residual numbers together, of a law of one scale.

        Args:
            scale_trils: (k, d, d) lower Cholesky factors of the weights' covariances.
        """
        own = self.spread**-2
        across = -own[:, :, None] * self.slope
        upper = torch.cat([torch.cholesky_inverse(scale_trils) - self.slope.T @ across, across.mT], 2)
        return torch.cat([upper, torch.cat([across, torch.diag_embed(own)], 2)], 1)

    def joint_roots(self, scale_trils: Tensor) -> Tensor:
        """Lower triangular roots (k, d + R, d + R) of the covariances of both together, of a law of one scale."""
        upper = torch.nn.functional.pad(scale_trils, (0, self.slope.shape[0]))
        return torch.cat([upper, torch.cat([self.slope @ scale_trils, torch.diag_embed(self.spread)], 2)], 1)

    def check(self, n_components: int, n_weights: int) -> None:
        """See that a law that was read is one of so many components and weights.

        Raises:
            ValueError: If it has other shapes, or a number that is not finite, or a negative spread.
        """
        if len(self.slope) and self.slope.shape[1:] != (n_weights,):
            raise ValueError(f"slope of a residual law of shape {tuple(self.slope.shape)}")
        n_residual = len(self.slope)
        if not self.offset.shape == self.spread.shape == (n_components, n_residual):
            raise ValueError(f"offset and spread of a residual law, of shape {tuple(self.spread.shape)}")
        if not len(self.scale_probs) or self.scales.shape != (len(self.scale_probs), n_residual):
            raise ValueError(f"scales of a residual law, of shape {tuple(self.scales.shape)}")
        if not all(bool(getattr(self, field.name).isfinite().all()) for field in fields(self)):
            raise ValueError("numbers of a residual law that are not finite")
        signed = (self.spread, self.scales, self.scale_probs)
        if not all(bool((part >= 0).all()) for part in signed) or not float(self.scale_probs.sum()) > 0:
            raise ValueError("a negative spread, scale or probability of a residual law")

    def to_state(self) -> dict[str, Any]:
        """Primitives from which :meth:`from_state` rebuilds it."""
        return {field.name: getattr(self, field.name).tolist() for field in fields(self)}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "ResidualLaw":
        """Rebuild from :meth:`to_state`; of one scale where it has none, as before there were scales."""
        known = {name: torch.tensor(value, dtype=torch.float64) for name, value in state.items()}
        return cls(**known) if "scales" in known else cls.of_one_scale(**known)


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
    log_density: Tensor = normals.log_prob(weights[:, None].to(mixture.locs))  # type: ignore[no-untyped-call]
    cumulative = (log_density + log_proportions(mixture, context)).softmax(1).cumsum(1)
    return (uniform[:, None].to(cumulative) > cumulative[:, :-1]).sum(1)


BLOCK = 2_048
"""Flights whose matrices are held at once."""


class GivenComponent(NamedTuple):
    """Of m flights under one component.

    Attributes:
        log_density: (m,) log of how probable they are (nats), up to what all components share.
        mean: (m, D) of weights and residual numbers.
        factor: (u, D, D) Cholesky factors of their precisions, of flights that show the same levels.
        group: (m,) which of these is a flight's.
    """

    log_density: Tensor
    mean: Tensor
    factor: Tensor
    group: Tensor


def given_component(
    information: Information,
    mixture: Mixture,
    law: ResidualLaw,
    k: int,
    mine: Tensor,
    context: Tensor | None = None,
    scale: int = 0,
) -> GivenComponent:
    """Condition one component on what flights show.

    Args:
        information: Of n flights, about weights and residual numbers.
        mixture: Of the weights.
        law: Of the residual numbers.
        k: Which component.
        mine: (n,) true for the m flights that are asked about.
        context: (n, c) where the mixture follows one.
        scale: Which of the law's scales.

    Example:
        >>> one = Mixture(torch.ones(1).double(), torch.zeros(1, 1).double(), torch.ones(1, 1, 1).double())
        >>> seen = Information(torch.eye(2).double()[None], torch.tensor([[2.0, 4.0]]).double(), torch.tensor([0]))
        >>> given_component(seen, one, ResidualLaw.standard(1, 1, 1), 0, torch.tensor([True])).mean.round(decimals=6)
        tensor([[1., 2.]], dtype=torch.float64)
    """
    spread = law.spread[k : k + 1] * law.scales[scale]
    one = ResidualLaw.of_one_scale(law.offset[k : k + 1], law.slope, spread)
    precision = one.joint_precisions(mixture.scale_trils[k : k + 1])[0]
    at = locations(mixture, context)[:, k : k + 1]
    means = one.joint_means(at)[:, 0].expand(len(mine), -1)[mine]
    masks, group = information.group[mine].unique(return_inverse=True)  # type: ignore[no-untyped-call]
    factor = torch.linalg.cholesky(information.precisions[masks] + precision)
    off = means @ precision
    pull = information.shift[mine] + off
    mean = _solved(factor, pull, group)
    log_det = factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)[group]
    own = mixture.scale_trils[k].diagonal().log().sum() + spread.log().sum()
    log_density = 0.5 * (mean * pull).sum(1) - 0.5 * (means * off).sum(1) - log_det - own
    return GivenComponent(log_density, mean, factor, group)


def _solved(factors: Tensor, right: Tensor, group: Tensor) -> Tensor:
    """Each right side (n, D) solved by the matrix of its group, whose Cholesky factors (U, D, D) are given."""
    covariances = torch.cholesky_inverse(factors)
    blocks = zip(torch.split(group, BLOCK), torch.split(right, BLOCK), strict=True)
    return torch.cat([(covariances[g] @ one[:, :, None])[:, :, 0] for g, one in blocks])
