"""The likelihood of effects: a Gaussian regression of what flights show, with a cross-validated log score.

Every flight is a vector ``y_i ~ N(m + g_i d_i(theta), S)`` of what it shows, ``g_i`` one for real flights, ``m`` the
simulator's mean (free where its own flights measured it, zero where physics claims so) and ``d_i(theta)`` the shift
that an effect makes at this flight's own speed and altitude. ``m`` and ``S`` are the same for all candidates, so a
variance can never name a mechanism; the mean is estimated along with the effect, so the reference's own error is in the
log score.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import FOLDS, by_aircraft, folds_of
from descentflow.diagnosis.inference.effect_shifts import EffectShifts
from descentflow.diagnosis.inference.linear_algebra import Design, Moments, sum_of
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.diagnosis.inference.window_search import FIRST_SIZE, band_columns
from descentflow.effects import Effect

HABIT_SIZE = 0.5
"""Prior of the simulator's own habits: their spread is two sizes that matter, so the data decide within that."""
SHOWN_SPREAD = 1e-9
"""Sensitivities that vary by less between flights are alike for all of them, and the free mean contains them."""


@dataclass(frozen=True)
class Fit:
    """Some effects, fitted together.

    ``theta`` by effect; ``shift`` (n, p) at theta, zero for the simulator's flights; ``design`` what else is linear;
    ``log_score`` (n,) of each flight, held out, up to a constant that all fits share.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> fit = fit_effects(likelihood, ["temperature"])
        >>> fit.effects, fit.log_score.shape
        (('temperature',), torch.Size([160]))
    """

    effects: tuple[str, ...]
    theta: dict[str, Tensor]
    shift: Tensor
    design: Design
    log_score: Tensor


class EffectsLikelihood(EffectShifts):
    """Flights, their precision, and folds of whole aircraft.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> warm, cold = (likelihood.shift({"temperature": torch.tensor([k])}) for k in (10.0, -10.0))
        >>> likelihood.log_likelihood(warm) > likelihood.log_likelihood(cold)
        True
    """

    def __init__(
        self,
        compared: Compared,
        whitening: Whitening,
        catalogue: Mapping[str, Effect],
        seed: int,
        like: "EffectsLikelihood | None" = None,
        nuisance: Tensor | None = None,
    ) -> None:
        """Prepare the sums that all fits share.

        Args:
            compared: Flights of both sides.
            whitening: Their precision.
            catalogue: Effects that may be named.
            seed: Of the folds.
            like: Likelihood of the same flights with another precision, whose sensitivities are taken over.
            nuisance: (n, p, q) columns that all flights may have in any size, in place of the simulator's own habits.
        """
        super().__init__(compared, whitening, catalogue)
        self.fold = folds_of(compared.airframe, compared.real, seed)
        self.qy = whitening.apply(self.y)
        if nuisance is not None:
            free = torch.zeros(nuisance.shape[2], dtype=self.y.dtype)
            self.common: Design = self.with_products(Design(nuisance, nuisance, nuisance.shape[2], free))
        else:
            self.common = self._habits() if like is None else self.with_products(like.common)

    @cached_property
    def starts(self) -> dict[str, Design]:
        """Sensitivities of every effect where its fits start; of windowed ones, those in every band."""
        found = {}
        for name in self.catalogue:
            windowed = self.windowed(name)
            if windowed is None:
                own = self.jacobian(name, self.start_of(name))
            else:
                own = band_columns(self, windowed, FIRST_SIZE)
            found[name] = self.with_common(own)
        return found

    def _habits(self) -> Design:
        """Sensitivities that tell flights of one side apart, for all flights alike, with a weak prior."""
        columns, prior = [torch.zeros(*self.y.shape, 0, dtype=self.y.dtype)], []
        for name, effect in self.catalogue.items() if self.has_reference else ():
            if self.windowed(name) is not None:
                continue
            # What physics claims to be zero is no habit of the simulator's flights; and sensitivities depend on speed,
            # so they would explain speeds by themselves.
            jacobian = (
                self.jacobian(name, self.start_of(name)) * (self.compared.free & ~self.compared.of("cas"))[:, None]
            )
            spread = (jacobian - jacobian.mean(0)).abs().amax((0, 1))
            kept = [i for i in range(len(effect.parameters)) if float(spread[i]) > SHOWN_SPREAD]
            columns.append(jacobian[:, :, kept])
            prior += [(HABIT_SIZE / effect.parameters[i].scale) ** 2 for i in kept]
        joined = torch.cat(columns, 2)
        return self.with_products(Design(joined, joined, joined.shape[2], torch.tensor(prior, dtype=self.y.dtype)))

    def with_products(self, design: Design) -> Design:
        """The design with its columns weighted by these flights' precision."""
        return replace(design, products=self.whitening.apply(design.columns))

    def design(self, theta: Mapping[str, Tensor], extra: Tensor | None = None, ridge: float = 0.0) -> Design:
        """Columns of the effects' sensitivities, and of anything else (n, p, e) with a prior precision."""
        parts = [torch.zeros(*self.y.shape, 0, dtype=self.y.dtype)]
        parts += [self.jacobian(name, value) for name, value in theta.items()]
        own = torch.cat(parts if extra is None else [*parts, extra], 2)
        prior = torch.zeros(own.shape[2], dtype=self.y.dtype)
        if extra is not None:
            prior[-extra.shape[2] :] = ridge
        return self.with_common(own, prior)

    def with_common(self, own: Tensor, prior: Tensor | None = None) -> Design:
        """Columns (n, p, k) of the real flights beside those of all flights, with their prior precision (k,) if any."""
        prior = torch.zeros(own.shape[2], dtype=self.y.dtype) if prior is None else prior
        own = torch.where(self.real[:, None, None], own, 0.0)
        products = torch.zeros_like(own)
        products[self.real] = self.whitening.rows(self.real).apply(own[self.real])
        c = self.common
        return Design(
            torch.cat([c.columns, own], 2),
            torch.cat([c.products, products], 2),
            c.n_common,
            torch.cat([c.ridge, prior]),
        )

    def weighted_rest(self, shift: Tensor) -> Tensor:
        """Precision times what a shift leaves of each flight (n, p)."""
        q = self.qy.clone()
        q[self.real] -= self.whitening.rows(self.real).apply(shift[self.real])
        return q

    def moments(self, rest: Tensor, design: Design, keep: Tensor | None = None) -> Moments:
        """Sums over the flights to keep (n,) (all if absent) at :meth:`weighted_rest` (n, p)."""
        keep = torch.ones(len(self.y), dtype=torch.bool) if keep is None else keep
        free, columns, products, q = self.compared.free, design.columns[keep], design.products[keep], rest[keep]
        return Moments(
            self.whitening.total(keep)[free][:, free],
            products.sum(0)[free],
            columns.flatten(0, 1).T @ products.flatten(0, 1),
            q.sum(0)[free],
            q.flatten() @ columns.flatten(0, 1),
            design.ridge,
        )

    def log_likelihood(self, shift: Tensor) -> float:
        """Log-likelihood (nats, up to a constant) at a shift, with mean and common columns at their best."""
        q = self.weighted_rest(shift)
        moments = self.moments(q, self.common)
        mean, step = moments.solved()
        explained = float(moments.gradient @ step)
        if len(mean):
            explained += float(moments.mean_gradient @ mean)
        return -0.5 * float(((self.y - shift) * q).sum()) + 0.5 * explained

    def log_score(self, shift: Tensor, design: Design) -> Tensor:
        """Log score (n,) of each flight under mean and coefficients of the other folds."""
        q, free = self.weighted_rest(shift), self.compared.free
        whole = [self.moments(q, design, self.fold == k) for k in range(FOLDS)]
        score = torch.zeros(len(self.y), dtype=self.y.dtype)
        for fold in range(FOLDS):
            out = self.fold == fold
            others = [whole[k] for k in range(FOLDS) if k != fold]
            mean, step = sum_of(others).solved()
            error = (self.y - shift)[out] - design.columns[out] @ step
            error[:, free] -= mean
            score[out] = -0.5 * (error * self.whitening.rows(out).apply(error)).sum(1)
        return score

    def log_score_in(self, at: Tensor, theta: Mapping[str, Tensor]) -> Tensor:
        """Log score (n,) of some entries (k,) alone, as if nothing else had been measured, at these parameters."""
        whitening = self.whitening.only(at, self.compared.y.isfinite())
        part = EffectsLikelihood(self.compared.only(at), whitening, {}, 0)
        part.fold = self.fold
        # What all flights have in common would explain a quantity by itself if nothing else is looked at.
        whole = self.design(theta)
        own = slice(whole.n_common, None)
        columns = whole.columns[:, at, own]
        design = part.with_products(Design(columns, columns, 0, whole.ridge[own]))
        return part.log_score(self.shift(theta)[:, at], design)

    def gain(self, first: Tensor, second: Tensor) -> tuple[float, float]:
        """Sum of paired differences of log scores (n,) and its standard error, whole aircraft counted as one."""
        total = by_aircraft(first - second, self.compared.airframe)
        spread = float(total.var()) * len(total) if len(total) > 1 else float("inf")
        return float(total.sum()), spread**0.5
