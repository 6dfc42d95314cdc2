"""One quantity of samples and flights compared, and the rows of the table of scores that are averaged from it."""

from dataclasses import dataclass
from math import isnan, nan

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import MIN_VALUES, Values, level_spreads
from descentflow.evaluation.metrics.noise_floor import Comparison
from descentflow.evaluation.metrics.score_table import LevelScores, Score
from descentflow.evaluation.metrics.statistic_kinds import DescentQuantity, LevelPart, LevelStatistic, Statistic


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
