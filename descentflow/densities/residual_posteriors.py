"""Posterior of weights and residual under one mixture component, in closed form."""

from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.densities.mixture_parameters import Mixture, locations
from descentflow.densities.residual_law import ResidualLaw
from descentflow.representation.linear_curves import Information

BLOCK = 2_048
"""Flights whose matrices are held at once."""


class GivenComponent(NamedTuple):
    """Of m flights under one component.

    Attributes:
        told: (m,) log of how probable they are (nats), up to what all components share.
        mean: (m, D) of weights and residual numbers.
        factor: (u, D, D) Cholesky factors of their precisions, of flights that show the same levels.
        group: (m,) which of these is a flight's.
    """

    told: Tensor
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
    told = 0.5 * (mean * pull).sum(1) - 0.5 * (means * off).sum(1) - log_det - own
    return GivenComponent(told, mean, factor, group)


def _solved(factors: Tensor, right: Tensor, group: Tensor) -> Tensor:
    """Each right side (n, D) solved by the matrix of its group, whose Cholesky factors (U, D, D) are given."""
    covariances = torch.cholesky_inverse(factors)
    blocks = zip(torch.split(group, BLOCK), torch.split(right, BLOCK), strict=True)
    return torch.cat([(covariances[g] @ one[:, :, None])[:, :, 0] for g, one in blocks])
