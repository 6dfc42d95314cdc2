"""One step of expectation maximisation for flights whose weights are not known: extreme deconvolution.

Bovy, Hogg and Roweis 2011 (doi:10.1214/10-AOAS439): the E step gives, beside the responsibilities, the posterior mean
and covariance of each flight's weights under each component; the M step takes them in place of the weights. With a
context the means are regressed on it, as in :mod:`descentflow.densities.regression_steps`.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from descentflow.densities.em_steps import Steps
from descentflow.densities.gaussian_steps import JITTER, GaussianSteps, cholesky_or_small
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.observed import posteriors
from descentflow.densities.regression_steps import RIDGE, Gate, RegressionSteps
from descentflow.representation.evidence import Evidence

ONE_GAUSSIAN_STEPS, ONE_GAUSSIAN_TOLERANCE = 1000, 1e-9
"""Steps of a single Gaussian at most, and the gain (nats per flight) at which they end."""


@dataclass(frozen=True)
class _Moments:
    """Sums over flights, weighted by responsibilities, of x = (1, context), of w, and of their products.

    Shapes: ``xx`` (k, 1 + c, 1 + c), ``xw`` (k, 1 + c, d), ``ww`` (k, d, d).
    """

    xx: Tensor
    xw: Tensor
    ww: Tensor


class EvidenceSteps(Steps):
    """The steps of a mixture, with or without a context, by marginal likelihood.

    Example:
        >>> points = torch.tensor([[0.0], [1.0], [10.0], [11.0]]).double()
        >>> blurred = Evidence(points, torch.zeros(4, dtype=torch.long), torch.full((1, 1, 1), 4.0).double())
        >>> steps = EvidenceSteps(blurred)  # each seen with variance 1/4
        >>> round(float(steps.single.scale_trils) ** 2, 3)  # variance of the points less that
        25.0
    """

    def __init__(
        self, evidence: Evidence, context: Tensor | None = None, *, ridge: float = RIDGE, jitter: float = JITTER
    ) -> None:
        """Take the training flights.

        Args:
            evidence: Of n flights whose weights are not known.
            context: (n, c) encoded context, if there is one.
            ridge: How many flights the prior of zero slopes counts as.
            jitter: Added to the variances.
        """
        self.evidence, self.ridge, self.jitter = evidence, ridge, jitter
        self.context = None if context is None else context.to(torch.float64)
        ones = torch.ones_like(evidence.points[:, :1])
        self.design = ones if self.context is None else torch.cat([ones, self.context], 1)
        self._chunks = list(evidence.chunks())
        self._gate = None if self.context is None else Gate(self.context)

    @cached_property
    def single(self) -> Mixture:
        """The one Gaussian of greatest marginal likelihood."""
        d, like = self.evidence.points.shape[1], self.evidence.points
        line = () if self.context is None else (like.new_zeros(1, d, self.context.shape[1]), self.context[:1] * 0.0)
        eye = torch.eye(d, dtype=like.dtype, device=like.device)[None]
        one, before = Mixture(like.new_ones(1), like.new_zeros(1, d), eye, *line), -float("inf")
        for _ in range(ONE_GAUSSIAN_STEPS):
            one, likelihood = self.improve(one)
            if likelihood - before < ONE_GAUSSIAN_TOLERANCE:
                break
            before = likelihood
        return one

    def stand_in(self, seed: int) -> Steps:
        """Weights drawn given what was observed, under the single Gaussian: steps of them are in closed form.

        Unlike expected weights, the draws of gappy flights are spread as widely as those of complete ones.
        """
        generator = torch.Generator().manual_seed(seed)
        white = torch.randn(self.evidence.points.shape, generator=generator, dtype=torch.float64)
        drawn = torch.empty_like(self.evidence.points)
        for index, rows in self._chunks:
            found = posteriors(self.single, rows, None if self.context is None else self.context[index])
            factor = cholesky_or_small(found.covariances[:, 0], 1e-12)
            noise = (factor[rows.group] @ white[index].to(drawn)[:, :, None])[:, :, 0]
            drawn[index] = found.means[:, 0] + noise
        return GaussianSteps(drawn) if self.context is None else RegressionSteps(drawn, self.context)

    def points_to_group(self, seed: int) -> Tensor:
        """What k-means starts from: the weights expected under the single Gaussian (n, d)."""
        means = torch.empty_like(self.evidence.points)
        for index, rows in self._chunks:
            means[index] = posteriors(self.single, rows, None if self.context is None else self.context[index]).means[
                :, 0
            ]
        return means

    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times marginal likelihood (n, k) of each flight and mixture component, in nats."""
        joint = self.evidence.points.new_empty(len(self.evidence), mixture.n_components)
        for index, rows in self._chunks:
            joint[index] = posteriors(mixture, rows, None if self.context is None else self.context[index]).log_joint
        return joint

    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """The M step given responsibilities (n, k), from posteriors under the mixture before or the single Gaussian."""
        mixture = before if before is not None else self.single
        moments, _ = self._gather(mixture, responsibilities)
        return self._mixture(moments, responsibilities, before)

    def improve(self, mixture: Mixture) -> tuple[Mixture, float]:
        """One E and M step, and the mean log-likelihood before it; each posterior is computed once."""
        responsibilities = self.evidence.points.new_empty(len(self.evidence), mixture.n_components)
        moments, likelihood = self._gather(mixture, responsibilities, fill=True)
        return self._mixture(moments, responsibilities, mixture), likelihood

    def _gather(self, mixture: Mixture, responsibilities: Tensor, *, fill: bool = False) -> tuple[_Moments, float]:
        """Moments under responsibilities, which are computed here if they are to be filled in."""
        k, (c, d) = responsibilities.shape[1], (self.design.shape[1], self.evidence.points.shape[1])
        like, likelihood = self.evidence.points, 0.0
        xx, xw, ww = like.new_zeros(k, c, c), like.new_zeros(k, c, d), like.new_zeros(k, d, d)
        for index, rows in self._chunks:
            found = posteriors(mixture, rows, None if self.context is None else self.context[index])
            if fill:
                total = found.log_joint.logsumexp(1)
                responsibilities[index] = (found.log_joint - total[:, None]).exp()
                likelihood += float(total.sum())
            share, x = responsibilities[index], self.design[index]
            weighted = share.T[:, :, None] * x  # (k, n, c)
            means = found.means.expand(-1, k, -1).transpose(0, 1)
            xx += weighted.mT @ x
            xw += weighted.mT @ means
            by_matrix = like.new_zeros(len(rows.precisions), k).index_add_(0, rows.group, share)
            ww += (share.T[:, :, None] * means).mT @ means
            ww += torch.einsum("uk,ukde->kde", by_matrix, found.covariances.expand(-1, k, -1, -1))
        return _Moments(xx, xw, ww), likelihood / len(self.evidence)

    def _mixture(self, moments: _Moments, responsibilities: Tensor, before: Mixture | None) -> Mixture:
        count = moments.xx[:, 0, 0].clamp(min=1e-9)
        mean_x, mean_w = moments.xx[:, 0] / count[:, None], moments.xw[:, 0] / count[:, None]
        second = moments.ww / count[:, None, None] - mean_w[:, :, None] * mean_w[:, None]
        if self.context is None or self._gate is None:
            return Mixture(count / count.sum(), mean_w, cholesky_or_small((second + second.mT) / 2, self.jitter))
        # Ridge regression of each component's posterior means on the context, from centred moments.
        inner = moments.xx[:, 1:, 1:] - count[:, None, None] * mean_x[:, 1:, None] * mean_x[:, None, 1:]
        across = moments.xw[:, 1:] - count[:, None, None] * mean_x[:, 1:, None] * mean_w[:, None]
        eye = torch.eye(inner.shape[1]).to(inner)
        slopes = torch.linalg.solve(inner + self.ridge * eye, across).mT
        line = slopes @ across / count[:, None, None]
        spread = second - line - line.mT + slopes @ inner @ slopes.mT / count[:, None, None]
        locs = mean_w - (slopes @ mean_x[:, 1:, None])[..., 0]
        logits, gate = self._gate.newton(responsibilities, before)
        return Mixture(logits.softmax(0), locs, cholesky_or_small((spread + spread.mT) / 2, self.jitter), slopes, gate)
