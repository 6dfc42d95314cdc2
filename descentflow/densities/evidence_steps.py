"""One step of expectation maximisation for flights whose weights are not known: extreme deconvolution.

Bovy, Hogg and Roweis 2011 (doi:10.1214/10-AOAS439): the E step gives, beside the responsibilities, the posterior mean
and covariance of each flight's weights under each component; the M step takes them in place of the weights. With a
context the means are regressed on it, as in :mod:`descentflow.densities.regression_steps`.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from descentflow.densities.em_steps import JITTER, GaussianSteps, Steps, cholesky_or_small, evenly, shrunk
from descentflow.densities.mixture_parameters import Mixture, block_posteriors
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
        self,
        evidence: Evidence,
        context: Tensor | None = None,
        *,
        ridge: float = RIDGE,
        jitter: float = JITTER,
        prior_flights: float = 0.0,
    ) -> None:
        """Take the training flights.

        Args:
            evidence: Of n flights whose weights are not known.
            context: (n, c) encoded context, if there is one.
            ridge: How many flights the prior of zero slopes counts as.
            jitter: Added to the variances.
            prior_flights: Flights by which covariances are shrunk towards the one that components share.
        """
        self.evidence, self.ridge, self.jitter, self.prior_flights = evidence, ridge, jitter, prior_flights
        self.context = None if context is None else context.to(torch.float64)
        ones = torch.ones_like(evidence.points[:, :1])
        self.design = ones if self.context is None else torch.cat([ones, self.context], 1)
        self._blocks = list(evidence.blocks())
        self._last: tuple[list[Tensor], Tensor, _Moments, float] | None = None
        self._some: tuple[int, EvidenceSteps] | None = None
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

    def some(self, most: int) -> Steps:
        """The steps of at most so many of the flights, evenly chosen."""
        if len(self.evidence) <= most:
            return self
        if self._some is None or self._some[0] != most:
            chosen = evenly(len(self.evidence), most).to(self.evidence.group.device)
            context = None if self.context is None else self.context[chosen]
            like = {"ridge": self.ridge, "jitter": self.jitter, "prior_flights": self.prior_flights}
            fewer = EvidenceSteps(self.evidence.rows(chosen), context, **like)
            self._some = (most, fewer)
        return self._some[1]

    def stand_in(self, seed: int) -> Steps:
        """Weights drawn given what was observed, under the single Gaussian: steps of them are in closed form.

        Unlike expected weights, the draws of gappy flights are spread as widely as those of complete ones.
        """
        generator = torch.Generator().manual_seed(seed)
        white = torch.randn(self.evidence.points.shape, generator=generator, dtype=torch.float64)
        drawn = torch.empty_like(self.evidence.points)
        for block in self._blocks:
            found = block_posteriors(self.single, block, self.context)
            factor = cholesky_or_small(found.covariances[0], 1e-12)
            drawn[block.index] = found.means[0] + white[block.index.cpu()].to(drawn) @ factor.mT
        if self.context is None:
            return GaussianSteps(drawn, self.prior_flights)
        return RegressionSteps(drawn, self.context, self.prior_flights)

    def points_to_group(self, seed: int) -> Tensor:
        """Points (n, d) for the start by k-means: the weights expected under the single Gaussian."""
        means = torch.empty_like(self.evidence.points)
        for block in self._blocks:
            means[block.index] = block_posteriors(self.single, block, self.context).means[0]
        return means

    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times marginal likelihood (n, k) of each flight and mixture component, in nats."""
        joint = self.evidence.points.new_empty(len(self.evidence), mixture.n_components)
        for block in self._blocks:
            joint[block.index] = block_posteriors(mixture, block, self.context).log_joint.permute(1, 2, 0)
        return joint

    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """The M step given responsibilities (n, k), from posteriors under the mixture before or the single Gaussian."""
        mixture = before if before is not None else self.single
        moments, _ = self._gather(mixture, responsibilities)
        return self._mixture(moments, responsibilities, before)

    def expectation(self, mixture: Mixture) -> tuple[Tensor, Tensor]:
        """The E step: responsibilities (n, k) and the mean log-likelihood (nats per flight)."""
        responsibilities, _, likelihood = self._told(mixture)
        return responsibilities, self.evidence.points.new_tensor(likelihood)

    def improve(self, mixture: Mixture) -> tuple[Mixture, float]:
        """One E and M step, and the mean log-likelihood before it; each posterior is computed once."""
        responsibilities, moments, likelihood = self._told(mixture)
        return self._mixture(moments, responsibilities, mixture), likelihood

    def _told(self, mixture: Mixture) -> tuple[Tensor, _Moments, float]:
        """Responsibilities, moments and mean log-likelihood; the last are kept, for training asks for them twice."""
        parts = [part for part in vars(mixture).values() if part is not None]
        if self._last is None or not all(map(torch.equal, self._last[0], parts)):
            responsibilities = self.evidence.points.new_empty(len(self.evidence), mixture.n_components)
            moments, likelihood = self._gather(mixture, responsibilities, fill=True)
            # Copies: a density's own parameters change in place.
            self._last = ([part.detach().clone() for part in parts], responsibilities, moments, likelihood)
        return self._last[1:]

    def _gather(self, mixture: Mixture, responsibilities: Tensor, *, fill: bool = False) -> tuple[_Moments, float]:
        """Moments under responsibilities, which are computed here if they are to be filled in."""
        k, (c, d) = responsibilities.shape[1], (self.design.shape[1], self.evidence.points.shape[1])
        like, likelihood = self.evidence.points, 0.0
        xx, xw, ww = like.new_zeros(k, c, c), like.new_zeros(k, c, d), like.new_zeros(k, d, d)
        for block in self._blocks:
            found = block_posteriors(mixture, block, self.context)
            if fill:
                total = found.log_joint.logsumexp(0)
                share = (found.log_joint - total).exp()
                responsibilities[block.index] = share.permute(1, 2, 0)
                likelihood += float((total * block.taken).sum())
            else:
                share = responsibilities[block.index].permute(2, 0, 1)
            share = share * block.taken  # (k, r, m)
            flat, x = share.flatten(1)[:, :, None], self.design[block.index.flatten()]
            means = found.means.expand(k, -1, -1, -1).flatten(1, 2)
            weighted = flat * x  # (k, r m, c)
            xx += weighted.mT @ x
            xw += weighted.mT @ means
            ww += (flat * means).mT @ means
            covariances = found.covariances.expand(k, -1, -1, -1).flatten(2)
            ww += (share.sum(2)[:, None] @ covariances).reshape(k, d, d)
        return _Moments(xx, xw, ww), likelihood / len(self.evidence)

    def _mixture(self, moments: _Moments, responsibilities: Tensor, before: Mixture | None) -> Mixture:
        count = moments.xx[:, 0, 0].clamp(min=1e-9)
        mean_x, mean_w = moments.xx[:, 0] / count[:, None], moments.xw[:, 0] / count[:, None]
        second = moments.ww / count[:, None, None] - mean_w[:, :, None] * mean_w[:, None]
        if self.context is None or self._gate is None:
            own = shrunk((second + second.mT) / 2, count, self.prior_flights)
            return Mixture(count / count.sum(), mean_w, cholesky_or_small(own, self.jitter))
        # Ridge regression of each component's posterior means on the context, from centred moments.
        inner = moments.xx[:, 1:, 1:] - count[:, None, None] * mean_x[:, 1:, None] * mean_x[:, None, 1:]
        across = moments.xw[:, 1:] - count[:, None, None] * mean_x[:, 1:, None] * mean_w[:, None]
        eye = torch.eye(inner.shape[1]).to(inner)
        slopes = torch.linalg.solve(inner + self.ridge * eye, across).mT
        line = slopes @ across / count[:, None, None]
        spread = second - line - line.mT + slopes @ inner @ slopes.mT / count[:, None, None]
        locs = mean_w - (slopes @ mean_x[:, 1:, None])[..., 0]
        logits, gate = self._gate.newton(responsibilities, before)
        own = cholesky_or_small(shrunk((spread + spread.mT) / 2, count, self.prior_flights), self.jitter)
        return Mixture(logits.softmax(0), locs, own, slopes, gate)
