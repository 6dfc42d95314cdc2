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

from descentflow.densities.mixture_parameters import Mixture, cholesky_or_small, log_observed, posteriors
from descentflow.representation.evidence import WeightEvidence

WIDER = 1.3
"""Factor that widens a Gaussian which proposes: with a narrower one, draws in the density's tails are too few."""
LEAST_VARIANCE = 1e-12
"""Added to posterior variances of standardised weights, so that what is seen to rounding can be drawn."""


@dataclass(frozen=True)
class LikelihoodEstimate:
    """Log-likelihood (n,) of each flight, and the effective share (n,) of its draws, between 1 / S and 1.

    Example:
        >>> LikelihoodEstimate(torch.zeros(1), torch.ones(1)).effective.item()
        1.0
    """

    log_prob: Tensor
    effective: Tensor


def estimate(
    log_density: Callable[[Tensor, Tensor], Tensor],
    gaussian: Mixture,
    evidence: WeightEvidence,
    n_draws: int,
    context: Tensor,
    seed: int,
) -> LikelihoodEstimate:
    """Log-likelihood of each flight under a density, by draws given what was observed, under a Gaussian.

    Args:
        log_density: Weights (m, d) and context (m, c) -> log density (m,).
        gaussian: What proposes, a mixture of one.
        evidence: Of n flights whose weights are not known.
        n_draws: Draws S of each flight.
        context: (n, c); c is 0 without one.
        seed: Of the draws.

    Example:
        >>> gaussian = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> seen = WeightEvidence(torch.tensor([[4.0]]), torch.tensor([0]), torch.tensor([[[3.0]]]))
        >>> itself = lambda weights, _: log_observed(gaussian, WeightEvidence.of_weights(weights))
        >>> likelihood = estimate(itself, gaussian, seen, 5, torch.zeros(1, 0), seed=0)
        >>> torch.allclose(likelihood.log_prob, log_observed(gaussian, seen)), round(float(likelihood.effective), 6)
        (True, 1.0)
    """
    rows = context.repeat_interleave(n_draws, 0)
    with torch.no_grad():
        given_seen = posteriors(gaussian, evidence, context)
        factor = cholesky_or_small(given_seen.covariances[:, 0], LEAST_VARIANCE)[evidence.group]
        shape = (len(evidence), n_draws, given_seen.means.shape[2])
        generator = torch.Generator(given_seen.means.device).manual_seed(seed)
        white = torch.randn(shape, generator=generator, dtype=given_seen.means.dtype, device=given_seen.means.device)
        weights = (given_seen.means + white @ factor.mT).flatten(0, 1)
        proposed = log_observed(gaussian, WeightEvidence.of_weights(weights), gaussian.rows(rows, len(weights)))
        # Added to the log density, the mean over a flight's draws estimates its likelihood.
        offset = given_seen.log_joint - proposed.reshape(shape[:2])
    log_prob = log_density(weights, rows).reshape(shape[:2])
    # A draw at which a flow overflows has no density there.
    terms = torch.where(log_prob.isfinite(), log_prob, -torch.inf) + offset.to(log_prob)
    shares = terms.detach().softmax(1)
    return LikelihoodEstimate(terms.logsumexp(1) - log(n_draws), 1 / (shares.square().sum(1) * n_draws))


def widened(gaussian: Mixture, factor: float = WIDER) -> Mixture:
    """The same Gaussian or mixture with wider components.

    Example:
        >>> widened(Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1)), 2.0).scale_trils.item()
        2.0
    """
    return replace(gaussian, scale_trils=factor * gaussian.scale_trils)
