"""A density as Gaussians over latent numbers u, of which profiles are linear: before and after a part was flown.

Before, u holds the weights and the standard normals of what samples have beyond the components. After, it holds what
:class:`~descentflow.generation.prediction.predictor.DescentPredictor` conditions: weights and the residual components
of each profile.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.densities.residual_law import ResidualLaw
from descentflow.generation.conditional.flown_profiles import Array, FlownProfiles
from descentflow.generation.conditional.latent_profiles import LatentProfiles, LinearProfile
from descentflow.generation.prediction.posterior import Prior, log_density, posterior_of, prior_of
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.linear_curves import LinearCurves
from descentflow.representation.profiles import Profiles


@dataclass(frozen=True)
class LatentParts:
    """K Gaussians over D latent numbers, and the profiles that they make.

    Attributes:
        log_probs: (K,) log of their shares.
        means: (K, D).
        roots: (K, D, D) whose products with their transposes are the covariances.
        profiles: Of drag and speed.
        n_weights: How many of u are the density's weights: the first.
        prior: What proposes and what it stands for, where the density is no mixture; None where it is.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> parts = parts_of(model, FlownProfiles(model.representation.decoder), None)
        >>> parts.means.shape[1] == 4 + model.representation.decoder.n_white
        True
    """

    log_probs: Array
    means: Array
    roots: Array
    profiles: LatentProfiles
    n_weights: int
    prior: Prior | None = None

    def log_ratio(self, u: Array) -> Array:
        """Log of the density over what proposes (n,), at (n, D); zero where both are the same."""
        if self.prior is None:
            return np.zeros(len(u))
        weights = torch.from_numpy(u[:, : self.n_weights])
        with torch.no_grad():
            ratio = self.prior.log_prob(weights) - log_density(self.prior.mixture, weights)
        return torch.where(ratio.isfinite(), ratio, -torch.inf).numpy()


def parts_of(density: Density, grid: FlownProfiles, context: Tensor | None, seed: int = 0) -> LatentParts:
    """The density before anything was flown.

    Args:
        density: A mixture, or one that Gaussians stand in for.
        grid: Of its decoder.
        context: (1, c) if it takes one.
        seed: Of the draws to which Gaussians are fitted that stand in for a density that is no mixture.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> parts, d, n_white = parts_of(model, FlownProfiles(decoder), None), decoder.dimension, decoder.n_white
        >>> root = model.mixture.scale_trils[0].detach().numpy()  # of the weights
        >>> bool((parts.roots[0, :d, :d] == root).all()), bool((parts.roots[0, d:, d:] == np.eye(n_white)).all())
        (True, True)
    """
    decoder = density.representation.decoder
    prior = prior_of(density, seed, context)
    n_weights, n_white = decoder.dimension, decoder.n_white
    mixture = prior.mixture
    known = prior.residual_law or ResidualLaw.standard(mixture.n_components, n_white, n_weights)
    law = known.first(n_white)
    roots, means = _numbers(law.joint_roots(mixture.scale_trils)), _numbers(law.joint_means(mixture.locs))
    profiles, log_probs = sample_profiles(decoder, grid), _numbers(mixture.probs.log())
    if prior.exact is None:
        return LatentParts(log_probs, means, roots, profiles, n_weights)
    return LatentParts(log_probs, means, roots, profiles, n_weights, prior)


def parts_after(
    decoder: DescentDecoder,
    curves: LinearCurves,
    prior: Prior,
    grid: FlownProfiles,
    flown: Profiles,
    noise_multiple: float,
) -> LatentParts:
    """The density after one flight has flown some levels.

    Args:
        decoder: Whose components the weights are of.
        curves: Of the decoder.
        prior: Of the density, see :func:`~descentflow.generation.prediction.posterior.prior_of`.
        grid: Of the decoder.
        flown: One flight; its mask is true at the levels flown.
        noise_multiple: Of the variance of the noise about the components.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.representation.linear_curves import linear_curves
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> model = load_model("best.ckpt")
        >>> decoder, prior = model.representation.decoder, prior_of(model)
        >>> one = encode_flights(read_descents("descents.parquet").frame, model.representation)["test"].profiles
        >>> after = parts_after(decoder, linear_curves(decoder), prior, FlownProfiles(decoder), one.subset([0]), 1.0)
        >>> bool(np.linalg.norm(after.roots[0], axis=1)[:4].max() < 1)  # less is open than before
        True
    """
    noisier = replace(curves, noise_variance=noise_multiple * curves.noise_variance)
    seen = noisier.information(decoder.drag_scale.observed(flown))
    posterior = posterior_of(prior, seen.precisions[0], seen.shift[0])
    # Precision L L': the transposed inverse of L is a root of the covariance.
    roots = torch.linalg.inv(posterior.precision_trils).mT
    loadings, offset = _numbers(curves.loadings), _numbers(curves.offset)
    drag, cas = (
        LinearProfile(grid.columns(offset[part]), grid.columns(loadings[part].T))
        for part in np.split(np.arange(len(offset)), 2)
    )
    return LatentParts(
        _numbers(posterior.log_probs),
        _numbers(posterior.means),
        np.ascontiguousarray(_numbers(roots)),
        LatentProfiles(drag, cas),
        curves.n_weights,
        prior if prior.exact is not None else None,
    )


def sample_profiles(decoder: DescentDecoder, grid: FlownProfiles) -> LatentProfiles:
    """Profiles of samples: of the weights, and of the standard normals of what lies beyond the components.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> decoder = load_representation("best.ckpt").decoder
        >>> profiles = sample_profiles(decoder, FlownProfiles(decoder))
        >>> profiles.drag.loadings.shape == profiles.cas.loadings.shape
        True
    """
    d, n_white = decoder.dimension, decoder.n_white
    rows = torch.cat([torch.zeros(1, d + n_white), torch.eye(d + n_white)]).to(decoder.weight_mean)
    lines = []
    for values in decoder.profiles(rows[:, :d], rows[:, d:]):
        offset, loadings = _numbers(values[0]), _numbers(values[1:] - values[0])
        lines.append(LinearProfile(grid.columns(offset), grid.columns(loadings)))
    return LatentProfiles(*lines)


def _numbers(values: Tensor) -> Array:
    found: Array = values.detach().cpu().double().numpy()
    return found
