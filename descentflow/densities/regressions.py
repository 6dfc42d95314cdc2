"""Mixtures of linear regressions of the weights on a context, by expectation maximisation.

``p(w | c) = sum_k pi_k(c) N(w; loc_k + slope_k c, S_k)`` with ``pi(c) = softmax(logit + gate c)`` (Jacobs et al. 1991,
doi:10.1162/neco.1991.3.1.79). The conditional of a joint mixture over weights and context has the same clusters, but it
spends them on the shape of the context, which nobody asks it to generate, and has no density for a 0/1 column; here the
likelihood of the weights alone decides, and without slopes the model is the plain mixture.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from descentflow.densities.em import (
    FEWEST_PER_PARAMETER,
    FINALISTS,
    FLIGHTS_PER_PARAMETER,
    JITTER,
    SCREENING_ITERATIONS,
    Mixture,
    by_bic,
    k_means_labels,
)
from descentflow.densities.em import n_parameters as n_plain

RIDGE = 1.0
"""Flights at one standard deviation of context that slopes of zero are worth: few, but enough for a cluster of few."""
GATE_STEPS = 5
"""Steps of the gate within one M step; each raises its likelihood (Boehning 1992, doi:10.1007/BF00048682)."""


@dataclass(frozen=True)
class Regressions:
    """Clusters: logits (k,), gate (k, c), locs (k, d), slopes (k, d, c) and lower Cholesky factors (k, d, d)."""

    logits: Tensor
    gate: Tensor
    locs: Tensor
    slopes: Tensor
    scale_trils: Tensor

    def given(self, context: Tensor) -> Mixture:
        """The mixture given one context (c,)."""
        probs = (self.logits + self.gate @ context).softmax(0)
        return Mixture(probs, self.locs + self.slopes @ context, self.scale_trils)


@dataclass(frozen=True)
class RegressionSelection:
    """The mixture chosen by BIC, the BIC of every number of clusters tried, and whether the cap decided."""

    mixture: Regressions
    bic: dict[int, float]
    cap_binds: bool


def n_parameters(n_clusters: int, dimension: int, n_context: int) -> int:
    """Free parameters: those of the plain mixture, and slopes of means and gate."""
    return n_plain(n_clusters, dimension) + n_context * (n_clusters * dimension + n_clusters - 1)


def most_clusters(
    n_train: int, dimension: int, n_context: int, flights_per_parameter: float = FLIGHTS_PER_PARAMETER
) -> int:
    """Largest number of clusters with 15 training flights a parameter; one at the least (paper, appendix C)."""
    k = 1
    while flights_per_parameter * n_parameters(k + 1, dimension, n_context) <= n_train:
        k += 1
    return k


def expectation(weights: Tensor, context: Tensor, mixture: Regressions) -> tuple[Tensor, Tensor]:
    """Responsibilities (n, k) and the mean log-likelihood of weights (n, d) given context (n, c), nats a flight."""
    gate = (mixture.logits + context @ mixture.gate.T).log_softmax(1)
    by_cluster = []
    for k in range(len(mixture.logits)):
        normal = torch.distributions.MultivariateNormal(
            mixture.locs[k] + context @ mixture.slopes[k].T, scale_tril=mixture.scale_trils[k], validate_args=False
        )
        by_cluster.append(normal.log_prob(weights))  # type: ignore[no-untyped-call]
    joint = gate + torch.stack(by_cluster, 1)
    total = joint.logsumexp(1)
    return (joint - total[:, None]).exp(), total.mean()


def maximisation(weights: Tensor, context: Tensor, responsibilities: Tensor, before: Regressions | None) -> Regressions:
    """Ridge regression of each cluster in closed form, and some steps of the gate from where it was."""
    locs, slopes, factors = zip(*(regression(weights, context, r) for r in responsibilities.unbind(1)), strict=True)
    logits, gate = _gate(context, responsibilities, before)
    return Regressions(logits, gate, torch.stack(locs), torch.stack(slopes), torch.stack(factors))


def regression(
    weights: Tensor, context: Tensor, share: Tensor, ridge: float = RIDGE, jitter: float = JITTER
) -> tuple[Tensor, Tensor, Tensor]:
    """Weighted ridge regression of the weights on the context.

    Args:
        weights: (n, d), float64.
        context: (n, c), float64.
        share: (n,) weight of each flight.
        ridge: Flights that slopes of zero are worth.
        jitter: Added to the variances.

    Returns:
        loc (d,), slope (d, c) and the lower Cholesky factor (d, d) of the residuals' covariance.
    """
    count = share.sum().clamp(min=1e-9)
    mean_w, mean_c = share @ weights / count, share @ context / count
    w, c = weights - mean_w, context - mean_c
    shared = share[:, None] * c
    inner = shared.T @ c + ridge * torch.eye(c.shape[1]).to(c)
    slope = torch.linalg.solve(inner, shared.T @ w).T
    residual = w - c @ slope.T
    covariance = (share[:, None] * residual).T @ residual / count
    eye = torch.eye(w.shape[1]).to(w)
    factor, failed = torch.linalg.cholesky_ex(covariance + jitter * eye)
    # A cluster that has lost its flights becomes round and small instead of stopping the fit.
    factor = torch.where(failed > 0, jitter**0.5 * eye, factor)
    return mean_w - slope @ mean_c, slope, factor


def _gate(context: Tensor, responsibilities: Tensor, before: Regressions | None) -> tuple[Tensor, Tensor]:
    """Logits (k,) and gate (k, c) of a multinomial regression on responsibilities, by bounded Newton steps."""
    design = torch.cat([torch.ones_like(context[:, :1]), context], 1)
    penalty = RIDGE * torch.eye(design.shape[1]).to(design)
    penalty[0, 0] = JITTER  # the intercept is free
    factor = torch.linalg.cholesky(design.T @ design / 2 + penalty)
    if before is None:
        logits = (responsibilities.mean(0) + 1e-12).log()
        table = torch.cat([logits[:, None], torch.zeros(len(logits), context.shape[1]).to(logits)], 1).T
    else:
        table = torch.cat([before.logits[:, None], before.gate], 1).T
    for _ in range(GATE_STEPS):
        gradient = design.T @ (responsibilities - (design @ table).softmax(1)) - penalty @ table
        table = table + torch.cholesky_solve(gradient, factor)
    table = table - table.mean(1, keepdim=True)  # softmax knows differences only
    return table[0].clone(), table[1:].T.clone()


def start(weights: Tensor, context: Tensor, n_clusters: int, seed: int) -> Regressions:
    """A first mixture from k-means: of the weights, or, every other pair of seeds, of what the context leaves open."""
    loc, slope, _ = regression(weights, context, torch.ones_like(weights[:, 0]))
    target = weights - loc - context @ slope.T if seed // 2 % 2 else weights
    labels = k_means_labels(target, n_clusters, seed)
    hot = torch.nn.functional.one_hot(labels, n_clusters).to(torch.float64)
    return maximisation(weights, context, hot, None)


def converge(
    weights: Tensor, context: Tensor, mixture: Regressions, *, iterations: int, tolerance: float
) -> tuple[Regressions, float]:
    """EM steps until the mean log-likelihood gains less than ``tolerance`` (nats), and that log-likelihood."""
    previous = -float("inf")
    for _ in range(iterations):
        responsibilities, likelihood = expectation(weights, context, mixture)
        if float(likelihood) - previous < tolerance:
            break
        previous = float(likelihood)
        mixture = maximisation(weights, context, responsibilities, mixture)
    return mixture, float(expectation(weights, context, mixture)[1])


def best_start(weights: Tensor, context: Tensor, n_clusters: int, *, seed: int, n_restarts: int) -> Regressions:
    """The likeliest of several first mixtures."""
    starts = [start(weights, context, n_clusters, seed + i) for i in range(n_restarts)]
    return max(starts, key=lambda mixture: float(expectation(weights, context, mixture)[1]))


def fit_regressions(
    weights: Tensor,
    context: Tensor,
    n_clusters: int,
    *,
    seed: int,
    n_restarts: int = 8,
    iterations: int = 500,
    tolerance: float = 1e-6,
) -> tuple[Regressions, float]:
    """Maximum-likelihood mixture of regressions from several starts, as :func:`descentflow.densities.em.fit_mixture`.

    Args:
        weights: (n, d) standardised weights.
        context: (n, c) encoded context.
        n_clusters: Number of clusters k.
        seed: Of the starts.
        n_restarts: Number of starts.
        iterations: Most EM steps of a finalist.
        tolerance: Gain of the mean log-likelihood (nats) below which EM stops.

    Returns:
        The mixture and its mean log-likelihood (nats a flight).
    """
    weights, context = weights.to(torch.float64), context.to(torch.float64)
    starts = [start(weights, context, n_clusters, seed + i) for i in range(n_restarts if n_clusters > 1 else 1)]
    screened = [converge(weights, context, m, iterations=SCREENING_ITERATIONS, tolerance=tolerance) for m in starts]
    screened.sort(key=lambda pair: -pair[1])
    finals = [
        converge(weights, context, m, iterations=iterations, tolerance=tolerance) for m, _ in screened[:FINALISTS]
    ]
    return max(finals, key=lambda pair: pair[1])


def select_regressions(
    weights: Tensor,
    context: Tensor,
    *,
    seed: int,
    n_restarts: int = 8,
    tolerance: float = 1e-6,
    extend: bool = True,
    progress: Callable[[int], None] | None = None,
) -> RegressionSelection:
    """Choose the number of clusters by BIC, as :func:`descentflow.densities.em.select_mixture`."""
    n, dimension = weights.shape
    n_context = context.shape[1]
    shares = (FLIGHTS_PER_PARAMETER, FEWEST_PER_PARAMETER)
    most, furthest = (most_clusters(n, dimension, n_context, share) for share in shares)

    def fit(k: int) -> tuple[Regressions, float]:
        return fit_regressions(weights, context, k, seed=seed, n_restarts=n_restarts, tolerance=tolerance)

    found, bic = by_bic(
        fit, lambda k: n_parameters(k, dimension, n_context), n, most, furthest if extend else most, progress
    )
    return RegressionSelection(found, bic, cap_binds=min(bic, key=bic.__getitem__) == max(bic))


def detached(mixture: Regressions) -> Regressions:
    """A copy that no gradient knows."""
    return Regressions(*(getattr(mixture, f.name).detach().clone() for f in fields(mixture)))
