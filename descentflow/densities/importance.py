r"""Log-likelihood of what was observed, for a density without a closed form: draws of a Gaussian's posterior, weighted.

With a Gaussian g, wider than the density p, the posterior of a flight's weights is Gaussian and its marginal likelihood
$Z$ is known, so that $\log p(y) = \log Z + \log E[p(w) / g(w)]$ over that posterior. The mean of S draws is a lower
bound in expectation, and its gradient weights the draws by their share of $p / g$ (Burda, Grosse and Salakhutdinov
2016, arXiv 1509.00519).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log

import torch
from torch import Tensor

from descentflow.densities.em_steps import cholesky_or_small
from descentflow.densities.mixture_parameters import Mixture, log_observed, posteriors
from descentflow.representation.evidence import Evidence

WIDER = 1.3
"""Factor that widens a Gaussian which proposes: with a narrower one, draws in the density's tails are too few."""
LEAST_VARIANCE = 1e-12
"""Added to posterior variances of standardised weights, so that what is seen to rounding can be drawn."""


@dataclass(frozen=True)
class Proposals:
    """Weights proposed for n flights, S for each.

    Attributes:
        weights: (n, S, d) drawn from the Gaussian's posterior.
        log_offset: (n, S) log of Z over g: added to the log density, the mean over draws estimates the likelihood.

    Example:
        >>> Proposals(torch.zeros(2, 5, 3), torch.zeros(2, 5)).weights.shape
        torch.Size([2, 5, 3])
    """

    weights: Tensor
    log_offset: Tensor


@dataclass(frozen=True)
class Estimate:
    """Log-likelihood (n,) of each flight, and the effective share (n,) of its draws, between 1 / S and 1.

    Example:
        >>> Estimate(torch.zeros(1), torch.ones(1)).effective.item()
        1.0
    """

    log_prob: Tensor
    effective: Tensor


@torch.no_grad()
def propose(
    gaussian: Mixture, evidence: Evidence, n_draws: int, context: Tensor | None = None, seed: int | None = None
) -> Proposals:
    """Draw weights of each flight given what was observed, under a Gaussian.

    Args:
        gaussian: A mixture of one.
        evidence: Of n flights whose weights are not known.
        n_draws: Draws of each flight.
        context: (n, c) where the Gaussian follows one.
        seed: Of the draws; torch's global generator if absent.

    Example:
        >>> gaussian = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> seen = Evidence(torch.tensor([[4.0]]), torch.tensor([0]), torch.tensor([[[3.0]]]))
        >>> propose(gaussian, seen, 10_000, seed=0).weights.mean().round(decimals=1)
        tensor(3.)
    """
    found = posteriors(gaussian, evidence, context)
    factor = cholesky_or_small(found.covariances[:, 0], LEAST_VARIANCE)[evidence.group]
    generator = None if seed is None else torch.Generator(found.means.device).manual_seed(seed)
    shape = (len(evidence), n_draws, found.means.shape[2])
    white = torch.randn(shape, generator=generator, dtype=found.means.dtype, device=found.means.device)
    weights = found.means + white @ factor.mT
    rows = gaussian.rows(context, len(evidence)).repeat_interleave(n_draws, 0)
    drawn = log_observed(gaussian, Evidence.of_weights(weights.flatten(0, 1)), rows)
    return Proposals(weights, found.log_joint - drawn.reshape(shape[:2]))


def estimate(log_density: Callable[[Tensor, Tensor], Tensor], proposals: Proposals, context: Tensor) -> Estimate:
    """Log-likelihood of each flight under a density.

    Args:
        log_density: Weights (m, d) and context (m, c) -> log density (m,).
        proposals: Of :func:`propose`.
        context: (n, c); c is 0 without one.

    Example:
        >>> gaussian = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> seen = Evidence(torch.tensor([[4.0]]), torch.tensor([0]), torch.tensor([[[3.0]]]))
        >>> itself = lambda weights, _: log_observed(gaussian, Evidence.of_weights(weights))
        >>> found = estimate(itself, propose(gaussian, seen, 5, seed=0), torch.zeros(1, 0))
        >>> torch.allclose(found.log_prob, log_observed(gaussian, seen)), round(float(found.effective), 6)
        (True, 1.0)
    """
    n, draws = proposals.log_offset.shape
    log_prob = log_density(proposals.weights.flatten(0, 1), context.repeat_interleave(draws, 0)).reshape(n, draws)
    # A draw at which a flow overflows has no density there.
    terms = torch.where(log_prob.isfinite(), log_prob, -torch.inf) + proposals.log_offset.to(log_prob)
    shares = terms.detach().softmax(1)
    return Estimate(terms.logsumexp(1) - log(draws), 1 / (shares.square().sum(1) * draws))


def widened(gaussian: Mixture, factor: float = WIDER) -> Mixture:
    """The same Gaussian or mixture with wider components.

    Example:
        >>> widened(Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1)), 2.0).scale_trils.item()
        2.0
    """
    return replace(gaussian, scale_trils=factor * gaussian.scale_trils)
