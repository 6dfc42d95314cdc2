"""Gappy functional PCA with the interface of scikit-learn: fit, transform, inverse_transform."""

import warnings
from typing import Literal

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.representation.fpca import ppca
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.iterative import MAX_GROWTH, iterate
from descentflow.representation.fpca.judged_by_others import roughness_and_length
from descentflow.representation.fpca.number_of_components import explained_share, number_of_components
from descentflow.representation.fpca.roughness import smoothed

Method = Literal["ppca", "iterative"]
MAX_ITERATIONS = 100
"""Bound on the iterations of EM, which ends before it."""
TOLERANCE = 1e-5
"""EM stops when the mean log-likelihood per observed value gains less (nats)."""


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
    ) -> None:
        """Set the options.

        Args:
            explained_variance: Share of the variance that the kept components explain, above 0 and below 1.
            method: ``ppca`` or ``iterative``.
            latent_dimension: First latent dimension tried; doubled until the wanted share is explained.
        """
        if not 0 < explained_variance < 1:
            raise ConfigError(
                f"explained_variance {explained_variance}", expected="a share between 0 and 1", mend="try 0.8"
            )
        if method not in ("ppca", "iterative"):
            raise ConfigError(f"fPCA method {method!r}", expected="'ppca' or 'iterative'", mend="choose one of them")
        self.explained_variance = explained_variance
        self.method = method
        self.latent_dimension = latent_dimension

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
        values = torch.where(mask, values, 0.0).to(torch.float64)
        _check(values, mask)
        if self.method == "iterative":
            return self._fit_iterative(values, mask, spacing_m)
        return self._fit_ppca(values, mask, spacing_m)

    def transform(self, values: Tensor, mask: Tensor) -> Tensor:
        """Weights (n, k) of profiles (n, L)."""
        return self.basis_.encode(values, mask)

    def inverse_transform(self, weights: Tensor) -> Tensor:
        """Profiles (n, L) of weights (n, k)."""
        return self.basis_.decode(weights)

    def _fit_ppca(self, values: Tensor, mask: Tensor, spacing_m: float) -> "GappyFPCA":
        n, n_levels = values.shape
        mean = ppca.observed_mean(values, mask)
        scale = torch.where(mask, values - mean, 0.0).square().sum().div(mask.sum()).sqrt()
        centred = torch.where(mask, (values - mean) / scale, 0.0)
        largest = min(n - 1, n_levels)
        q = min(self.latent_dimension, largest)
        while True:
            fitted = self._model(centred, mask, q)
            eigenvalues, eigenvectors = _spectrum(fitted)
            share = explained_share(eigenvalues)
            k = number_of_components(share, self.explained_variance)
            if k < q or q == largest:
                break
            # All q latent directions would be kept: give the model room to see how the spectrum goes on.
            q = min(2 * q, largest)
        weight, length = roughness_and_length(
            centred, mask, mean / scale, lambda values, seen: self._model(values, seen, min(q, len(values) - 1))
        )
        fitted = smoothed(fitted, weight, centred, mask, mean / scale)
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

    def _model(self, centred: Tensor, mask: Tensor, q: int) -> ppca.PPCA:
        if bool(mask.all()):
            loadings, noise = ppca.closed_form(ppca.pairwise_covariance(centred, mask), q)
            return ppca.PPCA(loadings, noise, centred.new_zeros(centred.shape[1]), [], converged=True)
        return ppca.em(centred, mask, q, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE)

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


def _check(values: Tensor, mask: Tensor) -> None:
    """Refuse profiles from which no covariance can be estimated."""
    if values.shape[0] < 2:
        raise DataError(
            f"{values.shape[0]} training flight(s)",
            expected="at least two flights",
            mend="prepare more descents",
        )
    if not bool(torch.isfinite(values).all()):
        raise DataError(
            "profiles with values that are not finite", expected="finite observed values",
            mend="prepare the rows again: cleaning drops such rows",
        )  # fmt: skip
    thin = (mask.sum(0) < 2).nonzero()
    if len(thin):
        raise DataError(
            f"{len(thin)} level(s) observed by fewer than two training flights, the first at index {int(thin[0])}",
            expected="at least two flights on every level of the grid",
            mend="prepare more descents, or choose a higher lowest level (--data.bottom_fl)",
        )
    centred = torch.where(mask, values - ppca.observed_mean(values, mask), 0.0)
    if float(centred.abs().max()) <= 1e-9 * float(values.abs().max()):
        raise DataError(
            "training flights that are all identical", expected="profiles that vary between flights",
            mend="check that the rows come from different flights and are not copies",
        )  # fmt: skip
