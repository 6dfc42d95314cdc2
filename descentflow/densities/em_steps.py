"""One step of expectation maximisation for a mixture of linear regressions of the weights on a context.

The conditional of a joint mixture over weights and context has the same components, but it spends them on the shape of
the context, which is not generated, and has no density for a 0/1 column; here the likelihood of the weights alone
decides. Both steps are one matrix product over the flights. A context of no numbers leaves a mixture of Gaussians.
"""

from math import log, pi

import torch
from torch import Tensor

from descentflow.densities.mixture_parameters import Mixture, cholesky_or_small

JITTER = 1e-6
"""Added to the variances, as scikit-learn's ``reg_covar``."""
RIDGE = 1.0
"""The prior of zero slopes counts as this many flights at one standard deviation of context: few, but enough for a
mixture component of few flights."""
GATE_STEPS = 5
"""Steps of the gate within one M step; each raises its likelihood (Boehning 1992, doi:10.1007/BF00048682)."""


class Steps:
    """The steps of EM for one set of flights (paper, appendix C).

    Args:
        weights: (n, d) of flights.
        context: (n, c) encoded context, if there is one.
        prior_flights: Flights by which covariances are shrunk, see :func:`shrunk`.

    Example:
        >>> steps = Steps(torch.tensor([[0.0], [1.0], [10.0], [11.0]]))
        >>> steps.maximise(torch.tensor([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]).double()).locs.tolist()
        [[0.5], [10.5]]
        >>> context = torch.linspace(-1, 1, 2000)[:, None].double()
        >>> fitted = Steps(0.5 + 2 * context, context).maximise(torch.ones(2000, 1).double())
        >>> [round(float(v), 2) for v in (fitted.locs, fitted.slopes)]
        [0.5, 2.0]
    """

    def __init__(self, weights: Tensor, context: Tensor | None = None, prior_flights: float = 0.0) -> None:
        self.weights, self.prior_flights = weights.to(torch.float64), prior_flights
        self.context = self.weights[:, :0] if context is None else context.to(torch.float64)
        self.features = quadratic_features(torch.cat([self.weights, self.context], 1))
        self.design = torch.cat([torch.ones_like(self.weights[:, :1]), self.context], 1)
        self.penalty = RIDGE * torch.eye(self.design.shape[1]).to(self.design)
        self.penalty[0, 0] = JITTER  # the intercept of the gate is free
        self.factor = torch.linalg.cholesky(self.design.T @ self.design / 2 + self.penalty)

    def some(self, most: int) -> "Steps":
        """The steps of at most so many of the flights, evenly chosen; these themselves if there are no more."""
        if len(self.weights) <= most:
            return self
        chosen = evenly(len(self.weights), most)
        return Steps(self.weights[chosen], self.context[chosen], self.prior_flights)

    def points_to_group(self, seed: int) -> Tensor:
        """Points (n, d) for the start by k-means: weights, or what context leaves of them for every other two seeds."""
        if seed // 2 % 2 == 0 or not self.context.shape[1]:
            return self.weights
        one = self.maximise(torch.ones_like(self.weights[:, :1]))
        return self.weights - one.locs - self.context @ one.slopes[0].T

    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times density (n, k) of each flight and mixture component, in nats."""
        k, d = mixture.locs.shape
        precision = torch.cholesky_inverse(mixture.scale_trils)
        # Of weights and context together: the density is that of the weights less slopes times context.
        lift = torch.cat([torch.eye(d).to(precision).expand(k, d, d), -mixture.slopes], 2)
        linear = (precision @ mixture.locs[:, :, None])[:, :, 0]
        constant = (
            mixture.probs.log()
            - 0.5 * (linear * mixture.locs).sum(1)
            - mixture.scale_trils.diagonal(dim1=1, dim2=2).log().sum(1)
            - 0.5 * d * log(2 * pi)
        )
        whole = (lift.mT @ linear[:, :, None])[:, :, 0]
        whole[:, d:] += mixture.gate
        joint = (
            self.features @ torch.cat([-0.5 * (lift.mT @ precision @ lift).flatten(1), whole, constant[:, None]], 1).T
        )
        return joint - (mixture.probs.log() + self.context @ mixture.gate.T).logsumexp(1, keepdim=True)

    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """Ridge regression of each component under responsibilities (n, k), and the gate from where it was."""
        d, size = self.weights.shape[1], self.weights.shape[1] + self.context.shape[1]
        moments = responsibilities.T @ self.features
        count = moments[:, -1].clamp(min=1e-9)
        means = moments[:, -1 - size : -1] / count[:, None]
        second = moments[:, : size * size].reshape(-1, size, size) / count[:, None, None]
        spread = second - means[:, :, None] * means[:, None, :]
        own, across, given = spread[:, :d, :d], spread[:, d:, :d], spread[:, d:, d:]
        ridge = self.penalty[1:, 1:] / count[:, None, None]
        slopes = torch.linalg.solve(given + ridge, across).mT
        left = own - slopes @ across - (slopes @ across).mT + slopes @ given @ slopes.mT
        factors = cholesky_or_small(shrunk(left, count, self.prior_flights), JITTER)
        locs = means[:, :d] - (slopes @ means[:, d:, None])[:, :, 0]
        return Mixture(*self._gate(responsibilities, count, before, (locs, factors, slopes)))

    def _gate(
        self, responsibilities: Tensor, count: Tensor, before: Mixture | None, others: tuple[Tensor, Tensor, Tensor]
    ) -> tuple[Tensor, ...]:
        """Proportions and gate after some bounded Newton steps of a multinomial regression, about the ``others``."""
        if not self.context.shape[1]:
            return (count / count.sum(), *others)
        if before is None:
            table = self.design.new_zeros(self.design.shape[1], len(count))
            table[0] = (responsibilities.mean(0) + 1e-12).log()
        else:
            table = torch.cat([before.probs.log()[:, None], before.gate], 1).T
            table = table - table.mean(1, keepdim=True)
        for _ in range(GATE_STEPS):
            gradient = self.design.T @ (responsibilities - (self.design @ table).softmax(1)) - self.penalty @ table
            table = table + torch.cholesky_solve(gradient, self.factor)
        table = table - table.mean(1, keepdim=True)  # softmax knows differences only
        return (table[0].softmax(0), *others, table[1:].T.clone())

    def expectation(self, mixture: Mixture) -> tuple[Tensor, Tensor]:
        """The E step: responsibilities (n, k) and the mean log-likelihood (nats per flight)."""
        joint = self.log_joint(mixture)
        total = joint.logsumexp(1)
        return (joint - total[:, None]).exp(), total.mean()

    def improve(self, mixture: Mixture) -> tuple[Mixture, float]:
        """One E and M step, and the mean log-likelihood before it (nats per flight)."""
        responsibilities, likelihood = self.expectation(mixture)
        return self.maximise(responsibilities, mixture), float(likelihood)


def evenly(n: int, most: int) -> Tensor:
    """Positions of at most ``most`` of n flights, as far apart as each other.

    Example:
        >>> evenly(10, 4), evenly(3, 4)
        (tensor([0, 3, 6, 9]), tensor([0, 1, 2]))
    """
    return torch.arange(0, n, -(-n // most))


def shrunk(covariances: Tensor, counts: Tensor, prior_flights: float) -> Tensor:
    r"""Covariances (k, d, d) to which so many flights of the covariance within all components were added.

    The mean over the flights, :math:`S = \sum_k n_k S_k / n`, is what a mixture with one covariance for all components
    would have (``tied`` in scikit-learn); each becomes :math:`(n_k S_k + \nu S) / (n_k + \nu)`, as with an
    inverse-Wishart prior about it (Fraley and Raftery 2007, doi:10.1007/s00357-007-0004-5). Without, a component of a
    dozen flights has some directions in which it hardly varies.

    Args:
        covariances: (k, d, d) of the flights of each component.
        counts: (k,) flights of each.
        prior_flights: The number added; zero for none, infinite for one covariance of all.

    Example:
        >>> wide, narrow = 4.0 * torch.eye(2), torch.zeros(2, 2)
        >>> shrunk(torch.stack([wide, narrow]), torch.tensor([15.0, 5.0]), 5.0)[1]  # half of the mean, 3
        tensor([[1.5000, 0.0000],
                [0.0000, 1.5000]])
    """
    if prior_flights == 0 or len(covariances) == 1:
        return covariances
    own = counts[:, None, None]
    shared = (own * covariances).sum(0) / counts.sum()
    return torch.lerp(shared.expand_as(covariances), covariances, own / (own + prior_flights))


def quadratic_features(weights: Tensor) -> Tensor:
    """(n, d d + d + 1) features ``x x'``, ``x`` and 1 of weights (n, d).

    Example:
        >>> quadratic_features(torch.tensor([[2.0, 3.0]])).tolist()
        [[4.0, 6.0, 6.0, 9.0, 2.0, 3.0, 1.0]]
    """
    outer = (weights[:, :, None] * weights[:, None, :]).flatten(1)
    return torch.cat([outer, weights, torch.ones_like(weights[:, :1])], 1)
