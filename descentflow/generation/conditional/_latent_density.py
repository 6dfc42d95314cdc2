"""A density as Gaussians over latent numbers u, of which profiles are linear: before and after a part was flown.

Before, u holds the weights and the residual numbers of samples. After, it holds weights and the residual components of
each profile: drag and CAS on the flown levels are linear in them (paper, equation 4), so that what was flown conditions
each Gaussian in closed form. Where Gaussians only stand in for a density, their draws are weighted by it.
"""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from descentflow.core.errors import SamplingError
from descentflow.densities.density import Density
from descentflow.densities.em import fit_mixture
from descentflow.densities.importance import widened
from descentflow.densities.mixture_parameters import NO_CONTEXT, Mixture, log_observed, posteriors, without_flight
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.linear_curves import LinearCurves, linear_curves
from descentflow.representation.profiles import Profiles
from descentflow.representation.residuals import ResidualLine, Residuals

Array = NDArray[np.float64]
HELD_SHARE = 1e-3
"""Of the variance of residual numbers, by which they give where weights alone cannot meet a request."""
PROPOSAL_DRAWS, PROPOSAL_COMPONENTS = 4000, 4
"""Draws of a flow to which the proposal is fitted, and its mixture components."""
PROPOSED_FOR_ONE = 10
"""Draws of the proposal for each that is wanted of such a density."""
MIN_EFFECTIVE = 50
"""Effective draws below which importance resampling is not trusted."""


@dataclass(frozen=True)
class Prior:
    """A mixture over the weights, and the density that it approximates where it is not that density itself.

    Example:
        >>> mixture = Mixture(torch.ones(1).double(), torch.zeros(1, 2).double(), torch.eye(2)[None].double())
        >>> Prior(mixture, exact=None).joint(3).locs.shape  # and one residual number
        torch.Size([1, 3])
    """

    mixture: Mixture
    exact: Density | None
    """None where the mixture is the density itself."""
    context: Tensor = NO_CONTEXT
    """Context of the exact density, (1, c)."""
    residual: ResidualLine | None = None
    """Of the residual numbers given the weights; standard normals where it is None."""

    def joint(self, size: int) -> Mixture:
        """The mixture over ``size`` numbers u = (w, r)."""
        d = self.mixture.locs.shape[1]
        line = self.residual or ResidualLine.standard(size - d, d)
        return Mixture(
            self.mixture.probs, line.joint_means(self.mixture.locs), line.joint_roots(self.mixture.scale_trils)
        )


def prior_of(density: Density, seed: int = 0, context: Tensor = NO_CONTEXT) -> Prior:
    """Take a density apart for conditioning; a conditional one is first given its context (1, c).

    A Gaussian and a mixture of Gaussians are themselves. Anything else is approximated by a mixture fitted to its
    draws, whose components are widened: it only proposes, and its draws are weighted by the density.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> prior_of(load_model("best.ckpt")).exact is None  # a Gaussian stands for itself
        True
    """
    mixture, residuals = density.mixture_at(context), density.representation.decoder.residuals
    line = residuals.line if residuals.n_numbers else None
    if mixture is not None:
        return Prior(mixture.cpu(), None, context, line)
    draws = density.sample(PROPOSAL_DRAWS, seed, context)
    draws = draws[draws.isfinite().all(1)]
    fitted, _ = fit_mixture(draws, PROPOSAL_COMPONENTS, seed=seed, n_restarts=2)
    return Prior(widened(fitted), density, context, line)


@dataclass(frozen=True)
class LatentDensity:
    """K Gaussians over D latent numbers, and the profiles that they make.

    Attributes:
        log_probs: (K,) log of their shares.
        means: (K, D).
        roots: (K, D, D) whose products with their transposes are the covariances.
        prior: What proposes, and the density that it stands for where that is no mixture.
        curves: Drag on the decoder's scale and CAS (m/s) as functions of u, whose first numbers are the weights.
        residuals: What residual numbers are drawn of, given the weights; None where they are Gaussian.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> latent = LatentDensities(load_model("best.ckpt")).before()
        >>> offset, loadings = latent.cas
        >>> u = torch.randn(3, latent.means.shape[1]).double()
        >>> np.allclose(offset + u.numpy() @ loadings, latent.curves.scaled_profiles(u)[1])
        True
    """

    log_probs: Array
    means: Array
    roots: Array
    prior: Prior
    curves: LinearCurves
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

    @torch.no_grad()
    def log_ratio(self, u: Tensor) -> Array:
        """Log of the density over what proposes (n,), at (n, D): zero where both are the same."""
        prior, weights = self.prior, u[:, : self.curves.n_weights]
        if prior.exact is None:
            return np.zeros(len(u))
        proposed = log_observed(prior.mixture, WeightEvidence.of_weights(weights))
        ratio = prior.exact.log_prob(weights, prior.context).double() - proposed
        return _numbers(torch.where(ratio.isfinite(), ratio, -torch.inf))

    def draw(self, n: int, generator: torch.Generator) -> tuple[Tensor, float]:
        """Draw (n, D), and the number of effective draws behind them.

        Raises:
            SamplingError: If what was observed has no finite density, or a density that needs weighting leaves too few
                effective draws.
        """
        if self.prior.exact is None:
            return self._proposed(n, generator), float(n)
        proposed = self._proposed(PROPOSED_FOR_ONE * n, generator)
        shares = torch.from_numpy(self.log_ratio(proposed)).softmax(0)
        effective = float(1 / shares.square().sum())
        if effective < MIN_EFFECTIVE:
            raise SamplingError(
                f"{effective:.0f} effective of {len(shares)} draws: flights like this one have a low density",
                expected=f"at least {MIN_EFFECTIVE}",
                mend="draw more, or check that the flight is of the type and kind that the density was trained on",
            )
        chosen = torch.multinomial(shares, n, replacement=True, generator=generator)
        return proposed[chosen], effective

    def _proposed(self, n: int, generator: torch.Generator) -> Tensor:
        shares = torch.from_numpy(self.log_probs).softmax(0)
        if not bool(shares.isfinite().all()):
            raise SamplingError(
                "what was observed of a flight is more than numbers can hold away from all that the density knows",
                expected="a flight of the type and kind that it was trained on",
                mend="look at the flight's own values",
            )
        component = torch.multinomial(shares, n, replacement=True, generator=generator)
        drawn = torch.randn(n, self.means.shape[1], dtype=torch.float64, generator=generator)
        for k, (mean, root) in enumerate(zip(self.means, self.roots, strict=True)):
            here = component == k
            drawn[here] = torch.from_numpy(mean) + drawn[here] @ torch.from_numpy(root).T
        return drawn


def posterior_of(prior: Prior, precision: Tensor, shift: Tensor, curves: LinearCurves) -> LatentDensity:
    """Condition a prior on evidence.

    Args:
        prior: Over the d weights, with the law of the residual numbers.
        precision: (D, D) information of the observed levels, see
            :meth:`~descentflow.representation.linear_curves.LinearCurves.information`.
        shift: (D,).
        curves: Profiles of u.

    Returns:
        Each mixture component in closed form: precision ``P_k + J``, mean ``(P_k + J)^-1 (P_k m_k + h)``, and
        probability in proportion to ``p_k`` and the evidence under that component.

    Example:
        >>> mixture = Mixture(torch.ones(1).double(), torch.zeros(1, 2).double(), torch.eye(2)[None].double())
        >>> curves = LinearCurves(torch.zeros(2).double(), torch.eye(2).double(), torch.ones(2).double(), 2)
        >>> # A standard normal, observed with precision 3 at 4/3: mean 3/4 of that.
        >>> evidence = 3 * torch.eye(2).double(), torch.tensor([4.0, 0.0]).double()
        >>> posterior = posterior_of(Prior(mixture, None), *evidence, curves)
        >>> drawn, effective = posterior.draw(5, torch.Generator().manual_seed(0))
        >>> posterior.means, drawn.shape, effective
        (array([[1., 0.]]), torch.Size([5, 2]), 5.0)
    """
    alone = WeightEvidence.of_information(precision[None], shift[None], torch.zeros(1, dtype=torch.long))
    given = posteriors(prior.joint(len(shift)), alone)
    # Precision L L': the transposed inverse of L is a root of the covariance.
    roots = torch.linalg.inv(given.precision_trils[0]).mT
    log_probs = given.log_joint[0].log_softmax(0)
    return LatentDensity(_numbers(log_probs), _numbers(given.means[0]), _numbers(roots), prior, curves)


class LatentDensities:
    """A density as Gaussians given contexts and flown parts; what several requests have in common is computed once.

    Args:
        density: A mixture, or one that Gaussians stand in for.
        seed: Of the draws to which Gaussians are fitted that stand in for a density that is no mixture.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> model = load_model("best.ckpt")
        >>> latent, d = LatentDensities(model), model.dimension
        >>> root = model.mixture.scale_trils[0].detach().numpy()  # of the weights
        >>> bool((latent.before().roots[0, :d, :d] == root).all())
        True
        >>> one = encode_flights(read_descents("descents.parquet").frame, model.representation)["test"].profiles
        >>> after = latent.after(one.subset([0]))
        >>> bool(np.linalg.norm(after.roots[0], axis=1)[:4].max() < 1)  # less is open than before
        True
    """

    def __init__(self, density: Density, seed: int = 0) -> None:
        """Hold the density, and no prior yet."""
        self.density, self.seed = density, seed
        self.decoder: DescentDecoder = density.representation.decoder
        self._priors: dict[tuple[float, ...], Prior] = {}
        self._before: dict[tuple[float, ...], LatentDensity] = {}

    @cached_property
    def curves(self) -> LinearCurves:
        """Profiles of weights and residual components, with the noise about them.

        Raises:
            ConfigError: If the components were fitted by the paper's iteration.
        """
        return linear_curves(self.decoder)

    def _prior(self, context: Tensor) -> tuple[tuple[float, ...], Prior]:
        key = tuple(context.flatten().tolist())
        if key not in self._priors:
            self._priors[key] = prior_of(self.density, self.seed, context)
        return key, self._priors[key]

    def without(self, weights: Tensor, n_flights: int, context: Tensor) -> "LatentDensities":
        """As fitted to the others of n flights, for one of them; as they are if the density is no mixture.

        Args:
            weights: (1, d) of the flight.
            n_flights: Flights that the density was fitted to.
            context: (1, c) of the flight; the result knows no other.
        """
        key, prior = self._prior(context)
        others = copy(self)
        if prior.exact is None:
            others._priors = {key: replace(prior, mixture=without_flight(prior.mixture, weights, n_flights))}
        return others

    def before(self, context: Tensor = NO_CONTEXT) -> LatentDensity:
        """The density before anything was flown, given a context (1, c) if it takes one."""
        key, prior = self._prior(context)
        if key not in self._before:
            residuals = self.decoder.residuals
            joint = prior.joint(self.decoder.dimension + residuals.n_numbers)
            log_probs, means, roots = map(_numbers, (joint.probs.log(), joint.locs, joint.scale_trils))
            curves = _sample_curves(self.decoder)
            self._before[key] = LatentDensity(log_probs, means, roots, prior, curves, residuals)
        return self._before[key]

    def after(self, flown: Profiles, context: Tensor = NO_CONTEXT, noise: float = 1.0) -> LatentDensity:
        """The density after one flight has flown the levels at which its mask is true.

        Args:
            flown: One flight on the decoder's grid.
            context: As before.
            noise: Multiple of the variance of the noise about the components.
        """
        noisier = replace(self.curves, noise_variance=noise * self.curves.noise_variance)
        seen = noisier.information(self.decoder.drag_scale.observed(flown))
        return posterior_of(self._prior(context)[1], seen.precisions[0], seen.shift[0], self.curves)


def _sample_curves(decoder: DescentDecoder) -> LinearCurves:
    """Profiles of the weights and residual numbers of samples, without noise."""
    d, size = decoder.dimension, decoder.dimension + decoder.residuals.n_numbers
    rows = torch.cat([torch.zeros(1, size), torch.eye(size)]).to(decoder.weight_mean)
    values = torch.cat(decoder.scaled_profiles(rows[:, :d], rows[:, d:]), 1)
    return LinearCurves(values[0], (values[1:] - values[0]).T, torch.zeros_like(values[0]), d)


def _numbers(values: Tensor) -> Array:
    array: Array = values.detach().cpu().double().contiguous().numpy()
    return array
