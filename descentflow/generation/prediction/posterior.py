"""Posterior of weights and residual components: closed form under a mixture, importance resampling under a flow."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.errors import SamplingError
from descentflow.densities.density import Density
from descentflow.densities.em import fit_mixture
from descentflow.densities.mixture_parameters import NO_CONTEXT, Mixture, log_observed, posteriors
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.residuals import ResidualLine

PROPOSAL_DRAWS, PROPOSAL_COMPONENTS, WIDER = 4000, 4, 1.3
"""Draws of a flow to which the proposal is fitted, its mixture components, and the factor that widens them (tails)."""
MIN_EFFECTIVE = 50
"""Effective draws below which importance resampling is not trusted."""


@dataclass(frozen=True)
class Prior:
    """A mixture over the weights, and the density that it approximates where it is not that density itself.

    Example:
        >>> mixture = Mixture(torch.ones(1).double(), torch.zeros(1, 2).double(), torch.eye(2)[None].double())
        >>> Prior(mixture, exact=None).log_prob(torch.zeros(1, 2))  # -log(2 pi)
        tensor([-1.8379], dtype=torch.float64)
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

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of the exact density at weights (n, d)."""
        if self.exact is None:
            return log_observed(self.mixture, WeightEvidence.of_weights(weights))
        return self.exact.log_prob(weights, self.context).double()

    @torch.no_grad()
    def log_ratio(self, weights: Tensor) -> Tensor:
        """Log (n,) of the exact density over the mixture, minus infinity where it is not finite."""
        ratio = self.log_prob(weights) - log_observed(self.mixture, WeightEvidence.of_weights(weights))
        return torch.where(ratio.isfinite(), ratio, -torch.inf)


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
        plain = Mixture(*(v.detach() for v in (mixture.probs, mixture.locs, mixture.scale_trils)))
        return Prior(plain, None, context, line)
    draws = density.sample(PROPOSAL_DRAWS, seed, context)
    draws = draws[draws.isfinite().all(1)]
    fitted, _ = fit_mixture(draws, PROPOSAL_COMPONENTS, seed=seed, n_restarts=2)
    return Prior(Mixture(fitted.probs, fitted.locs, WIDER * fitted.scale_trils), density, context, line)


@dataclass(frozen=True)
class LatentPosterior:
    """Mixture of Gaussians over u = (w, r) given an observed part, weighted by a density where that is not the prior.

    Shapes: ``log_probs`` (K,), ``means`` (K, D), ``precision_trils`` (K, D, D) lower Cholesky factors of precisions.

    Example:
        >>> mixture = Mixture(torch.ones(1).double(), torch.zeros(1, 2).double(), torch.eye(2)[None].double())
        >>> posterior = posterior_of(Prior(mixture, None), 3 * torch.eye(2).double(), torch.tensor([4.0, 0.0]).double())
        >>> drawn, effective = posterior.draw(5, torch.Generator().manual_seed(0))
        >>> drawn.shape, effective
        (torch.Size([5, 2]), 5.0)
    """

    log_probs: Tensor
    means: Tensor
    precision_trils: Tensor
    prior: Prior
    n_weights: int

    def draw(self, n: int, generator: torch.Generator) -> tuple[Tensor, float]:
        """Draw (n, D), and the number of effective draws behind them.

        Raises:
            SamplingError: If what was observed has no finite density, or a density that needs weighting leaves too few
                effective draws.
        """
        if self.prior.exact is None:
            return self._mixture_draw(n, generator), float(n)
        proposed = self._mixture_draw(10 * n, generator)
        ratio = self.prior.log_ratio(proposed[:, : self.n_weights]).softmax(0)
        effective = float(1 / ratio.square().sum())
        if effective < MIN_EFFECTIVE:
            raise SamplingError(
                f"{effective:.0f} effective of {10 * n} draws: flights like this one have a low density",
                expected=f"at least {MIN_EFFECTIVE}",
                mend="draw more, or check that the flight is of the type and kind that the density was trained on",
            )
        chosen = torch.multinomial(ratio, n, replacement=True, generator=generator)
        return proposed[chosen], effective

    def _mixture_draw(self, n: int, generator: torch.Generator) -> Tensor:
        shares = self.log_probs.softmax(0)
        if not bool(shares.isfinite().all()):
            raise SamplingError(
                "what was observed of a flight is more than numbers can hold away from all that the density knows",
                expected="a flight of the type and kind that it was trained on",
                mend="look at the flight's own values",
            )
        component = torch.multinomial(shares, n, replacement=True, generator=generator)
        white = torch.randn(n, self.means.shape[1], 1, dtype=torch.float64, generator=generator)
        drawn = torch.empty(n, self.means.shape[1], dtype=torch.float64)
        for k in component.unique(sorted=True).tolist():  # type: ignore[no-untyped-call]
            here = component == k
            # Precision L L': the solution of L' x = white has its inverse as covariance.
            step = torch.linalg.solve_triangular(self.precision_trils[k].T, white[here, :, 0].T, upper=True)
            drawn[here] = self.means[k] + step.T
        return drawn


def posterior_of(prior: Prior, precision: Tensor, shift: Tensor) -> LatentPosterior:
    """Condition a prior on evidence.

    Args:
        prior: Over the d weights, with the law of the residual numbers.
        precision: (D, D) information of the observed levels, see
            :meth:`~descentflow.representation.linear_curves.LinearCurves.information`.
        shift: (D,).

    Returns:
        The posterior, each mixture component in closed form: precision ``P_k + J``, mean
        ``(P_k + J)^-1 (P_k m_k + h)``, and probability in proportion to ``p_k`` and the evidence under that component.

    Example:
        >>> mixture = Mixture(torch.ones(1).double(), torch.zeros(1, 2).double(), torch.eye(2)[None].double())
        >>> # A standard normal, observed with precision 3 at 4/3: mean 3/4 of that.
        >>> posterior_of(Prior(mixture, None), 3 * torch.eye(2).double(), torch.tensor([4.0, 0.0]).double()).means
        tensor([[1., 0.]], dtype=torch.float64)
    """
    before = prior.joint(len(shift))
    alone = WeightEvidence.of_information(precision[None], shift[None], torch.zeros(1, dtype=torch.long))
    found = posteriors(before, alone)
    means, factors = found.means[0], found.precision_trils[0]
    return LatentPosterior(found.log_joint[0].log_softmax(0), means, factors, prior, prior.mixture.locs.shape[1])
