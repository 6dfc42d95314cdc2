"""The law of what the components leave out, learnt from training flights with the mixture's components held.

EM: the observed levels give the distribution of weights and residual numbers under each component, in closed form;
the law that is most probable given these follows by weighted least squares. How much of a flight is each component's
stays as the weights alone say. Were it asked again with the law, components that stray far would have more flights
than their means and covariances were fitted to, and samples would not be of the flights' mean.

The scales, one for each flight, follow with the rest of the law held, by EM for a scale mixture of normals: how
probable each scale is of a flight, then probabilities and, for each profile, the scales at which residual numbers vary
as these flights say. Some ten numbers, which some hundred flights know.
"""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.densities.em_steps import evenly
from descentflow.densities.mixture_parameters import Mixture, locations
from descentflow.densities.residual_law import GivenComponent, ResidualLaw, given_component
from descentflow.representation.linear_curves import Information

STEPS, TOLERANCE = 40, 1e-3
"""EM steps at most, and the mean gain (nats per flight) at which they end: the law has some hundred numbers, all of
which a thousand flights know to a nat in all."""
PRIOR_FLIGHTS = 5.0
"""Flights of the spread of all components that each begins with, and of one scale and first probabilities for all."""
RIDGE = 10.0
"""Precision of the prior of offsets and slopes, normal about zero: they are 0.3 or so of what all flights vary by."""
LEAST_OWN = 0.01
"""Of the variance of residual numbers, the least that weights and component do not say."""
LEAST_SHARE = 1e-4
"""Least probability of a component for a flight to contribute to its law."""
MOST_FLIGHTS = 1_500
"""Flights that teach the law at most, of the training flights evenly: of its some hundred numbers each is then known to
a few hundredths, and the time for 41,000 flights would be minutes."""
FIRST_SCALES, FIRST_PROBS = (0.5, 1.0, 2.0), (0.5, 0.4, 0.1)
"""From which EM of the scales starts: most flights stray little, a few far. A fourth scale gains 0.01 nats a flight of
1.5 or so that three gain, two 0.05 to 0.2 less than three (A388, E170, A319)."""
MOST_OF_SCALES = 500
"""Flights that teach the scales at most, evenly of those that teach the law."""
SCALE_STEPS, SCALE_TOLERANCE = 40, 2e-3
"""EM steps of the scales at most, and the mean gain (nats per flight) at which they end."""
LEAST_OF_SCALES = 1e-3
"""Least probability of a component for a flight to contribute to the scales."""


@dataclass(frozen=True)
class _Sums:
    """Over flights, by component, with x = (1, w): of x x' (k, d + 1, d + 1), x r' (k, d + 1, R), r^2 (k, R)."""

    design: Tensor
    cross: Tensor
    square: Tensor


def learn_residual_law(
    information: Information,
    groups: Tensor,
    mixture: Mixture,
    shares: Tensor,
    context: Tensor | None = None,
) -> ResidualLaw:
    """Learn the law.

    Args:
        information: Of n training flights, about weights and residual numbers.
        groups: (R,) which profile a residual number is of; a component has one spread for each.
        mixture: Of the weights, as it is: k components of d.
        shares: (n, k) how probable it is that a flight is of a component.
        context: (n, c) where the mixture follows one.

    Example:
        >>> w, white = torch.randn(400, 1).double(), torch.randn(400, 1).double()
        >>> seen = torch.cat([w, 0.8 * w + 0.6 * white], 1)  # to within 0.01
        >>> exact = Information(1e4 * torch.eye(2).double()[None], 1e4 * seen, torch.zeros(400, dtype=torch.long))
        >>> one = Mixture(torch.ones(1).double(), torch.zeros(1, 1).double(), torch.ones(1, 1, 1).double())
        >>> law = learn_residual_law(exact, torch.tensor([0]), one, torch.ones(400, 1).double())
        >>> round(float(law.slope), 1), round(float(law.spread), 1)
        (0.8, 0.6)
    """
    found = _most_probable(information, groups, mixture, shares, context)
    found = learn_residual_scales(information, groups, mixture, shares, found, context)
    return _of_unit_variance(found, groups, mixture, shares, context)


def _most_probable(
    information: Information,
    groups: Tensor,
    mixture: Mixture,
    shares: Tensor,
    context: Tensor | None,
) -> ResidualLaw:
    reached = -torch.inf
    law = ResidualLaw.standard(mixture.n_components, len(groups), mixture.locs.shape[1])
    for _ in range(STEPS):
        log_density, sums = _expectation(information, mixture, law, shares, context)
        value = float((shares * log_density).sum(1).mean())
        if value < reached + TOLERANCE:
            break
        reached, law = value, _maximised(sums, law, groups)
    return law


def _of_unit_variance(
    law: ResidualLaw, groups: Tensor, mixture: Mixture, shares: Tensor, context: Tensor | None
) -> ResidualLaw:
    """The law with spreads of the same ratios by which the residual numbers of a profile have unit variance in all.

    That is what they have by the probabilistic PCA that they are of. EM alone finds less: levels whose noise is alike
    are counted as one, which makes noise of what flights show beyond their components.
    """
    share = shares / shares.sum()  # (n, k)
    of_component = share.sum(0)
    means = law.offset + locations(mixture, context) @ law.slope.T  # (1, k, R), or (n, k, R) with a context
    mean = (share[..., None] * means).sum((0, 1))
    explained = (share[..., None] * (means - mean).square()).sum((0, 1))
    roots = law.slope @ mixture.scale_trils  # (k, R, d)
    explained = explained + torch.einsum("k,krd->r", of_component, roots.square())
    own = of_component @ law.spread.square()  # of scales of mean square one
    spread = law.spread.clone()
    for one in groups.unique().tolist():  # type: ignore[no-untyped-call]
        mine = groups == one
        spread[:, mine] *= ((1 - explained[mine].mean()).clamp(min=LEAST_OWN) / own[mine].mean()).sqrt()
    return replace(law, spread=spread)


def _expectation(
    information: Information, mixture: Mixture, law: ResidualLaw, shares: Tensor, context: Tensor | None
) -> tuple[Tensor, _Sums]:
    """Log probability (n, k) of each flight under each of its possible components, and the sums for the next law."""
    d = mixture.locs.shape[1]
    log_density, parts = torch.zeros_like(shares), []
    for k in range(mixture.n_components):
        # A flight is of a few components, and of many components most flights are of others.
        mine = shares[:, k] > LEAST_SHARE
        found = given_component(information, mixture, law, k, mine, context)
        log_density[mine, k] = found.log_density
        parts.append(_sums(shares[mine, k], found, d))
    return log_density, _Sums(*(torch.stack(part) for part in zip(*parts, strict=True)))


def _sums(share: Tensor, given: GivenComponent, d: int) -> tuple[Tensor, Tensor, Tensor]:
    """Of one component, what :class:`_Sums` has of all."""
    mean, of_group = given.mean, share.new_zeros(len(given.factor)).index_add_(0, given.group, share)
    spread = torch.einsum("u,uij->ij", of_group, torch.cholesky_inverse(given.factor))
    whole = (mean * share[:, None]).T @ mean + spread
    one = share @ mean
    design = torch.cat([torch.cat([share.sum()[None], one[:d]])[None], torch.cat([one[:d, None], whole[:d, :d]], 1)])
    return design, torch.cat([one[None, d:], whole[:d, d:]]), whole.diagonal()[d:]


def _maximised(sums: _Sums, law: ResidualLaw, groups: Tensor) -> ResidualLaw:
    """The law of greatest likelihood: offsets and slope given the spreads, then the spreads."""
    k = len(sums.design)
    precise = law.spread.T**-2  # (R, k)
    n, at, of = sums.design[:, 0, 0], sums.design[:, 0, 1:], sums.design[:, 1:, 1:]
    # One system for each residual number: k offsets, then the slopes that all components share.
    across = precise[:, :, None] * at
    shared = torch.einsum("rk,kij->rij", precise, of)
    whole = torch.cat([torch.cat([torch.diag_embed(precise * n), across], 2), torch.cat([across.mT, shared], 2)], 1)
    right = torch.cat([precise * sums.cross[:, 0].T, torch.einsum("rk,kir->ri", precise, sums.cross[:, 1:])], 1)
    found = torch.linalg.solve(whole + RIDGE * torch.eye(whole.shape[1]).to(whole), right)
    offset, slope = found[:, :k].T, found[:, k:]
    lines = torch.cat([offset[:, :, None], slope.expand(k, -1, -1)], 2)  # (k, R, d + 1)
    left = (
        sums.square
        - 2 * torch.einsum("kri,kir->kr", lines, sums.cross)
        + torch.einsum("kri,kij,krj->kr", lines, sums.design, lines)
    ).clamp(min=0.0)
    spread = torch.ones_like(law.spread)
    for one in groups.unique().tolist():  # type: ignore[no-untyped-call]
        mine = groups == one
        own, every = left[:, mine].mean(1), left[:, mine].mean(1).sum() / n.sum()
        spread[:, mine] = ((own + PRIOR_FLIGHTS * every) / (n + PRIOR_FLIGHTS)).sqrt()[:, None]
    # Contiguous, as a law that is read again: products of another layout round otherwise.
    return ResidualLaw.of_one_scale(offset.contiguous(), slope.contiguous(), spread)


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
    chosen = evenly(len(shares), MOST_OF_SCALES)
    some = Information(information.precisions, information.shift[chosen], information.group[chosen])
    shares, context = shares[chosen], None if context is None else context[chosen]
    scales = law.spread.new_tensor(FIRST_SCALES)[:, None].expand(-1, len(groups))
    found = replace(law, scales=scales, scale_probs=law.spread.new_tensor(FIRST_PROBS))
    reached = -torch.inf
    for _ in range(SCALE_STEPS):
        value, improved = _scale_step(some, groups, mixture, shares, found, context)
        if value < reached + SCALE_TOLERANCE:
            break
        reached, found = value, improved
    whole = (found.scale_probs @ found.scales.square()).sqrt()
    return replace(found, scales=found.scales / whole, spread=found.spread * whole)


def _scale_step(
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
    log_density = torch.full((*shares.shape, n_scales), -torch.inf, dtype=shares.dtype)
    squares = shares.new_zeros(*log_density.shape, profiles.shape[1])
    for k in range(mixture.n_components):
        mine = shares[:, k] > LEAST_OF_SCALES
        for scale in range(n_scales):
            given = given_component(information, mixture, law, k, mine, context, scale)
            log_density[mine, k, scale] = given.log_density
            squares[mine, k, scale] = _squares(given, law, k) @ (profiles / profiles.sum(0))
    joint = log_density + (shares[:, :, None] * law.scale_probs).log()
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
