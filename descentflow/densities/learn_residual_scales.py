"""Scales of the residual, one for each flight, learnt with the rest of the law held.

EM for a scale mixture of normals: how probable each scale is of a flight, then probabilities and, for each profile, the
scales at which residual numbers vary as these flights say. Some ten numbers, which some hundred flights know.
"""

from dataclasses import replace

import torch
from torch import Tensor

from descentflow.densities.em_steps import evenly
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.residual_law import GivenComponent, ResidualLaw, given_component
from descentflow.representation.linear_curves import Information

FIRST_SCALES, FIRST_PROBS = (0.5, 1.0, 2.0), (0.5, 0.4, 0.1)
"""From which EM starts: most flights stray little, a few far. A fourth scale gains 0.01 nats a flight of 1.5 or so that
three gain, two 0.05 to 0.2 less than three (A388, E170, A319)."""
MOST_FLIGHTS = 500
"""Flights that teach the scales at most, evenly of those that teach the law."""
STEPS, TOLERANCE = 40, 2e-3
"""EM steps at most, and the mean gain (nats per flight) at which they end."""
PRIOR_FLIGHTS = 5.0
"""Flights of the one scale of all with which each scale begins, and of the first probabilities."""
LEAST_SHARE = 1e-3
"""Least probability of a component for a flight to contribute to the scales."""


def learn_residual_scales(
    information: Information,
    groups: Tensor,
    mixture: Mixture,
    shares: Tensor,
    law: ResidualLaw,
    context: Tensor | None = None,
) -> ResidualLaw:
    """Give a law of one scale the scales that flights are most probable by, of mean square one.

    Args:
        information: Of n training flights, about weights and residual numbers.
        groups: (R,) which profile a residual number is of; each has scales of its own, which go together.
        mixture: Of the weights.
        shares: (n, k) how probable it is that a flight is of a component.
        law: Of one scale.
        context: (n, c) where the mixture follows one.

    Example:
        >>> calm, wild = 0.4 * torch.randn(300, 8).double(), 2.0 * torch.randn(100, 8).double()
        >>> seen = torch.cat([torch.zeros(400, 1).double(), torch.cat([calm, wild])], 1)  # to within 0.01
        >>> exact = Information(1e4 * torch.eye(9).double()[None], 1e4 * seen, torch.zeros(400, dtype=torch.long))
        >>> one = Mixture(torch.ones(1).double(), torch.zeros(1, 1).double(), torch.ones(1, 1, 1).double())
        >>> every, plain = torch.ones(400, 1).double(), ResidualLaw.standard(1, 8, 1)
        >>> found = learn_residual_scales(exact, torch.zeros(8).long(), one, every, plain)
        >>> found.scales.shape, round(float(found.scales.max() / found.scales.min()))
        (torch.Size([3, 8]), 5)
    """
    chosen = evenly(len(shares), MOST_FLIGHTS)
    some = Information(information.precisions, information.shift[chosen], information.group[chosen])
    shares, context = shares[chosen], None if context is None else context[chosen]
    scales = law.spread.new_tensor(FIRST_SCALES)[:, None].expand(-1, len(groups))
    found = replace(law, scales=scales, scale_probs=law.spread.new_tensor(FIRST_PROBS))
    reached = -torch.inf
    for _ in range(STEPS):
        value, improved = _step(some, groups, mixture, shares, found, context)
        if value < reached + TOLERANCE:
            break
        reached, found = value, improved
    whole = (found.scale_probs @ found.scales.square()).sqrt()
    return replace(found, scales=found.scales / whole, spread=found.spread * whole)


def _step(
    information: Information,
    groups: Tensor,
    mixture: Mixture,
    shares: Tensor,
    law: ResidualLaw,
    context: Tensor | None,
) -> tuple[float, ResidualLaw]:
    """Log probability of flights by the law (nats per flight), and the law with scales after one step of EM.

    Unlike for the rest of the law, a flight's component is asked again with what it leaves out: one that strays as a
    wide component's flights do would else seem to be a far stray of a narrow component.
    """
    n_scales, (_, of_profile) = len(law.scale_probs), groups.unique(return_inverse=True)  # type: ignore[no-untyped-call]
    profiles = torch.nn.functional.one_hot(of_profile).to(law.spread)  # (R, G)
    told = torch.full((*shares.shape, n_scales), -torch.inf, dtype=shares.dtype)
    squares = shares.new_zeros(*told.shape, profiles.shape[1])
    for k in range(mixture.n_components):
        mine = shares[:, k] > LEAST_SHARE
        for scale in range(n_scales):
            given = given_component(information, mixture, law, k, mine, context, scale)
            told[mine, k, scale] = given.told
            squares[mine, k, scale] = _squares(given, law, k) @ (profiles / profiles.sum(0))
    joint = told + (shares[:, :, None] * law.scale_probs).log()
    total = joint.flatten(1).logsumexp(1)
    share = (joint - total[:, None, None]).exp()
    counts = share.sum((0, 1))
    own = torch.einsum("nkj,nkjg->jg", share, squares)
    scales = ((own + PRIOR_FLIGHTS) / (counts + PRIOR_FLIGHTS)[:, None]).sqrt() @ profiles.T
    probs = counts + PRIOR_FLIGHTS * counts.new_tensor(FIRST_PROBS)
    return float(total.mean()), replace(law, scales=scales, scale_probs=probs / probs.sum())


def _squares(given: GivenComponent, law: ResidualLaw, k: int) -> Tensor:
    """Squares (m, R) by which residual numbers are expected to be off, in squared spreads of component k."""
    d = law.slope.shape[1]
    off = given.mean[:, d:] - law.offset[k] - given.mean[:, :d] @ law.slope.T
    line = torch.cat([-law.slope, torch.eye(len(law.slope)).to(law.slope)], 1)
    open_yet = ((line @ torch.cholesky_inverse(given.factor)) * line).sum(2)
    return (off.square() + open_yet[given.group]) / law.spread[k].square()
