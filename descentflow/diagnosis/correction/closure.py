"""How far the gap shrinks: distances before and after, against what two samples of one population would show."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import torch
from scipy.special import stdtrit
from torch import Tensor

from descentflow.diagnosis.findings.cause_found import ClosedShare, RivalClosure
from descentflow.diagnosis.inference.effect_shifts import CAS_RIDGE
from descentflow.diagnosis.inference.gap_distances import distances, mean_over_quantities, noise_floor
from descentflow.diagnosis.inference.labellings import labellings_of
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.search import parameters_of_part

MIN_SHOWN = 3.0
"""Squared mean gap, in what chance gives, below which no share of it can be said to close."""
MIN_EXCESS = 1.02
"""Gap, in noise floors, below which there is none to close."""
FLOORS = 30
"""Permutations behind each floor."""
GROUPS = 20
"""Groups of whole aircraft that are left out in turn, for the errors of closures."""
MIN_GROUPS = 5
"""Aircraft of either side below which no interval is given."""
CONFIDENCE = 0.9
"""Of intervals."""


@dataclass(frozen=True)
class Gap:
    """Mean distance in spreads between flights, before and after the causes are added, and the floor.

    Example:
        >>> Gap(before=0.67, after=0.2, floor=0.08).after
        0.2
    """

    before: float
    after: float
    floor: float


class GapMeasure:
    """Distances between both sides over the entries that differ, before and after causes are added.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> measure = GapMeasure(likelihood, likelihood.compared.of("tas"), seed=0)
        >>> gap = measure.gap(fit_effects(likelihood, ["temperature"]).shift)
        >>> gap.before > 3 * gap.after
        True
    """

    def __init__(self, likelihood: EffectsLikelihood, affected: Tensor, seed: int) -> None:
        """Prepare.

        Args:
            likelihood: Flights of both sides.
            affected: (p,) entries over which distances are taken.
            seed: Of the resampling.
        """
        self.likelihood, self.affected, self.seed = likelihood, affected, seed
        self.y, self.real, self.scale = likelihood.compared.y, likelihood.real, likelihood.compared.scale
        names, self.index = torch.unique(likelihood.compared.airframe, return_inverse=True)
        self.n_airframes, self.at = len(names), torch.nonzero(affected)[:, 0]
        self._floor: tuple[Tensor, float] | None = None

    @cached_property
    def before(self) -> float:
        """Mean distance before a shift is taken off."""
        return self._mean(self.y)

    @cached_property
    def before_of_fleets(self) -> list[tuple[Tensor, float]]:
        """Fleets (n,) that lack a group of aircraft each, and the same of each."""
        return [(kept, self._mean(self.y[kept], self.real[kept])) for kept in self._fleets()]

    def gap(self, shift: Tensor) -> Gap:
        """Distances before and after a shift (n, p) is taken off the real flights."""
        return Gap(self.before, self._mean(self.y - shift), self.floor(shift))

    def floor(self, shift: Tensor) -> float:
        """Mean distance when the corrected flights of both sides are mixed; that of the last shift is known."""
        if self._floor is None or not torch.equal(self._floor[0], shift):
            dealt, left = (
                [*labellings_of(self.likelihood.compared, FLOORS, self.seed)][1:],
                (self.y - shift)[:, self.at],
            )
            counts = self.likelihood.compared.counts()[self.at]
            self._floor = shift, self._over(noise_floor(left, self.real, dealt, self.scale[self.at], counts))
        return self._floor[1]

    def _mean(self, y: Tensor, real: Tensor | None = None) -> float:
        counts, sides = self.likelihood.compared.counts()[self.at], self.real if real is None else real
        return self._over(distances(y[:, self.at], sides, self.scale[self.at], counts))

    def _over(self, found: Tensor) -> float:
        """Mean over quantities of the affected entries' values."""
        whole = torch.zeros(len(self.affected), dtype=found.dtype)
        whole[self.at] = found
        return float(mean_over_quantities(self.likelihood.compared, whole, self.affected))

    def claimed(self, shift: Tensor, floor: float) -> float | None:
        """Share of the gap in distributions that a shift closes, down to a known floor."""
        return _share(self.before, self._mean(self.y - shift), floor)

    def marginal(self, shift: Tensor) -> ClosedShare:
        """The same with a floor of its own, and an interval."""
        floor, left = self.floor(shift), self.y - shift
        fleets = [
            _share(before, self._mean(left[kept], self.real[kept]), floor) for kept, before in self.before_of_fleets
        ]
        return _with_interval(self.claimed(shift, floor), fleets)

    def conditional(self, shift: Tensor) -> ClosedShare:
        """Share of the squared mean gap, given each flight's own speed, that a shift closes."""
        before, after = self._given_speed(self.y), self._given_speed(self.y - shift)
        everyone = torch.ones_like(self.real)
        return _with_interval(
            self._shrunk(before, after, everyone), [self._shrunk(before, after, kept) for kept in self._fleets()]
        )

    def transfer(self, fit: Fit) -> ClosedShare:
        """The same with parameters learnt from slow flights and scored on fast ones, and the other way about."""
        c = self.likelihood
        cas = c.compared.state.cas_mps.mean(1)
        mean = torch.zeros(self.n_airframes, dtype=cas.dtype).index_add_(0, self.index, cas)
        mean = mean / torch.bincount(self.index).clamp(min=1)
        slow = (mean <= mean.median())[self.index]
        shift = torch.zeros_like(self.y)
        for part in (slow, ~slow):
            moved = parameters_of_part(c, fit, part)
            shift = torch.where(part[:, None], shift, c.shift(moved))
        before, after = self._given_speed(self.y), self._given_speed(self.y - shift)
        found = []
        for kept in [torch.ones_like(slow), *self._fleets()]:
            shares = [self._shrunk(before, after, kept & part) for part in (slow, ~slow)]
            known = [x for x in shares if x is not None]
            found.append(sum(known) / len(known) if known else None)
        return _with_interval(found[0], found[1:])

    def _given_speed(self, y: Tensor) -> Tensor:
        """Entries minus what follows from CAS, which is left out itself."""
        c = self.likelihood.compared
        cas = c.columns("cas")
        if not len(cas):
            return y
        covariance = self.likelihood.whitening.covariance
        block = covariance[cas][:, cas] + CAS_RIDGE * torch.diag(covariance.diagonal()[cas])
        centred = (y[:, cas] - y[:, cas].nanmean(0)).nan_to_num(0.0)
        rest: Tensor = y - centred @ torch.linalg.solve(block, covariance[cas])
        rest[:, cas] = torch.nan
        return rest

    def _shrunk(self, before: Tensor, after: Tensor, kept: Tensor) -> float | None:
        """Share of the squared mean gap of some flights (n,) that is gone afterwards; None where there was none."""
        first, noise = self._squared(before, kept)
        second, _ = self._squared(after, kept)
        if first <= MIN_SHOWN * noise:
            return None
        return 1 - max(second, 0.0) / first

    def _squared(self, y: Tensor, kept: Tensor) -> tuple[float, float]:
        """Mean squared shift in negligible shifts, minus what chance adds; and what chance adds."""
        mean, variance = _mean_with_variance(y, self.index, kept & self.real)
        if self.likelihood.has_reference:
            other, more = _mean_with_variance(y, self.index, kept & ~self.real)
            mean, variance = mean - other, variance + more
        used = self.affected & mean.isfinite()
        unit = self.likelihood.compared.negligible()[used] ** 2
        noise = float((variance[used] / unit).sum())
        return float((mean[used] ** 2 / unit).sum()) - noise, noise

    def _fleets(self) -> list[Tensor]:
        """Flights (n,) of fleets that lack a group of aircraft each; none where aircraft are too few."""
        generator = torch.Generator().manual_seed(self.seed + 1)
        owner = torch.zeros(self.n_airframes, dtype=torch.bool)
        owner[self.index] = self.real
        sides = [side for side in (owner, ~owner) if bool(side.any())]
        count = min(GROUPS, *(int(side.sum()) for side in sides))
        if count < MIN_GROUPS:
            return []
        group = torch.zeros(self.n_airframes, dtype=torch.long)
        for side in sides:
            group[side] = torch.randperm(int(side.sum()), generator=generator) % count
        return [group[self.index] != k for k in range(count)]


def _mean_with_variance(y: Tensor, aircraft: Tensor, chosen: Tensor) -> tuple[Tensor, Tensor]:
    """Mean (p,) of the chosen flights and its variance, by sums over whole aircraft."""
    part = y[chosen]
    seen, mean = part.isfinite(), part.nanmean(0)
    names, index = torch.unique(aircraft[chosen], return_inverse=True)
    total = torch.zeros(len(names), y.shape[1], dtype=y.dtype)
    total = total.index_add_(0, index, torch.where(seen, part - mean, 0.0))
    count = seen.sum(0).clamp(min=1)
    return mean, total.square().sum(0) / count**2 * len(names) / max(len(names) - 1, 1)


def _share(before: float, after: float, floor: float) -> float | None:
    """Closure: one where the rest is at the floor; none where there was no gap."""
    if before <= floor * MIN_EXCESS:
        return None
    return 1 - (after - floor) / (before - floor)


def _with_interval(estimate: float | None, fleets: list[float | None]) -> ClosedShare:
    """The estimate with an interval on either side, from fleets that lack a group of aircraft each (the jackknife).

    Fleets drawn with replacement would be further apart than the flights are, before as after, and most of all at the
    floor. Fleets without a group are not, and have the floor of all flights but for a share that is alike in all of
    them. On toys of known closure the interval covers it in 87 to 97 of 100 (Efron and Tibshirani 1993, chapter 11).
    """
    known = torch.tensor([x for x in fleets if x is not None], dtype=torch.float64)
    count = len(known)
    if estimate is None or count < max(MIN_GROUPS, len(fleets)):
        return ClosedShare(estimate, None, None)
    error = float(((count - 1) / count * (known - known.mean()).square().sum()).sqrt())
    half = float(stdtrit(count - 1, (1 + CONFIDENCE) / 2)) * error
    # Beyond one, too: what is left may lie below the floor by chance.
    return ClosedShare(estimate, estimate - half, estimate + half)


def rivals_closure(measure: GapMeasure, shifts: Mapping[str, Tensor], floor: float) -> list[RivalClosure]:
    """Marginal closure that each effect alone would reach, largest first.

    Example:
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> measure = GapMeasure(likelihood, likelihood.compared.of("tas"), seed=0)
        >>> shift = {name: fit_effects(likelihood, [name]).shift for name in ("temperature", "mass")}
        >>> [rival.effect for rival in rivals_closure(measure, shift, measure.floor(shift["temperature"]))]
        ['temperature', 'mass']
    """
    rows = [RivalClosure(name, measure.claimed(shift, floor)) for name, shift in shifts.items()]
    return sorted(rows, key=lambda row: -9.0 if row.closure is None else -row.closure)
