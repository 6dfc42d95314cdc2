"""Gappy functional PCA with the interface of scikit-learn: fit, transform, inverse_transform."""

import math
import warnings
from typing import Literal

import torch
from torch import Tensor

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.core.threads import one_thread
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.basis import FunctionalBasis, explained_share, number_of_components
from descentflow.representation.fpca.complete import CompleteProfiles
from descentflow.representation.fpca.iterative import MAX_GROWTH, iterate
from descentflow.representation.fpca.roughness import roughness_and_length, smoothed

Method = Literal["ppca", "iterative"]
MAX_ITERATIONS = 100
"""Bound on the iterations of EM. Components of CAS take all of them, and would go on growing at levels that few flights
show: of 4,102 B738 flights, the model's variance at the top is 1.6 times that of the values shown there, and 3.1 times
after ten times as many iterations, which miss levels that are hidden from other flights by more."""
TOLERANCE = 1e-5
"""EM stops when the mean log-likelihood per observed value gains less (nats)."""


class GappyProfiles:
    """Profiles centred by the mean of what is observed at each level, and divided by their spread.

    Example:
        >>> curves = torch.randn(200, 1).double() + 0.1 * torch.randn(200, 20).double()
        >>> flights = GappyProfiles(curves, torch.arange(20) < torch.randint(10, 25, (200, 1)))
        >>> round(float(flights.model(1).noise_variance * flights.scale**2), 2)
        0.01
    """

    def __init__(self, values: Tensor, mask: Tensor) -> None:
        """Centre and divide.

        Args:
            values: (n, L) float64, zero where missing.
            mask: (n, L) observed.
        """
        self.values, self.mask = values, mask
        self.largest = values.abs().amax()
        self.mean = ppca.observed_mean(values, mask)
        self.centred = torch.where(mask, values - self.mean, 0.0)
        self.scale = torch.linalg.vector_norm(self.centred) / mask.count_nonzero().sqrt()
        # Of flights that are all alike rounding is left, or nothing.
        self.centred /= self.scale.clamp(min=1e-300)

    def model(self, q: int) -> ppca.PPCA:
        """Probabilistic PCA with q latent dimensions."""
        return _by_em(self.centred, self.mask, q)

    def learnt(self, q: int) -> tuple[float, float]:
        """Weight of the prior against roughness, and length of the noise."""
        return roughness_and_length(
            self.centred,
            self.mask,
            self.mean / self.scale,
            lambda some, seen: _by_em(some, seen, min(q, len(some) - 1)),
        )

    def smoothed(self, fitted: ppca.PPCA, weight: float) -> ppca.PPCA:
        """A model under the prior against roughness."""
        return smoothed(fitted, weight, self.centred, self.mask, self.mean / self.scale)


def _by_em(centred: Tensor, mask: Tensor, q: int) -> ppca.PPCA:
    return ppca.em(centred, mask, q, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE)


class GappyFPCA:
    """Functional PCA of profiles that do not span the whole grid (paper, section 2.2 and appendix A).

    ``ppca`` (default) fits probabilistic PCA by EM to the observed levels; ``iterative`` is the paper's algorithm.
    The number of components is the smallest that explains the wanted share of variance; the latent dimension of
    the probabilistic PCA, which completes the gaps, is larger and grows until it can tell.

    Attributes after ``fit``: ``basis_`` (:class:`FunctionalBasis`), ``explained_variance_ratio_`` (k,),
    ``n_components_``, ``n_iterations_``, ``converged_``.

    Example:
        >>> shape = torch.linspace(0, 1, 50).double()
        >>> curves = 150 + torch.randn(30, 1).double() * shape + torch.randn(30, 1).double() * shape**2
        >>> mask = torch.ones(30, 50, dtype=torch.bool)
        >>> mask[:10, 40:] = False  # ten flights lack the upper levels
        >>> fpca = GappyFPCA(explained_variance=0.99).fit(curves, mask, spacing_m=30.48)
        >>> rebuilt = fpca.inverse_transform(fpca.transform(curves, mask))
        >>> bool((rebuilt - curves)[mask].abs().max() < 0.5)
        True
    """

    def __init__(
        self,
        explained_variance: float = 0.8,
        method: Method = "ppca",
        *,
        latent_dimension: int = 16,
        learn_constants: bool = True,
    ) -> None:
        """Set the options.

        Args:
            explained_variance: Share of the variance that the kept components explain, above 0 and below 1.
            method: ``ppca`` or ``iterative``.
            latent_dimension: First latent dimension tried; doubled until the wanted share is explained.
            learn_constants: Whether the weight of the prior against roughness and the length of the noise are learnt
                from flights left out (:mod:`~descentflow.representation.fpca.roughness`); without, levels are
                taken as they are, and one by one. Of complete profiles the components are the same.
        """
        self.explained_variance = explained_variance
        self.method = method
        self.latent_dimension = latent_dimension
        self.learn_constants = learn_constants

    def fit(self, values: Tensor, mask: Tensor, spacing_m: float) -> "GappyFPCA":
        """Fit to profiles.

        Args:
            values: (n, L) profiles; masked values are ignored.
            mask: (n, L) bool, observed.
            spacing_m: Altitude between two levels.

        Raises:
            DataError: If there are fewer than two flights, a level that fewer than two flights observe, a value
                that is not finite, or no variance at all.
        """
        # Of complete profiles one product by NumPy is most of the work; torch's waiting threads would share its cores.
        with one_thread():
            if bool(mask.cpu().numpy().all()):  # a tenth of the time of torch's
                return self._fit(values, mask, spacing_m, whole=True)
        return self._fit(values, mask, spacing_m, whole=False)

    def _fit(self, values: Tensor, mask: Tensor, spacing_m: float, whole: bool) -> "GappyFPCA":
        values = (values if whole else torch.where(mask, values, 0.0)).to(torch.float64)
        _check_counts(values, mask, whole)
        flights = CompleteProfiles(values) if whole else GappyProfiles(values, mask)
        _check_values(float(flights.scale), float(flights.largest))
        if self.method == "iterative":
            return self._fit_iterative(values, mask, spacing_m)
        return self._fit_ppca(flights, spacing_m)

    def transform(self, values: Tensor, mask: Tensor) -> Tensor:
        """Weights (n, k) of profiles (n, L)."""
        return self.basis_.encode(values, mask)

    def inverse_transform(self, weights: Tensor) -> Tensor:
        """Profiles (n, L) of weights (n, k)."""
        return self.basis_.decode(weights)

    def _fit_ppca(self, flights: GappyProfiles | CompleteProfiles, spacing_m: float) -> "GappyFPCA":
        mean, scale = flights.mean, flights.scale
        largest = min(len(flights.values) - 1, len(mean))
        q = min(self.latent_dimension, largest)
        while True:
            fitted = flights.model(q)
            eigenvalues, eigenvectors = _spectrum(fitted)
            share = explained_share(eigenvalues)
            k = number_of_components(share, self.explained_variance)
            if k < q or q == largest:
                break
            # All q latent directions would be kept: give the model room to see how the spectrum goes on.
            q = min(2 * q, largest)
        weight, length = flights.learnt(q) if self.learn_constants else (0.0, 1.0)
        if weight > 0:
            fitted = flights.smoothed(fitted, weight)
            eigenvalues, eigenvectors = _spectrum(fitted)
            share = explained_share(eigenvalues)
            k = min(number_of_components(share, self.explained_variance), q)
        self.n_iterations_, self.converged_ = len(fitted.log_likelihood), fitted.converged
        self._keep(
            mean + scale * fitted.shift, eigenvectors[:, :k], share.diff(prepend=share.new_zeros(1))[:k], spacing_m,
            loadings=fitted.loadings * scale, noise=fitted.noise_variance * scale**2,
            noise_length=mean.new_tensor(length),
        )  # fmt: skip
        return self

    def _fit_iterative(self, values: Tensor, mask: Tensor, spacing_m: float) -> "GappyFPCA":
        fitted = iterate(values, mask, self.explained_variance)
        if not fitted.converged or fitted.growth > MAX_GROWTH:
            settled = "" if fitted.converged else "has not settled and "
            warnings.warn(
                f"after {fitted.n_iterations} iterations the paper's fPCA {settled}has {fitted.growth:.1f} times the "
                "variance of the observed values: what was extrapolated to hidden levels is what the first "
                "components explain; to mend it, take fpca ppca",
                DescentflowWarning,
                stacklevel=2,
            )
        share = explained_share(fitted.eigenvalues)
        k = number_of_components(share, self.explained_variance)
        self.n_iterations_, self.converged_ = fitted.n_iterations, fitted.converged
        self._keep(
            fitted.mean, fitted.eigenvectors[:, :k], share.diff(prepend=share.new_zeros(1))[:k], spacing_m,
            loadings=values.new_zeros(values.shape[1], 0), noise=values.new_zeros(()), noise_length=values.new_ones(()),
        )  # fmt: skip
        return self

    def _keep(
        self,
        mean: Tensor,
        modes: Tensor,
        ratio: Tensor,
        spacing_m: float,
        *,
        loadings: Tensor,
        noise: Tensor,
        noise_length: Tensor,
    ) -> None:
        # The sign of an eigenvector is arbitrary; the largest entry positive makes fits comparable.
        largest = modes.abs().argmax(0)
        sign = modes.gather(0, largest[None]).sign()[0]
        components = (modes * sign).T / spacing_m**0.5
        self.basis_ = FunctionalBasis(mean, components, loadings, noise, noise_length, ratio, spacing_m)
        self.explained_variance_ratio_ = ratio
        self.n_components_ = modes.shape[1]


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


def _check_values(spread: float, largest: float) -> None:
    """Refuse profiles with values that are none, and profiles that are all the same."""
    if not math.isfinite(largest):
        raise DataError(
            "profiles with values that are not finite", expected="finite observed values",
            mend="prepare the rows again: cleaning drops such rows",
        )  # fmt: skip
    if spread <= 1e-9 * largest:
        raise DataError(
            "training flights that are all identical", expected="profiles that vary between flights",
            mend="check that the rows come from different flights and are not copies",
        )  # fmt: skip
