"""Gappy functional PCA: components of profiles from the observed levels of each."""

import math
from contextlib import nullcontext
from functools import partial
from typing import Literal

import torch
from torch import Tensor

from descentflow.core.errors import DataError, warn
from descentflow.core.threads import one_thread
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca._complete import complete_profiles
from descentflow.representation.fpca._iterative import MAX_GROWTH, iterate
from descentflow.representation.fpca.basis import FunctionalBasis, explained_share, number_of_components
from descentflow.representation.fpca.roughness import Centred, roughness_and_length, smoothed

Method = Literal["ppca", "iterative"]
MAX_ITERATIONS = 100
"""Bound on the iterations of EM. Components of CAS take all of them, and would go on growing at levels that few flights
show: of 4,102 B738 flights, the model's variance at the top is 1.6 times that of the values shown there, and 3.1 times
after ten times as many iterations, which miss levels that are hidden from other flights by more."""
TOLERANCE = 1e-5
"""EM stops when the mean log-likelihood per observed value gains less (nats)."""
LATENT_DIMENSION = 16
"""First latent dimension tried."""
ALIKE, LEAST_NOISE = 1e-9, 1e-4
"""Spread of profiles that are all alike, and their noise, as shares of the largest value: 0.03 kt of CAS."""


def gappy_profiles(values: Tensor, mask: Tensor) -> Centred:
    """Profiles centred by the mean of the values observed at each level, and divided by their spread.

    Args:
        values: (n, L) float64, zero where missing.
        mask: (n, L) observed.

    Example:
        >>> curves = torch.randn(200, 1).double() + 0.1 * torch.randn(200, 20).double()
        >>> seen = torch.arange(20) < torch.randint(10, 25, (200, 1))
        >>> flights = gappy_profiles(torch.where(seen, curves, 0.0), seen)
        >>> round(float(flights.model(1).noise_variance * flights.scale**2), 2)
        0.01
    """
    mean = ppca.observed_mean(values, mask)
    centred = torch.where(mask, values - mean, 0.0)
    scale = torch.linalg.vector_norm(centred) / mask.count_nonzero().sqrt()
    # Of flights that are all alike rounding is left, or nothing.
    centred /= scale.clamp(min=1e-300)
    fit = partial(ppca.em, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE)
    return Centred(mean, scale, values.abs().amax(), centred, mask, partial(fit, centred, mask), fit)


def fit_components(
    values: Tensor,
    mask: Tensor,
    spacing_m: float,
    explained_variance: float = 0.8,
    method: Method = "ppca",
    *,
    latent_dimension: int = LATENT_DIMENSION,
    learn_constants: bool = True,
) -> FunctionalBasis:
    """Functional PCA of profiles that do not span the whole grid (paper, section 2.2 and appendix A).

    ``ppca`` (default) fits probabilistic PCA by EM to the observed levels; ``iterative`` is the paper's algorithm.
    The number of components is the smallest that explains the wanted share of variance; the latent dimension of
    the probabilistic PCA, which completes the gaps, is larger and grows until it can tell. Profiles that are the same
    for all flights, as the CAS of a simulator that flies one schedule, have none.

    Args:
        values: (n, L) profiles; masked values are ignored.
        mask: (n, L) bool, observed.
        spacing_m: Altitude between two levels.
        explained_variance: Share of the variance that the kept components explain, above 0 and below 1.
        method: ``ppca`` or ``iterative``.
        latent_dimension: First latent dimension tried; doubled until the wanted share is explained.
        learn_constants: Whether the weight of the prior against roughness and the length of the noise are learnt
            from flights left out (:mod:`~descentflow.representation.fpca.roughness`); without, levels are
            taken as they are, and one by one. Of complete profiles the components are the same.

    Raises:
        DataError: If there are fewer than two flights, a level that fewer than two flights observe, or a value
            that is not finite.

    Example:
        >>> shape = torch.linspace(0, 1, 50).double()
        >>> curves = 150 + torch.randn(30, 1).double() * shape + torch.randn(30, 1).double() * shape**2
        >>> mask = torch.ones(30, 50, dtype=torch.bool)
        >>> mask[:10, 40:] = False  # ten flights lack the upper levels
        >>> basis = fit_components(curves, mask, 30.48, explained_variance=0.99)
        >>> rebuilt = basis.decode(basis.encode(curves, mask))
        >>> bool((rebuilt - curves)[mask].abs().max() < 0.5)
        True
    """
    whole = bool(mask.cpu().numpy().all())  # a tenth of the time of torch's
    # Of complete profiles one product by NumPy is most of the work; torch's waiting threads would share its cores.
    with one_thread() if whole else nullcontext():
        values = (values if whole else torch.where(mask, values, 0.0)).to(torch.float64)
        _check_counts(values, mask, whole)
        flights = complete_profiles(values) if whole else gappy_profiles(values, mask)
        _check_finite(float(flights.largest))
        if float(flights.scale) <= ALIKE * float(flights.largest):
            return _without_components(flights, spacing_m)
        if method == "iterative":
            return _by_iteration(values, mask, spacing_m, explained_variance)
        mean, scale = flights.mean, flights.scale
        largest = min(len(values) - 1, len(mean))
        q = min(latent_dimension, largest)
        while True:
            fitted = flights.model(q)
            eigenvalues, modes = _spectrum(fitted)
            k = number_of_components(explained_share(eigenvalues), explained_variance)
            if k < q or q == largest:
                break
            # All q latent directions would be kept: give the model room to see how the spectrum goes on.
            q = min(2 * q, largest)
        weight, length = roughness_and_length(flights, q) if learn_constants else (0.0, 1.0)
        if weight > 0:
            fitted = smoothed(fitted, weight, flights.values, mask, mean / scale)
            eigenvalues, modes = _spectrum(fitted)
        noise, of_noise = fitted.noise_variance * scale**2, mean.new_tensor(length)
        spectrum = (eigenvalues, modes, explained_variance)
        return _basis(mean + scale * fitted.shift, *spectrum, spacing_m, fitted.loadings * scale, noise, of_noise)


def _by_iteration(values: Tensor, mask: Tensor, spacing_m: float, explained_variance: float) -> FunctionalBasis:
    fitted = iterate(values, mask, explained_variance)
    if not fitted.converged or fitted.growth > MAX_GROWTH:
        settled = "" if fitted.converged else "has not settled and "
        warn(
            f"after {fitted.n_iterations} iterations the paper's fPCA {settled}has {fitted.growth:.1f} times the "
            "variance of the observed values: what was extrapolated to hidden levels is what the first "
            "components explain; to mend it, take fpca ppca"
        )
    spectrum = (fitted.eigenvalues, fitted.eigenvectors, explained_variance)
    nothing = (values.new_zeros(values.shape[1], 0), values.new_zeros(()), values.new_ones(()))
    return _basis(fitted.mean, *spectrum, spacing_m, *nothing)


def _basis(
    mean: Tensor,
    eigenvalues: Tensor,
    modes: Tensor,
    explained_variance: float,
    spacing_m: float,
    loadings: Tensor,
    noise: Tensor,
    noise_length: Tensor,
) -> FunctionalBasis:
    """The basis of the first modes, as many as explain the wanted share, where there are so many."""
    share = explained_share(eigenvalues)
    modes = modes[:, : number_of_components(share, explained_variance)]
    # The sign of an eigenvector is arbitrary; the largest entry positive makes fits comparable.
    largest = modes.abs().argmax(0)
    components = (modes * modes.gather(0, largest[None]).sign()[0]).T / spacing_m**0.5
    ratio = share.diff(prepend=share.new_zeros(1))[: len(components)]
    return FunctionalBasis(mean, components, loadings, noise, noise_length, ratio, spacing_m)


def _spectrum(fitted: ppca.PPCA) -> tuple[Tensor, Tensor]:
    """Eigenvalues (L,) and leading eigenvectors (L, q) of ``loadings loadings' + noise I``."""
    left, singular, _ = torch.linalg.svd(fitted.loadings, full_matrices=False)
    eigenvalues = fitted.noise_variance.expand(fitted.loadings.shape[0]).clone()
    eigenvalues[: len(singular)] += singular.square()
    return eigenvalues, left


def _check_counts(values: Tensor, mask: Tensor, whole: bool) -> None:
    """Refuse profiles too few to estimate a covariance from."""
    if values.shape[0] < 2:
        raise DataError(
            f"{values.shape[0]} training flight(s)",
            expected="at least two flights",
            mend="prepare more descents",
        )
    thin = mask[:0, 0] if whole else (mask.sum(0) < 2).nonzero()
    if len(thin):
        raise DataError(
            f"{len(thin)} level(s) observed by fewer than two training flights, the first at index {int(thin[0])}",
            expected="at least two flights on every level of the grid",
            mend="prepare more descents, or leave these levels out",
        )


def _check_finite(largest: float) -> None:
    """Refuse profiles with values that are none."""
    if not math.isfinite(largest):
        raise DataError(
            "profiles with values that are not finite", expected="finite observed values",
            mend="prepare the rows again: cleaning drops such rows",
        )  # fmt: skip


def _without_components(flights: Centred, spacing_m: float) -> FunctionalBasis:
    """The basis of profiles that are all alike: their mean, and a direction of no size with the noise of rounding."""
    levels = len(flights.mean)
    none, noise = flights.mean.new_zeros(0, levels), (LEAST_NOISE * flights.largest).square()
    direction = flights.mean.new_zeros(levels, 1)
    return FunctionalBasis(flights.mean, none, direction, noise, noise.new_ones(()), none[:, 0], spacing_m)
