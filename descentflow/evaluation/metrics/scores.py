"""Scores of sampled against held-out descents (paper, section 4), each with its noise floor."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan, nan

import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import MIN_VALUES, Values, level_spreads
from descentflow.evaluation.metrics.noise_floor import Comparison, compare, compare_flights
from descentflow.evaluation.metrics.score_registry import (
    FUEL,
    QUANTITIES,
    WHOLE,
    parts_of,
    profile_of,
    statistics_of,
)
from descentflow.evaluation.metrics.score_table import LevelScores, Score, ScoreTable
from descentflow.evaluation.metrics.statistic_kinds import (
    DescentQuantity,
    DescentStatistic,
    LevelPart,
    LevelStatistic,
    ProfileStatistic,
    Statistic,
)


@dataclass(frozen=True)
class ScoredQuantity:
    """A quantity's comparison, from which rows of the table are averaged.

    Attributes:
        quantity: What was compared.
        levels_fl: (L,) of the grid.
        samples: Its values and mask in the samples.
        real: Those in the flights.
        comparison: The comparison.
        nominal: Those in the nominal descent; empty sets for none.

    Example:
        >>> from descentflow.evaluation.metrics.noise_floor import compare
        >>> from descentflow.evaluation.metrics.score_registry import QUANTITIES, STATISTICS, parts_of
        >>> from descentflow.evaluation.metrics.descent_set import DescentSet
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> cas = QUANTITIES[1]
        >>> compared = compare(cas.of(one), cas.of(two), seed=0, n_splits=2)
        >>> scored = ScoredQuantity(cas, two.levels_fl, cas.of(one), cas.of(two), compared, cas.of(one.subset([])))
        >>> scored.row(parts_of(cas)[1], STATISTICS["ks"], two.levels_fl < 290).quantity
        'cas_below_transition'
    """

    quantity: DescentQuantity
    levels_fl: Tensor
    samples: Values
    real: Values
    comparison: Comparison
    nominal: Values

    def row(self, part: LevelPart, statistic: Statistic, chosen: Tensor) -> Score:
        """The row of a statistic, at the levels where ``chosen`` is true: (K,), and (1,) of whole profiles."""
        by_level, whole = isinstance(statistic, LevelStatistic), self.comparison.whole[statistic.name]
        nominal, spreads = self._of_nominal(statistic), level_spreads(*self.real)
        seen = [values[1].any(1) for values in (self.samples, self.real)]
        if by_level:
            whole, nominal, spread = whole[chosen], nominal[chosen], spreads[chosen].nanmean()
            seen = [values[1][:, chosen].any(1) for values in (self.samples, self.real)]
        else:
            spread = spreads.square().nanmean().sqrt()
        used = ~whole.isnan()
        numbers = self._numbers(statistic, whole, chosen, spread)
        numbers["nominal"] = float(nominal[used].mean() if by_level else nominal[used].nanmean())
        n_samples, n_real = (int(each.sum()) for each in seen)
        is_levels = by_level and self.quantity.by_level
        return Score(
            part.name,
            statistic.name,
            statistic.unit_of(self.quantity),
            **numbers,
            n_samples=n_samples,
            n_real=n_real if by_level else int(used.sum()),
            n_each=self.comparison.n_each,
            n_levels=(int(used.sum()) if is_levels else 0) if by_level else len(self.levels_fl),
            worst_fl=self._worst_fl(chosen, whole) if is_levels and bool(used.any()) else nan,
            note="; ".join(self._reasons(part, statistic, used, (n_samples, n_real), numbers)),
        )

    def _numbers(self, statistic: Statistic, whole: Tensor, chosen: Tensor, spread: Tensor) -> dict[str, float]:
        """Score, and where the statistic has one, matched size and noise floor."""
        numbers = {"score": float(whole.nanmean())}
        if statistic.has_floor:
            same, floor = (
                side[statistic.name][:, chosen].nanmean(1) for side in (self.comparison.same, self.comparison.floor)
            )
            distance, noise = float(same.mean()), float(floor.mean())
            numbers |= {
                "equal_size": distance,
                "floor": noise,
                "floor_high": float(floor.quantile(0.95)),
                "over_floor": distance / noise if noise else nan,
                "excess": statistic.excess(distance, noise, float(spread)) if float(spread) else nan,
            }
        return numbers

    def _of_nominal(self, statistic: Statistic) -> Tensor:
        """The nominal descent's statistic, of the shape of the samples'; NaN where there is none."""
        if statistic.of_one is None or not len(self.nominal[0]):
            return torch.full_like(self.comparison.whole[statistic.name], nan)
        return statistic.of_one(self.nominal, self.real)

    def _reasons(
        self, part: LevelPart, statistic: Statistic, used: Tensor, n: tuple[int, int], numbers: dict[str, float]
    ) -> list[str]:
        """Reasons for missing numbers and levels."""
        no_floor = statistic.has_floor and isnan(numbers["floor"])
        if not isinstance(statistic, LevelStatistic):
            if not bool(used.any()):
                return [f"fewer than {statistic.needs}"]
            return [f"no noise floor: fewer than {statistic.needs} on each side"] if no_floor else []
        if len(used) == 0:
            return [f"no level of the grid is {part.side} the transition"]
        if isnan(numbers["score"]):
            what = "at any level" if self.quantity.by_level else "that span the grid"
            return [f"fewer than {MIN_VALUES} descents {what} ({n[0]} sampled, {n[1]} real in all)"]
        reasons = []
        if not bool(used.all()):
            left_out = int((~used).sum())
            reasons.append(f"{left_out} of {len(used)} levels left out: fewer than {MIN_VALUES} descents")
        if no_floor:
            reasons.append(f"no floor: fewer than {MIN_VALUES} of {self.comparison.n_each} descents on each side")
        if len(self.nominal[0]) and statistic.of_one is not None and isnan(numbers["nominal"]):
            reasons.append("the nominal descent does not cover these levels")
        return reasons

    def _worst_fl(self, chosen: Tensor, levels: Tensor) -> float:
        return float(self.levels_fl[chosen][levels.nan_to_num(nan=-1.0).argmax()])

    def by_level(self, statistic: Statistic) -> LevelScores:
        """A statistic at every level."""
        whole = self.comparison.whole[statistic.name]
        absent = whole.new_full((1, len(whole)), nan)
        sides = (side.get(statistic.name, absent) for side in (self.comparison.same, self.comparison.floor))
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


def score(
    samples: DescentSet,
    real: DescentSet,
    transition_fl: float,
    nominal: DescentSet | None = None,
    seed: int = 0,
    n_splits: int = 20,
    *,
    costly: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> ScoreTable:
    """Score samples against held-out flights by every registered statistic.

    Statistics by level are those of the time to bottom of descent of the descents that span the grid, and of CAS and
    rate at each level, averaged with equal weight over the levels above and over those at or below the transition
    (paper, sections 4.3 to 4.5); statistics of whole profiles, and of whole descents, are averaged over flights.

    A distance between finite sets is above zero even for a perfect generator. So with the score of all samples
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
        costly: Whether costly statistics are among them: the AUC of a classifier takes seconds.
        progress: Progress callback: called with numbers that sum to :func:`n_comparisons`.

    Returns:
        A row for each part of a quantity and each statistic, in s, kt and ft/min; NaN with a reason where there are
        too few values.

    Raises:
        DataError: If the grids differ or an observed value is not finite.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> table = score(one, two, transition_fl=291.5, n_splits=2)
        >>> table.get("cas_below_transition", "ks").n_each
        30
    """
    nominal = nominal or real.subset(torch.arange(0))
    _check_grids(real, samples=samples, nominal=nominal)
    rows: list[Score] = []
    whole: list[Score] = []
    by_flight: dict[tuple[str, str], Tensor] = {}
    levels: list[LevelScores] = []

    def scored(quantity: DescentQuantity, compared: Comparison) -> ScoredQuantity:
        of = quantity.of
        return ScoredQuantity(quantity, real.levels_fl, of(samples), of(real), compared, of(nominal))

    def add_whole(part: LevelPart, statistic: Statistic, compared: Comparison) -> None:
        everywhere = torch.ones(1, dtype=torch.bool, device=real.mask.device)
        whole.append(scored(part.quantity, compared).row(part, statistic, everywhere))
        by_flight[part.name, statistic.name] = compared.whole[statistic.name]

    burns = real.fuel_flow_kg_s is not None and samples.fuel_flow_kg_s is not None
    for quantity in (*QUANTITIES, *([FUEL] if burns else [])):
        sides = quantity.of(samples), quantity.of(real)
        shown = (lambda _: None) if quantity is FUEL else progress
        of_quantity = scored(quantity, compare(*sides, seed, n_splits, shown))
        for part in parts_of(quantity):
            chosen = part.levels(real.levels_fl, transition_fl)
            rows += [of_quantity.row(part, statistic, chosen) for statistic in statistics_of(LevelStatistic)]
        if quantity.by_level:
            levels += [of_quantity.by_level(statistic) for statistic in statistics_of(LevelStatistic)]
            for profile in statistics_of(ProfileStatistic):
                add_whole(profile_of(quantity), profile, compare_flights(profile, *sides, seed, n_splits))
    for statistic in statistics_of(DescentStatistic):
        if costly or not statistic.costly:
            add_whole(WHOLE, statistic, compare_flights(statistic, samples, real, seed, n_splits))
    return ScoreTable((*rows, *whole), tuple(levels), by_flight)


def n_comparisons(n_splits: int) -> int:
    """The sum of what :func:`score` calls its progress callback with.

    Example:
        >>> n_comparisons(n_splits=20)  # three quantities
        60
    """
    return len(QUANTITIES) * n_splits


def _check_grids(real: DescentSet, **others: DescentSet) -> None:
    for name, other in others.items():
        if not torch.equal(other.levels_fl.double(), real.levels_fl.double()):
            raise DataError(
                f"{name} on {_grid(other)} and flights on {_grid(real)}",
                expected="one grid for both",
                mend="put the flights on the checkpoint's grid",
            )


def _grid(descents: DescentSet) -> str:
    if len(descents.levels_fl) == 0:
        return "no levels"
    return f"{len(descents.levels_fl)} levels FL{descents.levels_fl[0]:.0f}-{descents.levels_fl[-1]:.0f}"
