"""How far the gap shrinks: distances before and after, against what two samples of one population would show."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
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
REPLICATES = 30
"""Fleets drawn for each interval, and permutations behind each floor."""
CONFIDENCE = (0.05, 0.95)
"""Ends of intervals: 90 %."""


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
        self.n_airframes = len(names)

    def gap(self, shift: Tensor) -> Gap:
        """Distances before and after a shift (n, p) is taken off the real flights."""
        return Gap(self._mean(self.y), self._mean(self.y - shift), self.floor(shift))

    def floor(self, shift: Tensor) -> float:
        """Mean distance when the corrected flights of both sides are mixed."""
        compared = self.likelihood.compared
        dealt = [*labellings_of(compared, REPLICATES, self.seed)][1:]
        found = noise_floor(self.y - shift, self.real, dealt, self.scale, compared.counts())
        return float(mean_over_quantities(compared, found, self.affected))

    def _mean(self, y: Tensor, real: Tensor | None = None) -> float:
        found = distances(y, self.real if real is None else real, self.scale, self.likelihood.compared.counts())
        return float(mean_over_quantities(self.likelihood.compared, found, self.affected))

    def claimed(self, shift: Tensor, floor: float) -> float | None:
        """Share of the gap in distributions that a shift closes, down to a known floor."""
        return _share(self._mean(self.y), self._mean(self.y - shift), floor)

    def marginal(self, shift: Tensor) -> ClosedShare:
        """The same with a floor of its own and an interval over resampled fleets."""
        floor = self.floor(shift)
        estimate = self.claimed(shift, floor)
        drawn = []
        for index in self._fleets():
            y, s = self.y[index], self.real[index]
            after = (self.y - shift)[index]
            drawn.append(_share(self._mean(y, s), self._mean(after, s), floor))
        return _with_interval(estimate, drawn)

    def conditional(self, shift: Tensor) -> ClosedShare:
        """Share of the squared mean gap, given each flight's own speed, that a shift closes."""
        before, after = self._given_speed(self.y), self._given_speed(self.y - shift)
        drawn = [self._shrunk(before[index], after[index], self.real[index]) for index in self._fleets()]
        return _with_interval(self._shrunk(before, after, self.real), drawn)

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
        for index in [torch.arange(len(self.y)), *self._fleets()]:
            shares = [
                self._shrunk(before[index][s], after[index][s], self.real[index][s])
                for s in (slow[index], ~slow[index])
            ]
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

    def _shrunk(self, before: Tensor, after: Tensor, real: Tensor) -> float | None:
        first, noise = self._squared(before, real)
        second, _ = self._squared(after, real)
        if first <= MIN_SHOWN * noise:
            return None
        return 1 - max(second, 0.0) / first

    def _squared(self, y: Tensor, real: Tensor) -> tuple[float, float]:
        """Mean squared shift in negligible shifts, minus what chance adds; and what chance adds."""
        mean, variance = y[real].nanmean(0), _variance_of_mean(y[real])
        if bool((~real).any()):
            mean, variance = mean - y[~real].nanmean(0), variance + _variance_of_mean(y[~real])
        used = self.affected & mean.isfinite()
        unit = self.likelihood.compared.negligible()[used] ** 2
        noise = float((variance[used] / unit).sum())
        return float((mean[used] ** 2 / unit).sum()) - noise, noise

    def _fleets(self) -> list[Tensor]:
        """Positions of flights in fleets of aircraft drawn with replacement, side by side."""
        generator = torch.Generator().manual_seed(self.seed + 1)
        owner = torch.zeros(self.n_airframes, dtype=torch.bool)
        owner[self.index] = self.real
        members = [torch.nonzero(self.index == c)[:, 0] for c in range(self.n_airframes)]
        found = []
        for _ in range(REPLICATES):
            drawn = []
            for side in (torch.nonzero(owner)[:, 0], torch.nonzero(~owner)[:, 0]):
                if len(side):
                    drawn += side[torch.randint(len(side), (len(side),), generator=generator)].tolist()
            found.append(torch.cat([members[c] for c in drawn]))
        return found


def _variance_of_mean(y: Tensor) -> Tensor:
    seen = y.isfinite()
    n = seen.sum(0).clamp(min=2)
    centred = torch.where(seen, y - y.nanmean(0), 0.0)
    variance: Tensor = centred.square().sum(0) / (n - 1) / n
    return variance


def _share(before: float, after: float, floor: float) -> float | None:
    """Closure: one where the rest is at the floor; none where there was no gap."""
    if before <= floor * MIN_EXCESS:
        return None
    return 1 - (after - floor) / (before - floor)


def _with_interval(estimate: float | None, drawn: list[float | None]) -> ClosedShare:
    known = torch.tensor([x for x in drawn if x is not None], dtype=torch.float64)
    if estimate is None or len(known) < REPLICATES // 2:
        return ClosedShare(estimate, None, None)
    low, high = (float(known.quantile(q)) for q in CONFIDENCE)
    return ClosedShare(estimate, min(low, estimate), max(high, estimate))


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
