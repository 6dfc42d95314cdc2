"""Scores of sampled against held-out descents (paper, section 4), each beside its noise floor."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan, nan

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.evaluation.metrics.comparison import Comparison, compare, compare_profiles
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import observed_mean
from descentflow.evaluation.metrics.noise_floor import MIN_VALUES
from descentflow.evaluation.metrics.pooled import Values
from descentflow.evaluation.metrics.score_registry import (
    QUANTITIES,
    Part,
    Quantity,
    Statistic,
    level_statistics,
    parts_of,
    profile_of,
    profile_statistics,
)
from descentflow.evaluation.metrics.score_table import LevelScores, Score, ScoreTable


def score(
    samples: DescentSet,
    real: DescentSet,
    transition_fl: float,
    nominal: DescentSet | None = None,
    seed: int = 0,
    n_splits: int = 20,
    *,
    progress: Callable[[int], None] | None = None,
) -> ScoreTable:
    """Score samples against held-out flights by every registered statistic.

    Statistics by level are those of the time to bottom of descent of the descents that span the grid, and of CAS and
    rate at each level, averaged with equal weight over the levels above and over those at or below the transition
    (paper, sections 4.3 to 4.5); statistics of whole profiles are averaged over flights.

    A distance between finite sets is above zero even for a perfect generator. So beside the score of all samples
    against all flights (the paper's), :data:`~descentflow.evaluation.metrics.noise_floor.SIZE` flights are scored
    against as many samples (matched size, column ``equal_size``) and against as many other flights (the noise floor,
    column ``floor``), over the same random splits: equal sizes, hence equal noise, and one size for all types. Splits
    share flights, so ``floor_high`` tells how much the floor depends on the split, not on the flights at hand.

    Levels where a set has fewer than ``MIN_VALUES`` values are left out, and the note counts them.

    Args:
        samples: Sampled descents.
        real: Held-out flights on the same grid.
        transition_fl: Transition level of the type; infinite where the type holds no Mach.
        nominal: The one nominal BADA descent, for the statistics that one descent has.
        seed: Of the splits.
        n_splits: Number of random splits.
        progress: Progress callback: called with numbers that sum to :func:`n_comparisons`.

    Returns:
        A row for each part of a quantity and each statistic, in s, kt and ft/min; NaN with a reason where there are
        too few values.

    Raises:
        DataError: If the grids differ or an observed value is not finite.
        ConfigError: If the transition is NaN or there are no splits.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> table = score(one, two, transition_fl=291.5, n_splits=2)
        >>> table.get("cas_below_transition", "ks").n_each
        30
    """
    _check(samples, real, nominal, transition_fl, n_splits)
    rows: list[Score] = []
    whole: list[Score] = []
    levels: list[LevelScores] = []
    for quantity in QUANTITIES:
        sampled, observed = quantity.of(samples), quantity.of(real)
        one = None if nominal is None else quantity.of(nominal)
        found = _Scored(
            quantity, real.levels_fl, sampled, observed, compare(sampled, observed, seed, n_splits, progress), one
        )
        for part in parts_of(quantity):
            chosen = part.levels(real.levels_fl, transition_fl)
            rows += [found.row(part, chosen, statistic) for statistic in level_statistics()]
        if quantity.by_level:
            levels += [found.by_level(statistic) for statistic in level_statistics()]
            for statistic in profile_statistics():
                compared = compare_profiles(statistic, sampled, observed, seed, n_splits)
                profiles = _Scored(quantity, real.levels_fl, sampled, observed, compared, one)
                whole.append(profiles.profile_row(profile_of(quantity), statistic))
    return ScoreTable((*rows, *whole), tuple(levels))


def n_comparisons(n_splits: int) -> int:
    """The sum of what :func:`score` calls its progress callback with.

    Example:
        >>> n_comparisons(n_splits=20)  # three quantities
        60
    """
    return len(QUANTITIES) * n_splits


@dataclass(frozen=True)
class _Scored:
    """A quantity's comparison, from which rows of the table are averaged."""

    quantity: Quantity
    levels_fl: Tensor
    samples: Values
    real: Values
    found: Comparison
    nominal: Values | None

    def row(self, part: Part, chosen: Tensor, statistic: Statistic) -> Score:
        """The row of a statistic at the levels where ``chosen`` (K,) is true."""
        n_samples, n_real = (int(values[1][:, chosen].any(1).sum()) for values in (self.samples, self.real))
        levels = self.found.whole[statistic.name][chosen]
        used = ~levels.isnan()
        numbers = self._numbers(statistic, levels, chosen, self._spreads()[chosen].nanmean())
        one = None if self.nominal is None or statistic.of_one is None else self._of_nominal(statistic)
        numbers["nominal"] = nan if one is None else float(one[chosen][used].mean())
        return Score(
            part.name,
            statistic.name,
            statistic.unit_of(self.quantity),
            **numbers,
            n_samples=n_samples,
            n_real=n_real,
            n_each=self.found.n_each,
            n_levels=int(used.sum()) if self.quantity.by_level else 0,
            worst_fl=self._worst_fl(chosen, levels) if bool(used.any()) else nan,
            note="; ".join(self._reasons(part, statistic, used, n_samples, n_real, numbers, one is not None)),
        )

    def profile_row(self, part: Part, statistic: Statistic) -> Score:
        """The row of a statistic of whole profiles."""
        flights = self.found.whole[statistic.name]
        used = ~flights.isnan()
        everywhere = torch.ones(1, dtype=torch.bool, device=flights.device)
        numbers = self._numbers(statistic, flights, everywhere, self._spreads().square().nanmean().sqrt())
        if self.nominal is not None and statistic.of_one is not None:
            numbers["nominal"] = float(self._of_nominal(statistic)[used].nanmean())
        reasons = []
        if not bool(used.any()):
            reasons.append(f"fewer than {MIN_VALUES} flights with samples at all of their levels")
        elif statistic.has_floor and isnan(numbers["floor"]):
            reasons.append(f"no noise floor: fewer than {MIN_VALUES} flights with {MIN_VALUES} others at their levels")
        return Score(
            part.name,
            statistic.name,
            statistic.unit_of(self.quantity),
            **numbers,
            n_samples=int(self.samples[1].any(1).sum()),
            n_real=int(used.sum()),
            n_each=self.found.n_each,
            n_levels=len(self.levels_fl),
            note="; ".join(reasons),
        )

    def _spreads(self) -> Tensor:
        """Standard deviation (K,) of the flights at each level that has enough of them, else NaN."""
        values, mask = self.real
        n = mask.sum(0)
        from_mean = torch.where(mask, values - observed_mean(values, mask), 0.0).double()
        return (from_mean.square().sum(0) / (n - 1)).sqrt().where(n >= MIN_VALUES, nan)

    def _numbers(self, statistic: Statistic, whole: Tensor, chosen: Tensor, spread: Tensor) -> dict[str, float]:
        """Score, and where the statistic has one, matched size and noise floor."""
        numbers = {"score": float(whole.nanmean())}
        if statistic.has_floor:
            same, floor = (side[statistic.name][:, chosen].nanmean(1) for side in (self.found.same, self.found.floor))
            numbers |= {
                "equal_size": float(same.mean()),
                "floor": float(floor.mean()),
                "floor_high": float(floor.quantile(0.95)),
            }
            distance, noise = numbers["equal_size"], numbers["floor"]
            numbers["over_floor"] = distance / noise if noise else nan
            numbers["excess"] = statistic.excess(distance, noise, float(spread)) if float(spread) else nan
        return numbers

    def _of_nominal(self, statistic: Statistic) -> Tensor:
        assert self.nominal is not None
        assert statistic.of_one is not None
        return statistic.of_one(self.nominal, self.real)

    def _reasons(
        self,
        part: Part,
        statistic: Statistic,
        used: Tensor,
        n_samples: int,
        n_real: int,
        numbers: dict[str, float],
        has_nominal: bool,
    ) -> list[str]:
        if len(used) == 0:
            return [f"no level of the grid is {part.side} the transition"]
        if isnan(numbers["score"]):
            what = "at any level" if self.quantity.by_level else "that span the grid"
            return [f"fewer than {MIN_VALUES} descents {what} ({n_samples} sampled, {n_real} real in all)"]
        reasons = []
        if not bool(used.all()):
            left_out = int((~used).sum())
            reasons.append(f"{left_out} of {len(used)} levels left out: fewer than {MIN_VALUES} descents")
        if statistic.has_floor and isnan(numbers["floor"]):
            reasons.append(f"no floor: fewer than {MIN_VALUES} of {self.found.n_each} descents on each side")
        if has_nominal and isnan(numbers["nominal"]):
            reasons.append("the nominal descent does not cover these levels")
        return reasons

    def _worst_fl(self, chosen: Tensor, levels: Tensor) -> float:
        if not self.quantity.by_level:
            return nan
        return float(self.levels_fl[chosen][levels.nan_to_num(nan=-1.0).argmax()])

    def by_level(self, statistic: Statistic) -> LevelScores:
        """A statistic at every level."""
        whole = self.found.whole[statistic.name]
        absent = whole.new_full((1, len(whole)), nan)
        sides = (side.get(statistic.name, absent) for side in (self.found.same, self.found.floor))
        # A level that most splits leave out has no band worth drawing.
        same, floor = (splits.where((~splits.isnan()).float().mean(0) > 0.5, nan) for splits in sides)
        low, high = (floor.nanquantile(q, 0) for q in (0.05, 0.95))
        return LevelScores(
            self.quantity.name,
            statistic.name,
            statistic.unit_of(self.quantity),
            self.levels_fl,
            whole,
            same.nanmean(0),
            floor.nanmean(0),
            low,
            high,
        )


def _check(
    samples: DescentSet, real: DescentSet, nominal: DescentSet | None, transition_fl: float, n_splits: int
) -> None:
    for name, other in (("samples", samples), ("the nominal descent", nominal)):
        if other is not None and not torch.equal(other.levels_fl.double(), real.levels_fl.double()):
            raise DataError(
                f"{name} on {_grid(other)} and flights on {_grid(real)}",
                expected="one grid for both",
                mend="put the flights on the checkpoint's grid",
            )
    if nominal is not None and len(nominal) != 1:
        raise DataError(f"{len(nominal)} nominal descents", expected="one", mend="pass the descent of one mass")
    if isnan(transition_fl) or n_splits < 1:
        raise ConfigError(
            f"transition FL{transition_fl} and {n_splits} splits",
            expected="a transition level (infinite where there is none) and at least one split",
            mend="take the transition from the aircraft, and 20 splits",
        )


def _grid(descents: DescentSet) -> str:
    if len(descents.levels_fl) == 0:
        return "no levels"
    return f"{len(descents.levels_fl)} levels FL{descents.levels_fl[0]:.0f}-{descents.levels_fl[-1]:.0f}"
