r"""A Gaussian mixture whose means and proportions may follow a context, and what observed levels say under it.

With a mixture $\sum_k \pi_k N(w; m_k, V_k)$ and a flight's log-likelihood $-(w - p)^T A (w - p) / 2$, everything is
in closed form (Bovy, Hogg and Roweis 2011, doi:10.1214/10-AOAS439): the posterior of component k has the covariance
$C = (V_k^{-1} + A)^{-1}$ and the mean $m_k + C A (p - m_k)$.
"""

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from descentflow.representation.evidence import WeightEvidence

NO_CONTEXT = torch.zeros(1, 0)
"""Context (1, c) of a flight for a density that follows none."""
MOST_TAKEN = 0.9
"""Of the variance along one direction, and of a component, the most that one flight is taken for."""


@dataclass(frozen=True)
class Mixture:
    """``p(w | c) = sum_k pi_k(c) N(w; loc_k + slope_k c, S_k)`` with ``pi(c) = softmax(log p + gate c)``.

    A mixture of linear regressions (Jacobs et al. 1991, doi:10.1162/neco.1991.3.1.79); without a context, the Gaussian
    mixture of the paper (section 2.3).

    Args:
        probs: (k,) mixing proportions, at context zero where there is a context.
        locs: (k, d) means, at context zero.
        scale_trils: (k, d, d) lower Cholesky factors of the covariances.
        slopes: (k, d, c) change of the means with the context; c is 0 without one.
        gate: (k, c) change of the log proportions with the context.

    Example:
        >>> line = Mixture(torch.ones(1), torch.zeros(1, 2), torch.eye(2)[None], torch.ones(1, 2, 1), torch.zeros(1, 1))
        >>> line.at(torch.tensor([3.0])).locs
        tensor([[3., 3.]])
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor
    slopes: Tensor = NO_CONTEXT
    gate: Tensor = NO_CONTEXT

    def __post_init__(self) -> None:
        if not self.slopes.numel():
            object.__setattr__(self, "slopes", self.locs.new_zeros(*self.locs.shape, 0))
            object.__setattr__(self, "gate", self.locs.new_zeros(len(self.locs), 0))

    @property
    def n_components(self) -> int:
        """Number of mixture components k."""
        return len(self.probs)

    def cpu(self) -> "Mixture":
        """The same parameters on the CPU, without their graph."""
        return Mixture(*(getattr(self, field.name).detach().cpu() for field in fields(self)))

    def at(self, context: Tensor) -> "Mixture":
        """The Gaussian mixture at one context (c,)."""
        probs = (self.probs.log() + self.gate @ context).softmax(0)
        return Mixture(probs, self.locs + self.slopes @ context, self.scale_trils)

    def rows(self, context: Tensor | None, n: int) -> Tensor:
        """Context (n, c) of n flights, zero where none is given; a mixture that follows none takes none of it."""
        c = self.slopes.shape[2]
        return self.locs.new_zeros(n, c) if context is None else context[:, :c].to(self.locs)


def n_parameters(n_components: int, dimension: int, n_context: int = 0, *, shared: bool = False) -> int:
    """Free parameters of a mixture of full Gaussians (paper, appendix C), and the slopes of means and proportions.

    Args:
        n_components: Number of mixture components.
        dimension: Of the weights.
        n_context: Numbers of context.
        shared: Whether all components have one covariance.

    Example:
        >>> n_parameters(16, 15), n_parameters(16, 15, shared=True)
        (2175, 375)
    """
    covariances = (1 if shared else n_components) * dimension * (dimension + 1) // 2
    return covariances + (n_components * (dimension + 1) - 1) * (1 + n_context)


@dataclass(frozen=True)
class FlightPosteriors:
    """Of n flights under each of k mixture components.

    Attributes:
        log_joint: (n, k) log of proportion times marginal likelihood, see :func:`log_observed`.
        means: (n, k, d) of the weights given what was observed.
        covariances: (U, k, d, d), one for each matrix of the evidence.
        precision_trils: (U, k, d, d) lower Cholesky factors of their inverses.

    Example:
        >>> mixture = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> evidence = WeightEvidence(torch.tensor([[4.0]]), torch.tensor([0]), torch.tensor([[[3.0]]]))
        >>> given_seen = posteriors(mixture, evidence)  # standard normal, seen at 4 with precision 3
        >>> round(float(given_seen.means), 4), round(float(given_seen.covariances), 4)
        (3.0, 0.25)
    """

    log_joint: Tensor
    means: Tensor
    covariances: Tensor
    precision_trils: Tensor


def posteriors(mixture: Mixture, evidence: WeightEvidence, context: Tensor | None = None) -> FlightPosteriors:
    """Posterior of each flight's weights under each mixture component.

    Args:
        mixture: k components.
        evidence: Of n flights whose weights are not known; all are held at once.
        context: (n, c) where means and proportions follow one.
    """
    precision = torch.cholesky_inverse(mixture.scale_trils)
    factor = torch.linalg.cholesky(precision + evidence.precisions[:, None])
    covariances = torch.cholesky_inverse(factor)
    given, group, precisions = mixture.rows(context, len(evidence)), evidence.group, evidence.precisions[:, None]
    locs = locations(mixture, given)
    off = evidence.points[:, None] - locs  # (n, k, d)
    # Of the flights of one matrix at once, as far as their means do not differ by context.
    pulled = evidence.shift[:, None] - (precisions @ mixture.locs[..., None])[group, ..., 0]
    pulled = pulled - ((precisions @ mixture.slopes)[group] @ given[:, None, :, None])[..., 0]
    moved = (covariances[group] @ pulled[..., None])[..., 0]
    log_det = (factor.diagonal(dim1=-2, dim2=-1).log() + mixture.scale_trils.diagonal(dim1=-2, dim2=-1).log()).sum(-1)
    fit = -0.5 * (pulled * (off - moved)).sum(-1) - log_det[group]
    log_joint = log_proportions(mixture, given) + fit + evidence.log_scale[:, None]
    return FlightPosteriors(log_joint, locs + moved, covariances, factor)


def log_observed(mixture: Mixture, evidence: WeightEvidence, context: Tensor | None = None) -> Tensor:
    r"""Log-likelihood (n,) of what was observed, in nats: $\log \int p(w) \, p(y | w) \, dw$ up to a constant.

    The constant depends on the levels that a flight shows and on no density
    (:attr:`~descentflow.representation.evidence.WeightEvidence.log_scale`); with it the score of a flight whose weights
    are known is the log density of the weights.

    Args:
        mixture: Of the weights.
        evidence: Of n flights.
        context: (n, c) where means and proportions follow one.

    Example:
        >>> mixture = Mixture(torch.ones(1), torch.zeros(1, 2), torch.eye(2)[None])
        >>> nothing_seen = WeightEvidence(torch.zeros(1, 2), torch.tensor([0]), torch.zeros(1, 2, 2))
        >>> float(log_observed(mixture, nothing_seen)), round(float(log_observed(mixture, WeightEvidence.of_weights(
        ...     torch.zeros(1, 2)))), 4)  # and the log density at the origin
        (0.0, -1.8379)
    """
    given, parts, order = mixture.rows(context, len(evidence)), [], []
    for index, rows in evidence.chunks():
        seen = (mixture, rows, given[index])
        parts.append((_joint_of_known(*seen) if rows.known else posteriors(*seen).log_joint).logsumexp(1))
        order.append(index)
    if not parts:
        return mixture.probs.new_zeros(0)
    return torch.cat(parts)[torch.cat(order).argsort()]


def without_flight(mixture: Mixture, weights: Tensor, n_flights: int) -> Mixture:
    """A mixture fitted to n flights less one of them: exact of one Gaussian, else the last step of EM without it.

    Args:
        mixture: Without a context, float64. Where components share one covariance, so do those of the result.
        weights: (1, d) of the flight.
        n_flights: Flights that the mixture was fitted to, two at least.

    Example:
        >>> one = torch.ones(1).double()
        >>> of_two = Mixture(one, one[None], 2 * one[None, None])  # of -1 and 3
        >>> without_flight(of_two, 3 * one[None], 2).locs.item()
        -1.0
    """
    known = WeightEvidence.of_weights(weights)
    share = _joint_of_known(mixture, known, known.points[:, :0])[0].softmax(0)
    lost = (share / n_flights / mixture.probs).clamp(max=MOST_TAKEN)
    left, off = 1 - lost, known.points - mixture.locs
    probs, locs = mixture.probs * left, mixture.locs - (lost / left)[:, None] * off
    white = torch.linalg.solve_triangular(mixture.scale_trils, off[..., None], upper=False)
    taken = torch.minimum(lost / left, MOST_TAKEN / white.square().sum((1, 2)))[:, None, None] * white @ white.mT
    if bool((mixture.scale_trils == mixture.scale_trils[:1]).all()):
        taken, left = (mixture.probs[:, None, None] * taken).sum(0), probs.sum().expand(len(probs))
    kept = torch.linalg.cholesky((torch.eye(len(off.T)).to(off) - taken) / left[:, None, None])
    return Mixture(probs / probs.sum(), locs, mixture.scale_trils @ kept)


def locations(mixture: Mixture, context: Tensor) -> Tensor:
    """Means (n, k, d) of the components at contexts (n, c).

    Example:
        >>> locations(Mixture(torch.ones(1), torch.zeros(1, 3), torch.eye(3)[None]), torch.zeros(5, 0)).shape
        torch.Size([5, 1, 3])
    """
    return mixture.locs + torch.einsum("nc,kdc->nkd", context, mixture.slopes)


def log_proportions(mixture: Mixture, context: Tensor) -> Tensor:
    """Log mixing proportions (n, k) at contexts (n, c).

    Example:
        >>> log_proportions(Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1)), torch.zeros(1, 0))
        tensor([[0.]])
    """
    return (mixture.probs.log() + context @ mixture.gate.T).log_softmax(1)


def _joint_of_known(mixture: Mixture, evidence: WeightEvidence, context: Tensor) -> Tensor:
    normals = torch.distributions.MultivariateNormal(
        locations(mixture, context), scale_tril=mixture.scale_trils, validate_args=False
    )
    densities: Tensor = normals.log_prob(evidence.points[:, None].to(mixture.locs))  # type: ignore[no-untyped-call]
    return log_proportions(mixture, context) + densities


def cholesky_or_small(covariance: Tensor, jitter: float) -> Tensor:
    """Lower Cholesky factors (..., d, d) of covariances whose variances are raised by ``jitter``.

    A mixture component that has lost its flights becomes round and small instead of stopping the fit.

    Example:
        >>> cholesky_or_small(torch.full((1, 1), -4.0), jitter=0.25)
        tensor([[0.5000]])
    """
    eye = torch.eye(covariance.shape[-1], dtype=covariance.dtype, device=covariance.device)
    factor, failed = torch.linalg.cholesky_ex(covariance + jitter * eye)
    return torch.where(failed[..., None, None] > 0, jitter**0.5 * eye, factor)
