"""One Gaussian of flights that show only some levels, and their weights drawn given what they show.

A mixture is fitted to such draws (multiple imputation, Rubin 1987): unlike expected weights, those of gappy
flights are then spread as widely as those of complete ones.
"""

import torch
from torch import Tensor

from descentflow.densities.em import converge
from descentflow.densities.em_steps import JITTER, RIDGE
from descentflow.densities.importance import LEAST_VARIANCE
from descentflow.densities.mixture_parameters import Mixture, cholesky_or_small, posteriors
from descentflow.representation.evidence import WeightEvidence

MOST_STEPS, TOLERANCE = 1000, 1e-8
"""EM steps at most, and their tolerance (nats per flight)."""


@torch.no_grad()
def one_gaussian(
    evidence: WeightEvidence, context: Tensor | None = None, *, ridge: float = RIDGE, jitter: float = JITTER
) -> Mixture:
    """The Gaussian of greatest marginal likelihood, its mean regressed on a context if there is one.

    Extreme deconvolution of one component (Bovy, Hogg and Roweis 2011, doi:10.1214/10-AOAS439): the E step gives the
    posterior mean and covariance of each flight's weights, the M step takes them in place of the weights.

    Args:
        evidence: Of n flights.
        context: (n, c), if there is one.
        ridge: How many flights the prior of zero slopes counts as.
        jitter: Added to the variances.

    Returns:
        A mixture of one component.

    Example:
        >>> points = torch.tensor([[0.0], [1.0], [10.0], [11.0]]).double()
        >>> blurred = WeightEvidence(points, torch.zeros(4, dtype=torch.long), torch.full((1, 1, 1), 4.0).double())
        >>> gaussian = one_gaussian(blurred)  # each seen with variance 1/4
        >>> round(float(gaussian.scale_trils) ** 2, 3)  # variance of the points less that
        25.0
    """
    points = evidence.points
    d = points.shape[1]
    given = points[:, :0] if context is None else context.to(points)
    one, gate = points.new_ones(1), given.new_zeros(1, given.shape[1])
    middle, penalty = given.mean(0), ridge * torch.eye(given.shape[1]).to(given)
    design = given - middle

    def maximise(means: Tensor, spread: Tensor) -> Mixture:
        """Ridge regression of means (n, d), whose covariance is so much wider."""
        centred = means - means.mean(0)
        slope = torch.linalg.solve(design.T @ design + penalty, design.T @ centred).T
        left = centred - design @ slope.T
        factor = cholesky_or_small(left.T @ left / len(left) + spread, jitter)
        return Mixture(one, (means.mean(0) - slope @ middle)[None], factor[None], slope[None], gate)

    if evidence.known:
        return maximise(points, points.new_zeros(d, d))
    flat, eye = points.new_zeros(1, d, given.shape[1]), torch.eye(d, dtype=points.dtype, device=points.device)
    chunks = list(evidence.chunks())

    def improve(gaussian: Mixture) -> tuple[Mixture, float]:
        means, spread, likelihood = torch.empty_like(points), points.new_zeros(d, d), 0.0
        for index, rows in chunks:
            seen = posteriors(gaussian, rows, given[index])
            means[index] = seen.means[:, 0]
            counts = torch.bincount(rows.group, minlength=len(rows.precisions)).to(points)
            spread += (counts[:, None, None] * seen.covariances[:, 0]).sum(0)
            likelihood += float(seen.log_joint.sum())
        return maximise(means, spread / len(points)), likelihood / len(points)

    start = Mixture(one, points.new_zeros(1, d), eye[None], flat, gate)
    return converge(improve, start, iterations=MOST_STEPS, tolerance=TOLERANCE)[0]


@torch.no_grad()
def drawn_weights(gaussian: Mixture, evidence: WeightEvidence, seed: int, context: Tensor | None = None) -> Tensor:
    """Weights (n, d) of flights, each drawn given what was observed of it under one Gaussian; known ones as they are.

    Args:
        gaussian: A mixture of one.
        evidence: Of n flights.
        seed: Of the draws.
        context: (n, c) where the Gaussian follows one.

    Example:
        >>> gaussian = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> alike = torch.zeros(10_000, dtype=torch.long)
        >>> seen = WeightEvidence(torch.full((10_000, 1), 4.0), alike, torch.full((1, 1, 1), 3.0))
        >>> drawn_weights(gaussian, seen, seed=0).mean().round(decimals=1)
        tensor(3.)
    """
    if evidence.known:
        return evidence.points
    drawn = torch.empty_like(evidence.points)
    generator = torch.Generator(drawn.device).manual_seed(seed)
    white = torch.randn(drawn.shape, generator=generator, dtype=drawn.dtype, device=drawn.device)
    given = gaussian.rows(context, len(drawn))
    for index, rows in evidence.chunks():
        given_seen = posteriors(gaussian, rows, given[index])
        factor = cholesky_or_small(given_seen.covariances[:, 0], LEAST_VARIANCE)[rows.group]
        drawn[index] = given_seen.means[:, 0] + (factor @ white[index][..., None])[..., 0]
    return drawn
