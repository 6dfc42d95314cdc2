"""A density as Gaussians over latent numbers u, of which profiles are linear: before and after a part was flown.

Before, u holds the weights and the residual numbers of samples. After, it holds what
:class:`~descentflow.generation.prediction.predictor.DescentPredictor` conditions: weights and the residual components
of each profile.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import NO_CONTEXT
from descentflow.generation.prediction.posterior import Prior, posterior_of, prior_of
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.linear_curves import LinearCurves, linear_curves
from descentflow.representation.profiles import Profiles
from descentflow.representation.residuals import Residuals

Array = NDArray[np.float64]
HELD_SHARE = 1e-3
"""Of the variance of residual numbers, by which they give where weights alone cannot meet what is asked."""


@dataclass(frozen=True)
class LatentDensity:
    """K Gaussians over D latent numbers, and the profiles that they make.

    Attributes:
        log_probs: (K,) log of their shares.
        means: (K, D).
        roots: (K, D, D) whose products with their transposes are the covariances.
        curves: Drag on the decoder's scale and CAS (m/s) as functions of u, whose first numbers are the weights.
        prior: What proposes, and the density that it stands for where that is no mixture.
        residuals: What residual numbers are drawn of, given the weights; None where they are Gaussian.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> latent = latent_density(load_model("best.ckpt"))
        >>> offset, loadings = latent.cas
        >>> u = torch.randn(3, latent.means.shape[1]).double()
        >>> np.allclose(offset + u.numpy() @ loadings, latent.curves.scaled_profiles(u)[1])
        True
    """

    log_probs: Array
    means: Array
    roots: Array
    curves: LinearCurves
    prior: Prior
    residuals: Residuals | None = None

    @cached_property
    def cas(self) -> tuple[Array, Array]:
        """Offset (L,) and loadings (D, L) of CAS."""
        offset, loadings = (_numbers(values.chunk(2)[1]) for values in (self.curves.offset, self.curves.loadings))
        return offset, loadings.T

    def with_residuals(self, cell: np.ndarray, entry: Tensor, u: Array, uniform: Array) -> Array:
        """Draws (n, D) less the means of their Gaussians, with the residual numbers of flights near their weights."""
        if self.residuals is None:
            return u
        d, means = self.curves.n_weights, self.means[cell]
        weights = torch.from_numpy(means[:, :d] + u[:, :d])
        numbers = self.residuals.draw(weights, entry, torch.from_numpy(uniform)).numpy()
        return np.concatenate([u[:, :d], numbers - means[:, d:]], 1)

    @property
    def weights_alone(self) -> Array:
        """Roots (K, D, D) of the covariances with next to nothing of what the residual numbers vary by themselves."""
        scale = np.ones(self.means.shape[1])
        scale[self.curves.n_weights :] = HELD_SHARE**0.5
        return self.roots * scale

    def log_ratio(self, u: Tensor) -> Array:
        """Log of the density over what proposes (n,), at (n, D); zero where both are the same."""
        if self.prior.exact is None:
            return np.zeros(len(u))
        return self.prior.log_ratio(u[:, : self.curves.n_weights]).numpy()


def latent_density(density: Density, context: Tensor = NO_CONTEXT, seed: int = 0) -> LatentDensity:
    """The density before anything was flown.

    Args:
        density: A mixture, or one that Gaussians stand in for.
        context: (1, c) if it takes one.
        seed: Of the draws to which Gaussians are fitted that stand in for a density that is no mixture.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder, latent = model.representation.decoder, latent_density(model)
        >>> d = decoder.dimension
        >>> root = model.mixture.scale_trils[0].detach().numpy()  # of the weights
        >>> bool((latent.roots[0, :d, :d] == root).all()), latent.means.shape[1] == d + decoder.residuals.n_numbers
        (True, True)
    """
    decoder, prior = density.representation.decoder, prior_of(density, seed, context)
    mixture = prior.joint(decoder.dimension + decoder.residuals.n_numbers)
    return LatentDensity(
        _numbers(mixture.probs.log()),
        _numbers(mixture.locs),
        _numbers(mixture.scale_trils),
        _sample_curves(decoder),
        prior,
        decoder.residuals,
    )


def latent_density_after(density: Density, context: Tensor, seed: int, flown: Profiles, noise: float) -> LatentDensity:
    """The density after one flight has flown some levels.

    Args:
        density: As before.
        context: (1, c) if it takes one.
        seed: As before.
        flown: One flight; its mask is true at the levels flown.
        noise: Multiple of the variance of the noise about the components.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> model = load_model("best.ckpt")
        >>> one = encode_flights(read_descents("descents.parquet").frame, model.representation)["test"].profiles
        >>> after = latent_density_after(model, None, 0, one.subset([0]), 1.0)
        >>> bool(np.linalg.norm(after.roots[0], axis=1)[:4].max() < 1)  # less is open than before
        True
    """
    decoder, prior = density.representation.decoder, prior_of(density, seed, context)
    curves = linear_curves(decoder)
    noisier = replace(curves, noise_variance=noise * curves.noise_variance)
    seen = noisier.information(decoder.drag_scale.observed(flown))
    posterior = posterior_of(prior, seen.precisions[0], seen.shift[0])
    return LatentDensity(
        _numbers(posterior.log_probs),
        _numbers(posterior.means),
        # Precision L L': the transposed inverse of L is a root of the covariance.
        _numbers(torch.linalg.inv(posterior.precision_trils).mT),
        curves,
        prior,
    )


def _sample_curves(decoder: DescentDecoder) -> LinearCurves:
    """Profiles of the weights and residual numbers of samples, without noise."""
    d, size = decoder.dimension, decoder.dimension + decoder.residuals.n_numbers
    rows = torch.cat([torch.zeros(1, size), torch.eye(size)]).to(decoder.weight_mean)
    values = torch.cat(decoder.scaled_profiles(rows[:, :d], rows[:, d:]), 1)
    return LinearCurves(values[0], (values[1:] - values[0]).T, torch.zeros_like(values[0]), d)


def _numbers(values: Tensor) -> Array:
    found: Array = values.detach().cpu().double().contiguous().numpy()
    return found
