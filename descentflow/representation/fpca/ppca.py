"""Probabilistic PCA of gappy profiles: closed form where nothing is missing, EM where something is.

The model is ``x = mean + loadings z + noise`` with ``z ~ N(0, I_q)`` and isotropic noise (Tipping and Bishop 1999,
Probabilistic principal component analysis; section 3.2 for the closed form, appendix for missing values). It replaces
the unregularised fits of the paper's appendix A, whose error on hidden levels is several times larger.
"""

from dataclasses import dataclass
from math import log, pi

import torch
from torch import Tensor

from descentflow.representation.fpca.mask_groups import MaskGroups, group_masks

FIRST_FLIGHTS = 4096
"""Of more than twice as many flights, so many say where EM starts: it climbs slowly, and most of the way is theirs."""
FEWEST_OF_ALL = 10
"""Iterations of all flights at least, where some of them took all that are allowed."""
LEAST_NOISE = 1e-10
"""Variance of the noise at least, as a share of that of the values."""
NOISE_STEPS = 10
"""EM steps for the noise alone, which converges fast: it has one number for all values."""


@dataclass(frozen=True)
class PPCA:
    """A fitted model: loadings (L, q), noise variance (), mean log-likelihood per observed value by iteration (nats).

    ``shift`` (L,) is what the mean of greatest likelihood has beyond the mean that was subtracted before.

    :func:`em` returns it.

    Example:
        >>> fitted = PPCA(torch.tensor([[3.0], [4.0]]), torch.tensor(0.5), torch.zeros(2), [-2.0], converged=True)
        >>> fitted.loadings @ fitted.loadings.T + fitted.noise_variance * torch.eye(2)  # covariance of the profiles
        tensor([[ 9.5000, 12.0000],
                [12.0000, 16.5000]])
    """

    loadings: Tensor
    noise_variance: Tensor
    shift: Tensor
    log_likelihood: list[float]
    converged: bool


def observed_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean over the flights that observe each level: (n, L), (n, L) -> (L,).

    Divided by the count of observed values and not by n, which would pull levels with gaps towards zero.

    Example:
        >>> observed_mean(torch.tensor([[1.0, 5.0], [3.0, 999.0]]), torch.tensor([[True, True], [True, False]]))
        tensor([2., 5.])
    """
    return torch.where(mask, values, 0.0).sum(0) / mask.sum(0)


def pairwise_covariance(centred: Tensor, mask: Tensor) -> Tensor:
    """Covariance (L, L) over the flights that observe both levels; zero where no flight does.

    Args:
        centred: (n, L) values minus the mean, zero where missing.
        mask: (n, L) observed.

    Example:
        >>> pairwise_covariance(torch.tensor([[1.0, 2.0], [-1.0, -2.0]]), torch.ones(2, 2, dtype=torch.bool))
        tensor([[2., 4.],
                [4., 8.]])
    """
    seen = mask.to(centred.dtype)
    both = seen.T @ seen
    return (centred.T @ centred) / (both - 1).clamp(min=1)


def closed_form(covariance: Tensor, q: int) -> tuple[Tensor, Tensor]:
    """Maximum-likelihood loadings (L, q) and noise variance of a covariance (Tipping and Bishop, section 3.2).

    Example:
        >>> loadings, noise = closed_form(torch.diag(torch.tensor([9.0, 1.0, 1.0])), q=1)
        >>> round(float(loadings.norm() ** 2), 4), float(noise)  # 9 = 8 + 1
        (8.0, 1.0)
    """
    eigenvalues, eigenvectors = torch.linalg.eigh(covariance)
    eigenvalues, eigenvectors = eigenvalues.flip(0), eigenvectors.flip(1)
    # A pairwise covariance may have negative eigenvalues; they stand for sampling error, not for variance.
    rest = eigenvalues[q:].clamp(min=0)
    floor = eigenvalues[0].clamp(min=1e-300) * LEAST_NOISE
    noise = torch.maximum(rest.mean() if len(rest) else floor, floor)
    return eigenvectors[:, :q] * (eigenvalues[:q] - noise).clamp(min=0).sqrt(), noise


def posterior(centred: Tensor, groups: MaskGroups, loadings: Tensor, noise: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Posterior of z given the observed levels.

    Args:
        centred: (n, L) values minus the mean, zero where missing.
        groups: Flights by mask.
        loadings: (L, q).
        noise: Noise variance.

    Returns:
        Means (n, q), covariances by mask (U, q, q), and log-determinants of ``loadings' loadings + noise I``
        by mask (U,).

    Example:
        >>> centred, mask = torch.tensor([[2.0, 2.0], [2.0, 0.0]]).double(), torch.tensor([[True, True], [True, False]])
        >>> loadings, noise = torch.ones(2, 1).double(), torch.tensor(1.0).double()
        >>> posterior(centred, group_masks(mask), loadings, noise)[0]  # 4 / (2 + 1) and 2 / (1 + 1)
        tensor([[1.3333],
                [1.0000]], dtype=torch.float64)
    """
    return posterior_given(centred @ loadings, groups, level_products(groups, loadings), noise)


def level_products(groups: MaskGroups, loadings: Tensor) -> Tensor:
    """Products ``loadings' loadings`` over the levels of each mask, (U, q, q).

    Example:
        >>> groups = group_masks(torch.tensor([[True, False], [True, True]]))
        >>> level_products(groups, torch.tensor([[1.0], [2.0]]).double()).flatten()
        tensor([1., 5.], dtype=torch.float64)
    """
    return _square(groups.masks @ _pairs(loadings), loadings.shape[1])


def _pairs(values: Tensor) -> Tensor:
    """Products of each two columns of values (n, q), each two once: (n, q (q + 1) / 2)."""
    first, second = torch.triu_indices(values.shape[1], values.shape[1])
    return values[:, first] * values[:, second]


def _square(pairs: Tensor, q: int) -> Tensor:
    """Symmetric matrices (n, q, q) of what :func:`_pairs` has of each two columns."""
    number = torch.zeros(q, q, dtype=torch.long, device=pairs.device)
    first, second = torch.triu_indices(q, q)
    number[first, second] = number[second, first] = torch.arange(len(first), device=pairs.device)
    return pairs[:, number.flatten()].reshape(len(pairs), q, q)  # q may be zero: -1 would be ambiguous


def posterior_given(
    projected: Tensor, groups: MaskGroups, grams: Tensor, noise: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Result of :func:`posterior`, from ``centred @ loadings`` (n, q) and :func:`level_products`.

    Example:
        >>> groups, one = group_masks(torch.ones(1, 2, dtype=torch.bool)), torch.tensor(1.0).double()
        >>> posterior_given(4 * one[None, None], groups, 2 * one[None, None, None], one)[0]  # 4 / (2 + 1)
        tensor([[1.3333]], dtype=torch.float64)
    """
    precision = grams + noise * torch.eye(grams.shape[-1], dtype=grams.dtype, device=grams.device)
    factor = torch.linalg.cholesky(precision)
    covariance = noise * torch.cholesky_inverse(factor)
    log_det = 2 * factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)
    return groups.times(projected / noise, covariance), covariance, log_det


def em(centred: Tensor, mask: Tensor, q: int, *, max_iterations: int, tolerance: float) -> PPCA:
    """Fit by EM on the observed values alone.

    The mean is one more parameter: where gaps depend on the values seen (slow flights that show no top), the
    mean of the observed values at a level is not that of all flights. Each M step takes the mean of the posteriors of z
    into it (Liu, Rubin and Wu 1998, doi:10.1093/biomet/85.4.755): the same maximum, in fewer steps. Their covariance is
    not taken into the loadings: the likelihood trusts each level as one observation, and at its maximum, which that
    would reach, components that few flights show at the top are several times too large there.

    Args:
        centred: (n, L) float64 values minus the observed mean, zero where missing.
        mask: (n, L) observed.
        q: Latent dimension.
        max_iterations: Bound on the iterations, those of the start of many flights counted: the more, the larger are
            components at levels that few flights show.
        tolerance: Stop when the mean log-likelihood per observed value grows by less than this (nats).

    Example:
        >>> mask = torch.rand(200, 10) < 0.9
        >>> values = torch.randn(200, 1).double() + 0.1 * torch.randn(200, 10).double()
        >>> fitted = em(torch.where(mask, values, 0.0), mask, q=1, max_iterations=100, tolerance=1e-6)
        >>> fitted.converged, round(float(fitted.noise_variance), 2)
        (True, 0.01)
    """
    groups = group_masks(mask)
    loadings, noise, shift, taken = _start(centred, mask, q, max_iterations, tolerance)
    n_observed, energy = mask.sum(), centred.square().sum(1)
    total = energy.sum()
    log_likelihood: list[float] = []
    for _ in range(max(max_iterations - taken, FEWEST_OF_ALL) if taken else max_iterations):
        # Of each flight minus the shift, which is the same product for all flights of a mask.
        shifted = groups.masks @ torch.cat([shift[:, None] * loadings, shift[:, None].square()], 1)
        products = centred @ torch.cat([loadings, 2 * shift[:, None]], 1) - shifted[groups.group]
        projected = products[:, :q]
        means, covariance, log_det = posterior_given(projected, groups, level_products(groups, loadings), noise)
        fit = _log_likelihood(projected, energy - products[:, q], groups, means, noise, log_det)
        log_likelihood.append(float(fit / n_observed))
        if len(log_likelihood) > 1 and log_likelihood[-1] - log_likelihood[-2] < tolerance:
            return PPCA(loadings, noise, shift, log_likelihood, converged=True)
        loadings, noise, shift = _maximise(centred, groups, means, covariance, n_observed, total)
    return PPCA(loadings, noise, shift, log_likelihood, converged=False)


def _start(
    centred: Tensor, mask: Tensor, q: int, max_iterations: int, tolerance: float
) -> tuple[Tensor, Tensor, Tensor, int]:
    """Loadings, noise and shift from which EM starts: the closed form's, or where EM ends for some of many flights.

    And how many iterations that took.
    """
    every = len(mask) // FIRST_FLIGHTS
    if every >= 2 and bool((mask[::every].sum(0) > q).all()):
        some = em(centred[::every], mask[::every], q, max_iterations=max_iterations, tolerance=tolerance)
        return some.loadings, some.noise_variance, some.shift, len(some.log_likelihood)
    return (*closed_form(pairwise_covariance(centred, mask), q), centred.new_zeros(centred.shape[1]), 0)


def log_likelihood(centred: Tensor, mask: Tensor, loadings: Tensor, noise: Tensor) -> Tensor:
    """Log-likelihood () of flights under a model, in nats, with the mean taken off.

    Args:
        centred: (n, L) values minus the model's mean, zero where missing.
        mask: (n, L) observed.
        loadings: (L, q).
        noise: Noise variance.

    Example:
        >>> one = torch.ones(1, 1, dtype=torch.float64)
        >>> round(float(log_likelihood(0 * one, one > 0, one, torch.tensor(1.0).double()) + log(2 * pi * 2) / 2), 9)
        0.0
    """
    groups = group_masks(mask)
    projected = centred @ loadings
    means, _, log_det = posterior_given(projected, groups, level_products(groups, loadings), noise)
    return _log_likelihood(projected, centred.square().sum(1), groups, means, noise, log_det)


def noise_given_loadings(centred: Tensor, mask: Tensor, loadings: Tensor, noise: Tensor) -> Tensor:
    """Noise variance () of greatest likelihood for given loadings, by a few EM steps from ``noise``.

    Args:
        centred: (n, L) values minus the model's mean, zero where missing.
        mask: (n, L) observed.
        loadings: (L, q).
        noise: Where to begin.

    Example:
        >>> curves = torch.randn(400, 1).double() + 0.5 * torch.randn(400, 20).double()
        >>> seen = torch.ones(400, 20, dtype=torch.bool)
        >>> noise = noise_given_loadings(curves, seen, torch.ones(20, 1).double(), torch.tensor(1.0).double())
        >>> round(float(noise.sqrt()), 1)
        0.5
    """
    # For given loadings the flights of a mask say no more than the sum of the products of their projections.
    groups = group_masks(mask)
    energy, n_observed = centred.square().sum(), mask.sum()
    grams, moments = level_products(groups, loadings), groups.moments(centred @ loadings)
    eye = torch.eye(loadings.shape[1], dtype=grams.dtype, device=grams.device)
    for _ in range(NOISE_STEPS):
        gain = torch.cholesky_inverse(torch.linalg.cholesky(grams + noise * eye))  # means are projections times it
        explained = gain @ moments
        missing = energy + ((grams @ explained) * gain).sum() - 2 * explained.diagonal(dim1=-2, dim2=-1).sum()
        spread = noise * (groups.counts @ (grams * gain).sum((1, 2)))
        noise = ((missing + spread) / n_observed).clamp(min=float(LEAST_NOISE * energy / n_observed))
    return noise


def _maximise(
    centred: Tensor, groups: MaskGroups, means: Tensor, covariance: Tensor, n_observed: Tensor, total: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """M step: each level regresses on (z, 1), z given what was observed of the flights that show it."""
    q = means.shape[1]
    design = torch.cat([means, torch.ones_like(means[:, :1])], 1)
    moments = groups.moments(design)
    moments[:, :q, :q] += groups.counts[:, None, None] * covariance
    first, second = torch.triu_indices(q + 1, q + 1)
    by_level = _square(groups.masks.T @ moments[:, first, second], q + 1)
    cross = centred.T @ design
    ridge = 1e-10 * by_level.diagonal(dim1=-2, dim2=-1).mean(-1)
    # A level that no flight shows, of few that are dealt into parts, has no loadings.
    ridge = torch.where(ridge > 0, ridge, 1.0)
    by_level = by_level + ridge[:, None, None] * torch.eye(q + 1, dtype=means.dtype, device=means.device)
    lines = torch.cholesky_solve(cross[:, :, None], torch.linalg.cholesky(by_level))[:, :, 0]
    # With the exact solution, the quadratic term equals the cross term once.
    noise = (total - (lines * cross).sum()) / n_observed
    loadings = lines[:, :q]
    return loadings, noise.clamp(min=LEAST_NOISE * float(total / n_observed)), lines[:, q] + loadings @ means.mean(0)


def _log_likelihood(
    projected: Tensor, energy: Tensor, groups: MaskGroups, means: Tensor, noise: Tensor, log_det: Tensor
) -> Tensor:
    """Log-likelihood of the observed values, by Woodbury from the posterior means.

    Args:
        projected: (n, q) values times loadings.
        energy: (n,) squares of the values, summed over levels.
        groups: Flights by mask.
        means: (n, q) posterior means.
        noise: Noise variance.
        log_det: (U,) see :func:`posterior`.
    """
    q = projected.shape[1]
    n_levels = groups.masks.sum(1)[groups.group]
    quadratic = (energy - (projected * means).sum(1)) / noise
    log_det_full = (n_levels - q) * noise.log() + log_det[groups.group]
    return -0.5 * (n_levels * log(2 * pi) + log_det_full + quadratic).sum()
