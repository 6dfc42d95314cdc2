r"""A Gaussian mixture whose means and proportions may follow a context, and what observed levels say under it.

With a mixture $\sum_k \pi_k N(w; m_k, V_k)$ and a flight's log-likelihood $-(w - p)^T A (w - p) / 2$, everything is
in closed form (Bovy, Hogg and Roweis 2011, doi:10.1214/10-AOAS439): the posterior of component k has the covariance
$C = (V_k^{-1} + A)^{-1}$ and the mean $m_k + C A (p - m_k)$.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.representation.evidence import Evidence


@dataclass(frozen=True)
class Mixture:
    """``p(w | c) = sum_k pi_k(c) N(w; loc_k + slope_k c, S_k)`` with ``pi(c) = softmax(log p + gate c)``.

    A mixture of linear regressions (Jacobs et al. 1991, doi:10.1162/neco.1991.3.1.79); without a context, the Gaussian
    mixture of the paper (section 2.3).

    Args:
        probs: (k,) mixing proportions, at context zero where there is a context.
        locs: (k, d) means, at context zero.
        scale_trils: (k, d, d) lower Cholesky factors of the covariances.
        slopes: (k, d, c) change of the means with the context; None without a context.
        gate: (k, c) change of the log proportions with the context; None without a context.

    Example:
        >>> line = Mixture(torch.ones(1), torch.zeros(1, 2), torch.eye(2)[None], torch.ones(1, 2, 1), torch.zeros(1, 1))
        >>> line.at(torch.tensor([3.0])).locs
        tensor([[3., 3.]])
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor
    slopes: Tensor | None = None
    gate: Tensor | None = None

    @property
    def n_components(self) -> int:
        """Number of mixture components k."""
        return len(self.probs)

    def cpu(self) -> "Mixture":
        """The same parameters on the CPU, without their graph."""
        line = (None if one is None else one.detach().cpu() for one in (self.slopes, self.gate))
        return Mixture(*(one.detach().cpu() for one in (self.probs, self.locs, self.scale_trils)), *line)

    def at(self, context: Tensor) -> "Mixture":
        """The Gaussian mixture at one context (c,)."""
        if self.slopes is None or self.gate is None:
            return self
        probs = (self.probs.log() + self.gate @ context).softmax(0)
        return Mixture(probs, self.locs + self.slopes @ context, self.scale_trils)


def n_parameters(n_components: int, dimension: int, n_context: int = 0) -> int:
    """Free parameters of a mixture of full Gaussians (paper, appendix C), and the slopes of means and proportions.

    Example:
        >>> n_parameters(16, 15)
        2175
    """
    plain = n_components * dimension * (dimension + 3) // 2 + n_components - 1
    return plain + n_context * (n_components * dimension + n_components - 1)


@dataclass(frozen=True)
class FlightPosteriors:
    """Of n flights under each of k mixture components.

    Attributes:
        log_joint: (n, k) log of proportion times marginal likelihood, see :func:`log_observed`.
        means: (n, k, d) of the weights given what was observed.
        covariances: (U, k, d, d), one for each matrix of the evidence.

    Example:
        >>> mixture = Mixture(torch.ones(1), torch.zeros(1, 1), torch.ones(1, 1, 1))
        >>> evidence = Evidence(torch.tensor([[4.0]]), torch.tensor([0]), torch.tensor([[[3.0]]]))
        >>> found = posteriors(mixture, evidence)  # standard normal, seen at 4 with precision 3
        >>> round(float(found.means), 4), round(float(found.covariances), 4)
        (3.0, 0.25)
    """

    log_joint: Tensor
    means: Tensor
    covariances: Tensor


def posteriors(mixture: Mixture, evidence: Evidence, context: Tensor | None = None) -> FlightPosteriors:
    """Posterior of each flight's weights under each mixture component.

    Args:
        mixture: k components.
        evidence: Of n flights whose weights are not known; all are held at once.
        context: (n, c) where means and proportions follow one.
    """
    precision = torch.cholesky_inverse(mixture.scale_trils)
    factor = torch.linalg.cholesky(precision + evidence.precisions[:, None])
    covariances = torch.cholesky_inverse(factor)
    group, locs = evidence.group, locations(mixture, context)
    off = evidence.points[:, None] - locs  # (n, k, d)
    if context is None:
        pulled = evidence.shift[:, None] - (evidence.precisions[:, None] @ locs[..., None])[group, ..., 0]
    else:
        pulled = off @ evidence.precisions[group]
    moved = (covariances[group] @ pulled[..., None])[..., 0]
    log_det = (factor.diagonal(dim1=-2, dim2=-1).log() + mixture.scale_trils.diagonal(dim1=-2, dim2=-1).log()).sum(-1)
    fit = -0.5 * (pulled * (off - moved)).sum(-1) - log_det[group]
    log_joint = log_proportions(mixture, context) + fit + evidence.log_scale[:, None]
    return FlightPosteriors(log_joint, locs + moved, covariances)


def log_observed(mixture: Mixture, evidence: Evidence, context: Tensor | None = None) -> Tensor:
    r"""Log-likelihood (n,) of what was observed, in nats: $\log \int p(w) \, p(y | w) \, dw$ up to a constant.

    The constant depends on the levels that a flight shows and on no density
    (:attr:`~descentflow.representation.evidence.Evidence.log_scale`); with it the score of a flight whose weights are
    known is the log density of the weights.

    Args:
        mixture: Of the weights.
        evidence: Of n flights.
        context: (n, c) where means and proportions follow one.

    Example:
        >>> mixture = Mixture(torch.ones(1), torch.zeros(1, 2), torch.eye(2)[None])
        >>> nothing_seen = Evidence(torch.zeros(1, 2), torch.tensor([0]), torch.zeros(1, 2, 2))
        >>> float(log_observed(mixture, nothing_seen)), round(float(log_observed(mixture, Evidence.of_weights(
        ...     torch.zeros(1, 2)))), 4)  # and the log density at the origin
        (0.0, -1.8379)
    """
    parts, order = [], []
    for index, rows in evidence.chunks():
        given = None if context is None else context[index]
        joint = _joint_of_known(mixture, rows, given) if rows.known else posteriors(mixture, rows, given).log_joint
        parts.append(joint.logsumexp(1))
        order.append(index)
    if not parts:
        return mixture.probs.new_zeros(0)
    return torch.cat(parts)[torch.cat(order).argsort()]


def locations(mixture: Mixture, context: Tensor | None) -> Tensor:
    """Means (1, k, d) of the components, or (n, k, d) where they follow a context.

    Example:
        >>> locations(Mixture(torch.ones(1), torch.zeros(1, 2), torch.eye(2)[None]), None).shape
        torch.Size([1, 1, 2])
    """
    if context is None or mixture.slopes is None:
        return mixture.locs[None]
    return mixture.locs + torch.einsum("nc,kdc->nkd", context.to(mixture.slopes), mixture.slopes)


def log_proportions(mixture: Mixture, context: Tensor | None) -> Tensor:
    """Log mixing proportions (1, k), or (n, k) where they follow a context.

    Example:
        >>> half = torch.full((2,), 0.5)
        >>> log_proportions(Mixture(half, torch.zeros(2, 1), torch.ones(2, 1, 1)), None).exp()
        tensor([[0.5000, 0.5000]])
    """
    if context is None or mixture.gate is None:
        return mixture.probs.log()[None]
    return (mixture.probs.log() + context.to(mixture.gate) @ mixture.gate.T).log_softmax(1)


def _joint_of_known(mixture: Mixture, evidence: Evidence, context: Tensor | None) -> Tensor:
    normals = torch.distributions.MultivariateNormal(
        locations(mixture, context), scale_tril=mixture.scale_trils, validate_args=False
    )
    densities: Tensor = normals.log_prob(evidence.points[:, None].to(mixture.locs))  # type: ignore[no-untyped-call]
    return log_proportions(mixture, context) + densities
