"""The likelihood of effects: a Gaussian regression of what flights show, with a cross-validated log score.

Every flight is a vector ``y_i ~ N(m + g_i d_i(theta), S)`` of what it shows, ``g_i`` one for real flights, ``m`` the
simulator's mean (free where its own flights measured it, zero where physics claims so) and ``d_i(theta)`` the shift
that an effect makes at this flight's own speed and altitude. ``m`` and ``S`` are the same for all candidates, so a
variance can never name a mechanism; the mean is estimated along with the effect, so the reference's own error is in the
log score.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import torch
from torch import Tensor

from descentflow.core.recent import Recent
from descentflow.diagnosis.inference.aircraft_groups import FOLDS, by_aircraft, folds_of
from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.effect_shifts import EffectShifts
from descentflow.diagnosis.inference.fold_sums import FoldSums, solved
from descentflow.diagnosis.inference.linear_algebra import Block, Common, Design, Moments, solve
from descentflow.diagnosis.inference.signature_columns import signature_columns
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.diagnosis.inference.window_search import FIRST_SIZE, band_columns
from descentflow.effects import Effect

HABIT_SIZE = 0.5
"""Prior of the simulator's own habits: their spread is two sizes that matter, so the data decide within that."""
SHOWN_SPREAD = 1e-9
"""Sensitivities that vary by less between flights are alike for all of them, and the free mean contains them."""


DESIGNS = 4
"""Designs of fits that are kept."""


@dataclass(frozen=True)
class FlightShares:
    """What each flight has of an effect that flights have each in their own way.

    ``share`` (n,) how likely it has the effect; ``numbers`` (n,) its own parameters by name, were it to have it;
    ``shift`` (n, p) that is expected. All are zero for the simulator's flights.

    Example:
        >>> FlightShares(torch.ones(3), {"low_fl": torch.tensor([180.0, 200.0, 190.0])}, torch.zeros(3, 8)).share.sum()
        tensor(3.)
    """

    share: Tensor
    numbers: Mapping[str, Tensor]
    shift: Tensor


@dataclass(frozen=True)
class Fit:
    """Some effects, fitted together.

    ``theta`` by effect; ``shift`` (n, p) that is expected of each flight, zero for the simulator's flights; ``kept``
    gives what else is linear, see :meth:`EffectsLikelihood.kept`; ``log_score`` (n,) of each flight, held out, up to a
    constant that all fits share; ``per_flight`` what each flight has of the effects that differ by flight.

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
    kept: Callable[[], Design]
    log_score: Tensor
    per_flight: Mapping[str, FlightShares] = field(default_factory=dict)

    @property
    def design(self) -> Design:
        """What is linear about the fit."""
        return self.kept()


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
            like: Likelihood of the same flights with another precision or other values of the real flights, whose folds
                and sensitivities are taken over.
            nuisance: (n, p, q) columns that all flights may have in any size, in place of the simulator's own habits.
        """
        super().__init__(compared, whitening, catalogue)
        self.fold: Tensor = folds_of(compared.airframe, compared.real, seed) if like is None else like.fold
        self.qy = whitening.apply(self.y)
        self._beside = Recent[tuple[DiscrepancyColumns, Block]](1)
        self._designs = Recent[Design](DESIGNS)
        self._like: EffectsLikelihood | None = None
        if nuisance is not None:
            self.common = Common(
                nuisance, whitening.apply(nuisance), torch.zeros(nuisance.shape[2], dtype=self.y.dtype)
            )
        elif like is not None:
            self.share(like)
            if whitening is not like.whitening:
                self.common = replace(like.common, products=whitening.apply(like.common.columns))
            else:
                self.common, self._beside = like.common, like._beside
                self._like = like if torch.equal(self.y[~self.real], like.y[~self.real]) else None
        else:
            self.common = self._habits()

    def forget(self) -> None:
        """Let go of what is kept to save time, which is made again where it is asked for."""
        super().forget()
        for kept in (self._beside, self._designs):
            kept.known.clear()
        for name in ("sums", "single"):
            self.__dict__.pop(name, None)

    @cached_property
    def sums(self) -> FoldSums:
        """What all fits share; of other values of the same real flights little is to be summed again."""
        if self._like is not None:
            return self._like.sums.of_other(self.y)
        return FoldSums(self.whitening, self.y, self.real, self.compared.free, self.common, self.fold)

    @cached_property
    def single(self) -> Whitening:
        """Precision of each real flight by itself, without what is negligible for means."""
        return self.whitening.of_single_flights(torch.nonzero(self.real)[:, 0], self.compared.y[self.real].isfinite())

    def at_start(self, name: str) -> Design:
        """Sensitivities of an effect where its fits start; of a windowed one, those in every band."""
        windowed = self.windowed(name)
        if windowed is None:
            return self.with_common(self.real_jacobian(name, self.start_of(name)))
        return self.with_common(band_columns(self, windowed, FIRST_SIZE, self.real_state))

    def _habits(self) -> Common:
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
        return Common(joined, self.whitening.apply(joined), torch.tensor(prior, dtype=self.y.dtype))

    def design(
        self, theta: Mapping[str, Tensor], extra: DiscrepancyColumns | None = None, signatures: Tensor | None = None
    ) -> Design:
        """Columns of the effects' sensitivities, of how their signatures may be off, and of a discrepancy.

        What is beside the sensitivities has a prior precision of one. Signatures (p, c) may be given.
        """
        blocks = tuple(self.sums.block(self.real_jacobian(name, value), kept=True) for name, value in theta.items())
        found = self.of_blocks(blocks, signature_columns(self, theta) if signatures is None else signatures)
        return found if extra is None else self.beside(found, extra)

    def beside(self, design: Design, extra: DiscrepancyColumns) -> Design:
        """A design with e columns after its own, whose prior precision is one.

        Most of them are alike in all flights, and need no sum over these.
        """
        block = self._beside.get(id(extra), lambda: (extra, self.sums.block(extra.differing[self.real])))[1]
        k = design.n_own
        prior = torch.cat([design.own_ridge[:k], torch.ones(len(extra), dtype=self.y.dtype)])
        return replace(
            design,
            blocks=(*design.blocks, block),
            alike=torch.cat([extra.alike, design.alike], 1),
            own_ridge=torch.cat([prior, design.own_ridge[k:]]),
        )

    def kept(self, make: Callable[[], Design]) -> Callable[[], Design]:
        """A design that is kept for a while, and made again when it is asked for later.

        Those of all fits of a search were 0.7 GB at 2,400 flights a side.

        Example:
            >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
            >>> likelihood = example_likelihood()
            >>> design = likelihood.kept(lambda: likelihood.design({}))
            >>> design() is design()
            True
        """
        key = object()
        return lambda: self._designs.get(key, make)

    def with_common(self, *own: Tensor) -> Design:
        """Columns (r, p, k) of the real flights, of several beside each other, beside those of all flights."""
        block = self.sums.block_of(own)
        return self.of_blocks((block,), torch.zeros(self.y.shape[1], 0, dtype=self.y.dtype))

    def joined(self, parts: Sequence[Tensor], alike: Tensor) -> Design:
        """Columns (r, p, k) of the real flights, and (p, c) alike in all of them with a prior precision of one."""
        return self.of_blocks(tuple(self.sums.block(part) for part in parts), alike)

    def of_blocks(self, blocks: tuple[Block, ...], alike: Tensor) -> Design:
        """The same of blocks that are there."""
        k = sum(block.count for block in blocks)
        prior = torch.cat([torch.zeros(k, dtype=self.y.dtype), torch.ones(alike.shape[1], dtype=self.y.dtype)])
        return Design(self.common, self.real, self.sums.order, blocks, alike, prior, k)

    def weighted_rest(self, shift: Tensor) -> Tensor:
        """Precision times what a shift leaves of each flight (n, p)."""
        q = self.qy.clone()
        q[self.sums.at] = self.sums.rest_of(shift).weighted
        return q

    def moments(self, rest: Tensor, design: Design, keep: Tensor | None = None) -> Moments:
        """Sums over the flights to keep (n,) (all if absent) at :meth:`weighted_rest` (n, p)."""
        sums, f = self.sums, int(self.compared.free.sum())
        if keep is None:
            found = sums.of_columns(design)
            base, cross, inner = sums.base.sum(0), found.cross.sum(0), found.inner.sum(0)
            gradient, weighted = sums.gradient(rest), rest[sums.at]
        else:
            base, cross, inner = sums.of_part(design, keep)
            gradient, weighted = sums.gradient(rest, keep), torch.where(keep[sums.at, None], rest[sums.at], 0.0)
        own = [block.columns.flatten(0, 1).T @ weighted.flatten() for block in design.blocks]
        corner = torch.cat([torch.cat([base[f:, f:], cross[f:]], 1), torch.cat([cross[f:].T, inner], 1)], 0)
        return Moments(
            base[:f, :f],
            torch.cat([base[:f, f:], cross[:f]], 1),
            corner,
            gradient[:f],
            torch.cat([gradient[f:], *own, design.alike.T @ weighted.sum(0)]),
            design.ridge,
        )

    def log_likelihood(self, shift: Tensor, beside: Design | None = None) -> float:
        """Log-likelihood (nats, up to a constant) at a shift, with mean and other columns at their best."""
        sums = self.sums
        rest = sums.rest(shift) if beside is None else sums.rest(shift, beside, sums.of_columns(beside))
        inner = sums.profiled(rest, everyone=True).inner[0]
        ridge = torch.zeros(0, dtype=self.y.dtype) if beside is None else beside.own_ridge
        step = solve(inner[:-1, :-1] + torch.diag(ridge), inner[:-1, -1], inner.diagonal()[:-1])
        return -0.5 * float(inner[-1, -1] - inner[:-1, -1] @ step)

    def log_score(self, shift: Tensor, design: Design) -> Tensor:
        """Log score (n,) of each flight under mean and coefficients of the other folds."""
        error = self.held_out_errors(shift, design)
        return -0.5 * (error * self.whitening.apply(error)).sum(1)

    def held_out_errors(self, shift: Tensor, design: Design) -> Tensor:
        """What is left (n, p) of each flight under mean and coefficients of the other folds."""
        sums = self.sums
        profiled = sums.profiled(sums.rest(shift, design, sums.of_columns(design)))
        steps = solved(profiled, design.own_ridge)[:FOLDS]
        common = profiled.common[:FOLDS, :, -1] - torch.einsum("fbk,fk->fb", profiled.common[:FOLDS, :, :-1], steps)
        return sums.errors(shift, design, steps, common)

    def log_score_in(self, at: Tensor, theta: Mapping[str, Tensor]) -> Tensor:
        """Log score (n,) of some entries (k,) alone, as if nothing else had been measured, at these parameters."""
        whitening = self.whitening.only(at, self.compared.y.isfinite())
        part = EffectsLikelihood(self.compared.only(at), whitening, {}, 0)
        part.fold = self.fold
        # What all flights have in common would explain a quantity by itself if nothing else is looked at.
        whole = self.design(theta)
        design = part.joined([whole.own[:, at]], whole.alike[at])
        return part.log_score(self.shift(theta)[:, at], design)

    def improbability(self, shift: Tensor, design: Design) -> float:
        """Nats by which all that has a prior is less probable, as fitted to all flights, than if it were zero."""
        sums = self.sums
        profiled = sums.profiled(sums.rest(shift, design, sums.of_columns(design)), everyone=True)
        return 0.5 * float((design.own_ridge * solved(profiled, design.own_ridge)[0] ** 2).sum())

    def gain(self, first: Tensor, second: Tensor) -> tuple[float, float]:
        """Sum of paired differences of log scores (n,) and its standard error, whole aircraft counted as one."""
        total = by_aircraft(first - second, self.compared.airframe)
        spread = float(total.var()) * len(total) if len(total) > 1 else float("inf")
        return float(total.sum()), spread**0.5
