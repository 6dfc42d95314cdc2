r"""How well columns explain what tells real flights from the simulator's, under every labelling of the aircraft.

Rao's score of columns :math:`x_i` in :math:`y_i \sim N(m + g_i x_i \beta, S_i)` at :math:`\beta = 0`, where :math:`g_i`
is one for real flights. With the residuals :math:`r_i` of what all flights have in common, an aircraft adds

.. math:: s_c(g) = g_c\, a_c - \pi_g\, b_c, \qquad a_c = \sum_{i \in c} x_i^\top S_i^{-1} r_i,

to it, with :math:`b_c` what of the columns the common part explains and :math:`\pi_g` the share of real flights. The
statistic is the square of :math:`\sum_c s_c` in the metric of the information, over its own expectation by aircraft,
:math:`\sum_c s_c s_c^\top`. So it needs nothing but sums over aircraft, and stays right where aircraft of both sides
differ in how many flights they have.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.inference.fold_sums import NUDGE
from descentflow.diagnosis.inference.labellings import Labellings
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood

COLUMNS_AT_ONCE = 4
"""Columns that are weighted at a time: of 5,000 flights with 100 entries, 16 MB, and some times as much in between."""
LEAST = 1e-12
"""Of information and variance: below it, columns move nothing that is seen."""


@dataclass(frozen=True)
class LabelScores:
    """Residuals of what all flights have in common, and the labellings.

    Shapes: ``weighted`` (n, p) precision times the residuals; ``common`` (n, s) the gradient of each flight for what
    all have in common, and ``whole`` (s, s) its information.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.labellings import labellings_of
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> scores = LabelScores.of(likelihood, labellings_of(likelihood.compared, 99, seed=0))
        >>> column = likelihood.jacobian("temperature", torch.tensor([0.0]).double())
        >>> int(scores.normal_score(column).argmax())  # the true labelling
        0
    """

    likelihood: EffectsLikelihood
    labels: Labellings
    weighted: Tensor
    common: Tensor
    whole: Tensor

    @classmethod
    def of(cls, likelihood: EffectsLikelihood, labels: Labellings) -> "LabelScores":
        """Fit what all flights have in common, whichever side they are on."""
        free, common = likelihood.compared.free, likelihood.common
        everyone = torch.ones(len(likelihood.y), dtype=torch.bool)
        mean = likelihood.whitening.total(everyone)[free][:, free]
        cross = common.products.sum(0)[free]
        inner = common.columns.flatten(0, 1).T @ common.products.flatten(0, 1) + torch.diag(common.ridge)
        whole = torch.cat([torch.cat([mean, cross], 1), torch.cat([cross.T, inner], 1)], 0)
        # Columns that the mean contains.
        whole = whole + torch.diag(NUDGE * whole.diagonal() + 1e-300)
        fitted = torch.linalg.solve(whole, _gradient(likelihood, likelihood.qy).sum(0)[:, None])[:, 0]
        residual = likelihood.y - common.columns @ fitted[len(mean) :]
        residual[:, free] -= fitted[: len(mean)]
        weighted = likelihood.whitening.apply(residual)
        return cls(likelihood, labels, weighted, _gradient(likelihood, weighted), whole)

    def normal_score(self, columns: Tensor, ridge: float = 0.0) -> Tensor:
        """Standing (1 + b,) of the columns (n, p, k) with a prior precision, near normal where there is no gap.

        By Satterthwaite's degrees of freedom and the cube root of Wilson and Hilferty (1931).
        """
        mine, shared, information = self._of_aircraft(columns)
        size = information.diagonal().clamp(min=LEAST).sqrt()
        shown = information.diagonal() > LEAST
        if not bool(shown.any()):
            return torch.zeros(len(self.labels), dtype=mine.dtype)
        mine, shared, size = mine[:, shown], shared[:, shown], size[shown]
        scaled = information[shown][:, shown] / (size[:, None] * size) + torch.diag(ridge / size**2 + 1e-9)
        lower = torch.linalg.cholesky(scaled)
        mine, shared = (torch.linalg.solve_triangular(lower, (v / size).T, upper=False).T for v in (mine, shared))
        total, variance = self._sums(mine, shared)
        part = self._share_of_aircraft()
        mixed = mine.T @ shared
        usual = part * mine.T @ mine - part**2 * (mixed + mixed.T - shared.T @ shared)
        freedom = float(usual.trace() ** 2 / usual.square().sum().clamp(min=LEAST))
        ratio = total.square().sum(1) / variance.sum(1).clamp(min=LEAST)
        spread = 2.0 / (9.0 * freedom)
        found: Tensor = (ratio ** (1 / 3) - (1 - spread)) / spread**0.5
        return found

    def one_sided(self, columns: Tensor, weights: Tensor) -> Tensor:
        """Standing (1 + b,) of the best of the sums of columns (n, p, k) by weights (k, w), which can only be added."""
        mine, shared, _ = self._of_aircraft(columns)
        total, variance = self._sums(mine @ weights, shared @ weights)
        return (total / variance.clamp(min=LEAST).sqrt()).amax(1)

    def _of_aircraft(self, columns: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """What each aircraft adds (c, k), what of it the common part explains (c, k), and the information (k, k)."""
        free, common = self.likelihood.compared.free, self.likelihood.common.columns
        gradient = torch.einsum("npk,np->nk", columns, self.weighted)
        crossed, inner = [], []
        for some in torch.split(columns, COLUMNS_AT_ONCE, dim=2):
            products = self.likelihood.whitening.apply(some)
            crossed.append(torch.cat([products[:, free].sum(0), torch.einsum("npq,npk->qk", common, products)]))
            inner.append(torch.einsum("npe,npk->ek", columns, products))
        cross = torch.cat(crossed, 1)
        held = torch.linalg.solve(self.whole, cross) if len(cross) else cross
        part = self._share_of_aircraft()
        information = part * torch.cat(inner, 1) - part**2 * cross.T @ held
        return self.labels.by_aircraft(gradient), self.labels.by_aircraft(self.common @ held), information

    def _share_of_aircraft(self) -> float:
        """Of the real ones: the same under every labelling."""
        return float(self.labels.sides[0].double().mean())

    def _sums(self, mine: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """Scores (1 + b, k) and their variances (1 + b, k) by aircraft."""
        if not self.labels.two_sided:
            own = mine - shared
            return self.labels.sums(own), own.square().sum(0).expand(len(self.labels), -1)
        flights = torch.bincount(self.labels.aircraft).double()[:, None]
        part = self.labels.sums(flights) / flights.sum()
        total = self.labels.sums(mine) - part * shared.sum(0)
        squares = self.labels.sums(mine.square()) - 2 * part * self.labels.sums(mine * shared)
        return total, squares + part**2 * shared.square().sum(0)


def _gradient(likelihood: EffectsLikelihood, weighted: Tensor) -> Tensor:
    """Of each flight (n, s) for the free mean and the common columns."""
    of_columns = torch.einsum("np,npq->nq", weighted, likelihood.common.columns)
    return torch.cat([weighted[:, likelihood.compared.free], of_columns], 1)
