"""A shift of no particular cause beside the effects of a fit: how wide it is, what it foretells, what it costs."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns, learnt_precision, quantity_of
from descentflow.diagnosis.inference.fold_sums import solved
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Design


@dataclass(frozen=True)
class Beside:
    """A discrepancy beside a fit.

    ``log_score`` (n,) held out; ``precision`` (e,) the prior precision of its coefficients that is most probable;
    ``cost`` nats of its freedom, and by which what the fit says of its signatures is improbable.

    Example:
        >>> Beside(torch.zeros(160), torch.ones(17), cost=12.0).cost
        12.0
    """

    log_score: Tensor
    precision: Tensor
    cost: float


class FreeDiscrepancy:
    """Columns of a shift without a cause, tried beside fits.

    Example:
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> free = FreeDiscrepancy(likelihood, discrepancy_columns(likelihood.compared))
        >>> none, warm = (fit_effects(likelihood, names) for names in ((), ("temperature",)))
        >>> [likelihood.gain(free.beside(fit).log_score, fit.log_score)[0] > 50 for fit in (none, warm)]
        [True, False]
    """

    def __init__(self, likelihood: EffectsLikelihood, columns: DiscrepancyColumns) -> None:
        """Take the columns."""
        self.likelihood, self.columns = likelihood, columns
        self.of = quantity_of(columns, likelihood.compared)
        self.found: dict[tuple[str, ...], Beside] = {}

    def beside(self, fit: Fit) -> Beside:
        """A discrepancy beside a fit, worked out once."""
        if fit.effects not in self.found:
            design = self.likelihood.design(fit.theta, self.columns)
            precision, cost = learnt_precision(*self._left_to_it(fit, design), self.of)
            wide = _with_precision(design, precision)
            # A fit's own score may be of laws that differ per flight: what the discrepancy adds comes on top of that.
            plain = self.likelihood.log_score(fit.shift, fit.design)
            score = fit.log_score + self.likelihood.log_score(fit.shift, wide) - plain
            cost += self.likelihood.improbability(fit.shift, wide)
            self.found[fit.effects] = Beside(score, precision, cost)
        return self.found[fit.effects]

    def refitted(self, fit: Fit) -> Fit:
        """The effects of a fit as they are with a discrepancy beside them, which takes what is not theirs."""
        beside = self.beside(fit)
        design = _with_precision(self.likelihood.design(fit.theta, self.columns), beside.precision)
        sums = self.likelihood.sums
        profiled = sums.profiled(sums.rest(fit.shift, design, sums.of_columns(design)), everyone=True)
        moved = self.likelihood.moved(fit.theta, solved(profiled, design.own_ridge)[0][: design.n_parameters])
        alike = {name: theta for name, theta in moved.items() if name not in fit.per_flight}
        shift = self.likelihood.shift(alike)
        for own in fit.per_flight.values():
            shift = shift + own.shift
        theta = {name: alike.get(name, fit.theta[name]) for name in fit.theta}
        return replace(fit, theta=theta, shift=shift, kept=lambda: design, log_score=beside.log_score)

    def _left_to_it(self, fit: Fit, design: Design) -> tuple[Tensor, Tensor]:
        """Information (e, e) and gradient (e,) of a discrepancy once all else has explained what it can."""
        sums = self.likelihood.sums
        whole = sums.profiled(sums.rest(fit.shift, design, sums.of_columns(design)), everyone=True).inner[0]
        k, e = design.n_parameters, len(self.columns)
        at = torch.arange(k, k + e)
        others = torch.tensor([i for i in range(len(whole) - 1) if not k <= i < k + e], dtype=torch.long)
        kept = torch.cat([at, torch.tensor([len(whole) - 1])])
        size = whole.diagonal()[others]
        block = whole[others[:, None], others] + torch.diag(design.own_ridge[others] + 1e-6 * size + 1e-9)
        share = torch.linalg.solve(block, whole[others[:, None], kept])
        left = whole[kept[:, None], kept] - whole[kept[:, None], others] @ share
        return left[:-1, :-1], left[:-1, -1]


def _with_precision(design: Design, precision: Tensor) -> Design:
    """Columns with a prior precision (e,) of the discrepancy's coefficients, which follow the parameters."""
    ridge = design.own_ridge.clone()
    ridge[design.n_parameters : design.n_parameters + len(precision)] = precision
    return replace(design, own_ridge=ridge)
