"""One step of expectation maximisation for components that are linear regressions of the weights on a context.

The conditional of a joint mixture over weights and context has the same components, but it spends them on the shape of
the context, which is not generated, and has no density for a 0/1 column; here the likelihood of the weights alone
decides. With no context at all, :mod:`descentflow.densities.em_steps` takes these steps in one matrix product.
"""

import torch
from torch import Tensor

from descentflow.densities.em_steps import JITTER, Steps, cholesky_or_small, evenly, shrunk
from descentflow.densities.mixture_parameters import Mixture

RIDGE = 1.0
"""The prior of zero slopes counts as this many flights at one standard deviation of context: few, but enough for a
mixture component of few flights."""
GATE_STEPS = 5
"""Steps of the gate within one M step; each raises its likelihood (Boehning 1992, doi:10.1007/BF00048682)."""


class RegressionSteps(Steps):
    """The steps of a mixture with a context, of flights whose weights are known.

    Example:
        >>> context = torch.linspace(-1, 1, 2000)[:, None].double()
        >>> steps = RegressionSteps(0.5 + 2 * context, context)
        >>> fitted = steps.maximise(torch.ones(2000, 1).double())
        >>> [round(float(v), 2) for v in (fitted.locs, fitted.slopes)]
        [0.5, 2.0]
    """

    def __init__(self, weights: Tensor, context: Tensor, prior_flights: float = 0.0) -> None:
        """Take the training flights' weights (n, d), encoded context (n, c), and how many flights are a prior."""
        self.weights, self.context = weights.to(torch.float64), context.to(torch.float64)
        self.prior_flights = prior_flights
        self._gate = Gate(self.context)

    def some(self, most: int) -> Steps:
        """The steps of at most so many of the flights, evenly chosen."""
        if len(self.weights) <= most:
            return self
        chosen = evenly(len(self.weights), most)
        return RegressionSteps(self.weights[chosen], self.context[chosen], self.prior_flights)

    def points_to_group(self, seed: int) -> Tensor:
        """Points for the start by k-means: weights, or their residuals for every other pair of seeds."""
        if seed // 2 % 2 == 0:
            return self.weights
        loc, slope, _ = regression(self.weights, self.context, torch.ones_like(self.weights[:, 0]))
        return self.weights - loc - self.context @ slope.T

    def log_joint(self, mixture: Mixture) -> Tensor:
        """Log of proportion times density (n, k) of each flight and mixture component, in nats."""
        slopes, gate = _with_context(mixture)
        proportions = (mixture.probs.log() + self.context @ gate.T).log_softmax(1)
        densities = []
        for k in range(mixture.n_components):
            normal = torch.distributions.MultivariateNormal(
                mixture.locs[k] + self.context @ slopes[k].T, scale_tril=mixture.scale_trils[k], validate_args=False
            )
            densities.append(normal.log_prob(self.weights))  # type: ignore[no-untyped-call]
        return proportions + torch.stack(densities, 1)

    def maximise(self, responsibilities: Tensor, before: Mixture | None = None) -> Mixture:
        """Ridge regression of each component in closed form, and some steps of the gate from where it was."""
        shares = responsibilities.unbind(1)
        lines = (regression(self.weights, self.context, share) for share in shares)
        locs, slopes, covariances = map(torch.stack, zip(*lines, strict=True))
        own = shrunk(covariances, responsibilities.sum(0), self.prior_flights)
        logits, gate = self._gate.newton(responsibilities, before)
        return Mixture(logits.softmax(0), locs, cholesky_or_small(own, JITTER), slopes, gate)


class Gate:
    """Multinomial regression of responsibilities on the context: how the mixing proportions follow it.

    Example:
        >>> context = torch.tensor([[-1.0], [1.0]]).double()
        >>> logits, slopes = Gate(context).newton(torch.tensor([[0.9, 0.1], [0.1, 0.9]]).double(), None)
        >>> bool(slopes[1] > slopes[0])  # the second component belongs to the greater context
        True
    """

    def __init__(self, context: Tensor) -> None:
        """Take the training flights' context (n, c), float64."""
        self.n_context = context.shape[1]
        self.design = torch.cat([torch.ones_like(context[:, :1]), context], 1)
        self.penalty = RIDGE * torch.eye(self.design.shape[1]).to(self.design)
        self.penalty[0, 0] = JITTER  # the intercept is free
        self.factor = torch.linalg.cholesky(self.design.T @ self.design / 2 + self.penalty)

    def newton(self, responsibilities: Tensor, before: Mixture | None) -> tuple[Tensor, Tensor]:
        """Logits (k,) and gate (k, c) after some bounded Newton steps from where they were."""
        if before is None:
            logits = (responsibilities.mean(0) + 1e-12).log()
            table = torch.cat([logits[:, None], torch.zeros(len(logits), self.n_context).to(logits)], 1).T
        else:
            table = torch.cat([before.probs.log()[:, None], _with_context(before)[1]], 1).T
            table = table - table.mean(1, keepdim=True)
        for _ in range(GATE_STEPS):
            gradient = self.design.T @ (responsibilities - (self.design @ table).softmax(1)) - self.penalty @ table
            table = table + torch.cholesky_solve(gradient, self.factor)
        table = table - table.mean(1, keepdim=True)  # softmax knows differences only
        return table[0], table[1:].T.clone()


def regression(weights: Tensor, context: Tensor, share: Tensor, ridge: float = RIDGE) -> tuple[Tensor, Tensor, Tensor]:
    """Weighted ridge regression of the weights on the context.

    Args:
        weights: (n, d), float64.
        context: (n, c), float64; c may be zero.
        share: (n,) how much each flight counts.
        ridge: How many flights the prior of zero slopes counts as.

    Returns:
        loc (d,), slope (d, c) and the residuals' covariance (d, d).

    Example:
        >>> context = torch.tensor([[-1.0], [0.0], [1.0]]).double()
        >>> residual = torch.tensor([[2.0], [-4.0], [2.0]]).double()
        >>> loc, slope, covariance = regression(3 * context + residual, context, torch.ones(3).double(), ridge=0.0)
        >>> round(float(loc.abs()), 6), round(float(slope), 6), round(float(covariance), 6)
        (0.0, 3.0, 8.0)
    """
    count = share.sum().clamp(min=1e-9)
    mean_w, mean_c = share @ weights / count, share @ context / count
    w, c = weights - mean_w, context - mean_c
    shared = share[:, None] * c
    inner = shared.T @ c + ridge * torch.eye(c.shape[1]).to(c)
    slope = torch.linalg.solve(inner, shared.T @ w).T
    residual = w - c @ slope.T
    covariance = (share[:, None] * residual).T @ residual / count
    return mean_w - slope @ mean_c, slope, covariance


def _with_context(mixture: Mixture) -> tuple[Tensor, Tensor]:
    assert mixture.slopes is not None
    assert mixture.gate is not None
    return mixture.slopes, mixture.gate
