"""The contest of effects: each fitted to what the flights show, judged by flights that it was not fitted to.

Every flight is a vector ``y_i ~ N(m + g_i d_i(theta), S)`` of what it shows, ``g_i`` one for real flights, ``m`` the
simulator's mean (free where its own flights measured it, zero where physics claims so) and ``d_i(theta)`` the shift
that an effect makes at this flight's own speed and altitude. ``m`` and ``S`` are the same for all candidates, so a
variance can never name a mechanism; the mean is estimated along with the effect, so the reference's own error is in the
score.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import FOLDS, by_cluster, folds_of
from descentflow.diagnosis.inference.heterogeneity import learnt_laws
from descentflow.diagnosis.inference.linear_algebra import Design, Moments, solve, sum_of
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects import Effect

STEPS = 5
"""Gauss-Newton steps of a fit; effects are close to linear in their parameters."""
LEAST_BETTER = 0.5
"""Nats by which a neighbour must be better for a fit to go on from there."""


@dataclass(frozen=True)
class Fit:
    """Some effects, fitted together.

    ``theta`` by effect; ``shift`` (n, p) at theta, zero for the simulator's flights; ``design`` what else is linear;
    ``log_score`` (n,) of each flight, held out, up to a constant that all fits share.
    """

    effects: tuple[str, ...]
    theta: dict[str, Tensor]
    shift: Tensor
    design: Design
    log_score: Tensor

    def score(self) -> float:
        """Sum of the held-out log scores, nats."""
        return float(self.log_score.sum())


class Contest:
    """Flights, their precision, and folds of whole aircraft."""

    def __init__(
        self,
        compared: Compared,
        whitening: Whitening,
        catalogue: Mapping[str, Effect],
        seed: int,
        like: "Contest | None" = None,
        nuisance: Tensor | None = None,
    ) -> None:
        """Prepare the sums that all fits share.

        Args:
            compared: Flights of both sides.
            whitening: Their precision.
            catalogue: Effects that may be named.
            seed: Of the folds.
            like: Contest of the same flights with another precision, whose sensitivities are taken over.
            nuisance: (n, p, q) columns that all flights may have in any size, in place of the simulator's own habits.
        """
        self.compared, self.whitening, self.catalogue = compared, whitening, catalogue
        self.y = compared.y.nan_to_num(0.0)
        self.real = compared.real
        self.has_reference = bool((~self.real).any())
        self.fold = folds_of(compared.cluster, compared.real, seed)
        self.qy = whitening.apply(self.y)
        self.carry = _carry(compared, whitening)
        if nuisance is not None:
            free = torch.zeros(nuisance.shape[2], dtype=self.y.dtype)
            self.common: Design = self._with_products(Design(nuisance, nuisance, nuisance.shape[2], free))
        else:
            self.common = self._common() if like is None else self._with_products(like.common)

    def all_shift(self, name: str, theta: Tensor) -> Tensor:
        """Shift (n, p) that an effect makes, or would make, in every flight."""
        effect = self.catalogue[name]
        return self._carried(effect, self.compared.vector(effect.shift(self.compared.state, theta)))

    def shift(self, theta: Mapping[str, Tensor]) -> Tensor:
        """Shift (n, p) of effects together, zero for the simulator's flights."""
        total = torch.zeros_like(self.y)
        for name, value in theta.items():
            total = total + self.all_shift(name, value)
        return torch.where(self.real[:, None], total, 0.0)

    def jacobian(self, name: str, theta: Tensor, first: int | None = None) -> Tensor:
        """Sensitivity (n, p, k) of every flight to one effect's parameters (or the first of them)."""
        effect = self.catalogue[name]
        return self._carried(effect, self.compared.vector(effect.sensitivity(self.compared.state, theta, first)))

    @cached_property
    def starts(self) -> dict[str, Design]:
        """Sensitivities of every effect where its fits start: all parameters, or the first of each of many starts."""
        found = {}
        for name, effect in self.catalogue.items():
            starts = effect.starts(self.compared.state)
            if len(starts) == 1:
                own = self.jacobian(name, starts[0])
            else:
                own = torch.cat([self.jacobian(name, start, 1) for start in starts], 2)
            found[name] = self._with_common(own, torch.zeros(own.shape[2], dtype=self.y.dtype))
        return found

    def promise(self, shift: Tensor) -> dict[str, float]:
        """Gain (nats) in likelihood that each effect promises beside a shift, not held out and by its sensitivity."""
        q, found = self._q(shift), {}
        for name, design in self.starts.items():
            information, score = self._moments(q, design, None).profiled()
            own = slice(design.n_common, None)
            several = len(self.catalogue[name].starts(self.compared.state)) > 1
            if several:
                gain = 0.5 * score[own].clamp(min=0.0) ** 2 / information.diagonal()[own].clamp(min=1e-12)
                found[name] = float(gain.max())
                continue
            step = solve(information + torch.diag(design.ridge), score, information.diagonal())
            without = design.common()
            base, own_score = information[: without.n_common, : without.n_common], score[: without.n_common]
            plain = solve(base + torch.diag(without.ridge), own_score, base.diagonal())
            found[name] = 0.5 * float(score @ step - own_score @ plain)
        return found

    def _carried(self, effect: Effect, vector: Tensor) -> Tensor:
        if not effect.rate_follows_cas:
            return vector
        return vector + torch.einsum("ij,nj...->ni...", self.carry, vector)

    def fit(self, effects: Sequence[str], start: Mapping[str, Tensor] | None = None) -> Fit:
        """Fit effects together.

        Args:
            effects: Their names.
            start: Parameters to start from; where an effect has several starts, the one that promises most is taken.
        """
        theta: dict[str, Tensor] = {name: start[name] for name in effects if start and name in start}
        for name in effects:
            if name not in theta:
                theta[name] = self._best_start(name, theta)
        theta = self._beside(self._climb({name: theta[name] for name in effects}))
        learnt = learnt_laws(self, theta)
        if learnt is not None:
            theta = self._climb(learnt)
        shift, design = self.shift(theta), self.design(theta)
        return Fit(tuple(effects), theta, shift, design, self.held_out(shift, design))

    def _common(self) -> Design:
        """Sensitivities that tell flights of one side apart, for all flights alike, with a weak prior."""
        columns, prior = [torch.zeros(*self.y.shape, 0, dtype=self.y.dtype)], []
        for name, effect in self.catalogue.items() if self.has_reference else ():
            starts = effect.starts(self.compared.state)
            if len(starts) > 1:
                continue
            # What physics claims to be zero is no habit of the simulator's flights; and sensitivities depend on speed,
            # so they would explain speeds by themselves.
            jacobian = self.jacobian(name, starts[0]) * (self.compared.free & ~self.compared.of("cas"))[:, None]
            spread = (jacobian - jacobian.mean(0)).abs().amax((0, 1))
            kept = [i for i in range(len(effect.parameters)) if float(spread[i]) > 1e-9]
            columns.append(jacobian[:, :, kept])
            prior += [(0.5 / effect.parameters[i].scale) ** 2 for i in kept]
        joined = torch.cat(columns, 2)
        return self._with_products(Design(joined, joined, joined.shape[2], torch.tensor(prior, dtype=self.y.dtype)))

    def _with_products(self, design: Design) -> Design:
        return replace(design, products=self.whitening.apply(design.columns))

    def theta_of(self, fit: Fit, keep: Tensor) -> dict[str, Tensor]:
        """Parameters that the flights to keep (n,) alone would give, one step from the fit."""
        step = self._moments(self._q(fit.shift), fit.design, keep).solved()[1][fit.design.n_common :]
        return self._moved(fit.theta, step)

    def design(self, theta: Mapping[str, Tensor], extra: Tensor | None = None, ridge: float = 0.0) -> Design:
        """Columns of the effects' sensitivities, and of anything else (n, p, e) with a prior precision."""
        parts = [torch.zeros(*self.y.shape, 0, dtype=self.y.dtype)]
        parts += [self.jacobian(name, value) for name, value in theta.items()]
        own = torch.cat(parts if extra is None else [*parts, extra], 2)
        prior = torch.zeros(own.shape[2], dtype=self.y.dtype)
        if extra is not None:
            prior[-extra.shape[2] :] = ridge
        return self._with_common(own, prior)

    def _with_common(self, own: Tensor, prior: Tensor) -> Design:
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

    def _best_start(self, name: str, known: Mapping[str, Tensor]) -> Tensor:
        starts = self.catalogue[name].starts(self.compared.state)
        if len(starts) == 1:
            return starts[0]
        design = self.starts[name]
        information, score = self._moments(self._q(self.shift(known)), design, None).profiled()
        size = information.diagonal()[design.n_common :].clamp(min=1e-12)
        promise = score[design.n_common :]
        best = int((promise.clamp(min=0.0) ** 2 / size).argmax())
        begun = starts[best].clone()
        begun[0] = (promise / size)[best].clamp(min=0.02)
        return self.catalogue[name].clamp(begun)

    def _climb(self, theta: dict[str, Tensor]) -> dict[str, Tensor]:
        value = self._objective(self.shift(theta))
        for _ in range(STEPS if theta else 0):
            design = self.design(theta)
            step = self._moments(self._q(self.shift(theta)), design, None).solved()[1][design.n_common :]
            gained = 0.0
            for factor in (1.0, 0.4, 0.1):
                trial = self._moved(theta, factor * step)
                gained = self._objective(self.shift(trial)) - value
                if gained > 0:
                    theta, value = trial, value + gained
                    break
            if gained < 0.03:
                break
        return theta

    def _beside(self, theta: dict[str, Tensor]) -> dict[str, Tensor]:
        """Go on from the best neighbour where that leads higher, until none does."""
        for name in theta:
            better = True
            while better:
                value = self._objective(self.shift(theta))
                tried = [{**theta, name: beside} for beside in self.catalogue[name].neighbours(theta[name])]
                if not tried:
                    break
                # Both ends of a window may have to move: the neighbour itself need not be better than where it is.
                climbed = self._climb(max(tried, key=lambda trial: self._objective(self.shift(trial))))
                better = self._objective(self.shift(climbed)) > value + LEAST_BETTER
                theta = climbed if better else theta
        return theta

    def _moved(self, theta: Mapping[str, Tensor], step: Tensor) -> dict[str, Tensor]:
        parts = dict(zip(theta, torch.split(step, [len(value) for value in theta.values()]), strict=True))
        return {name: self.catalogue[name].clamp(value + parts[name]) for name, value in theta.items()}

    def moments(self, shift: Tensor, design: Design) -> Moments:
        """Sums over all flights, of what a shift leaves."""
        return self._moments(self._q(shift), design, None)

    def _q(self, shift: Tensor) -> Tensor:
        q = self.qy.clone()
        q[self.real] -= self.whitening.rows(self.real).apply(shift[self.real])
        return q

    def _objective(self, shift: Tensor) -> float:
        """Log-likelihood (nats, up to a constant) at a shift, with mean and common columns at their best."""
        q = self._q(shift)
        moments = self._moments(q, self.common, None)
        mean, step = moments.solved()
        explained = float(moments.score @ step)
        if len(mean):
            explained += float(moments.mean_score @ mean)
        return -0.5 * float(((self.y - shift) * q).sum()) + 0.5 * explained

    def _moments(self, q: Tensor, design: Design, keep: Tensor | None) -> Moments:
        """Sums over the flights to keep (n,) (all if absent) at precision times residuals (n, p)."""
        keep = torch.ones(len(self.y), dtype=torch.bool) if keep is None else keep
        free, columns, products, q = self.compared.free, design.columns[keep], design.products[keep], q[keep]
        return Moments(
            self.whitening.total(keep)[free][:, free],
            products.sum(0)[free],
            columns.flatten(0, 1).T @ products.flatten(0, 1),
            q.sum(0)[free],
            q.flatten() @ columns.flatten(0, 1),
            design.ridge,
        )

    def held_out(self, shift: Tensor, design: Design) -> Tensor:
        """Log score (n,) of each flight under mean and coefficients of the other folds."""
        q, free = self._q(shift), self.compared.free
        whole = [self._moments(q, design, self.fold == k) for k in range(FOLDS)]
        score = torch.zeros(len(self.y), dtype=self.y.dtype)
        for fold in range(FOLDS):
            out = self.fold == fold
            others = [whole[k] for k in range(FOLDS) if k != fold]
            mean, step = sum_of(others).solved()
            error = (self.y - shift)[out] - design.columns[out] @ step
            error[:, free] -= mean
            score[out] = -0.5 * (error * self.whitening.rows(out).apply(error)).sum(1)
        return score

    def held_out_in(self, at: Tensor, theta: Mapping[str, Tensor]) -> Tensor:
        """Log score (n,) of some entries (k,) alone, as if nothing else had been measured, at these parameters."""
        whitening = self.whitening.only(at, self.compared.y.isfinite())
        part = Contest(self.compared.only(at), whitening, {}, 0)
        part.fold = self.fold
        # What all flights have in common would explain a quantity by itself if nothing else is looked at.
        whole = self.design(theta)
        own = slice(whole.n_common, None)
        columns = whole.columns[:, at, own]
        design = part._with_products(Design(columns, columns, 0, whole.ridge[own]))
        return part.held_out(self.shift(theta)[:, at], design)

    def compare(self, first: Tensor, second: Tensor) -> tuple[float, float]:
        """Sum of paired differences of log scores and its standard error, whole aircraft counted as one."""
        total = by_cluster(first - second, self.compared.cluster)
        spread = float(total.var()) * len(total) if len(total) > 1 else float("inf")
        return float(total.sum()), spread**0.5


def _carry(compared: Compared, whitening: Whitening) -> Tensor:
    """What a shift of CAS carries over to the rate if flights behave as those that always flew so: (p, p)."""
    rate, cas = compared.columns("rate"), compared.columns("cas")
    carry = torch.zeros_like(whitening.covariance)
    if len(rate) and len(cas):
        block = whitening.covariance[cas][:, cas]
        block = block + 0.05 * torch.diag(block.diagonal())
        carry[rate[:, None], cas] = torch.linalg.solve(block, whitening.covariance[cas][:, rate]).T
    return carry
