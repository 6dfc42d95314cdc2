"""One quantity of samples and flights compared, and the rows of the table of scores that are averaged from it."""

from dataclasses import dataclass
from math import isnan, nan

import torch
from torch import Tensor

from descentflow.evaluation.metrics.distances import Values, observed_mean
from descentflow.evaluation.metrics.noise_floor import MIN_VALUES, Comparison
from descentflow.evaluation.metrics.score_table import LevelScores, Score
from descentflow.evaluation.metrics.statistic_kinds import Part, Quantity, Statistic


@dataclass(frozen=True)
class ScoredQuantity:
    """A quantity's comparison, from which rows of the table are averaged.

    Attributes:
        quantity: What was compared.
        levels_fl: (L,) of the grid.
        samples: Its values and mask in the samples.
        real: Those in the flights.
        found: The comparison.
        nominal: Those in the nominal descent, if there is one; else empty.

    Example:
        >>> from descentflow.evaluation.metrics.noise_floor import compare
        >>> from descentflow.evaluation.metrics.score_registry import QUANTITIES, STATISTICS, parts_of
        >>> from descentflow.evaluation.metrics.descent_set import DescentSet
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 60, seed=s).trajectories) for s in (1, 2))
        >>> cas = QUANTITIES[1]
        >>> compared = compare(cas.of(one), cas.of(two), seed=0, n_splits=2)
        >>> scored = ScoredQuantity(cas, two.levels_fl, cas.of(one), cas.of(two), compared)
        >>> scored.row(parts_of(cas)[1], two.levels_fl < 290, STATISTICS["ks"]).quantity
        'cas_below_transition'
    """

    quantity: Quantity
    levels_fl: Tensor
    samples: Values
    real: Values
    found: Comparison
    nominal: Values = (torch.empty(0), torch.empty(0))

    def row(self, part: Part, chosen: Tensor, statistic: Statistic) -> Score:
        """The row of a statistic at the levels where ``chosen`` (K,) is true."""
        n_samples, n_real = (int(values[1][:, chosen].any(1).sum()) for values in (self.samples, self.real))
        levels = self.found.whole[statistic.name][chosen]
        used = ~levels.isnan()
        numbers = self._numbers(statistic, levels, chosen, self._spreads()[chosen].nanmean())
        numbers["nominal"] = float(self._of_nominal(statistic)[chosen][used].mean())
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
            note="; ".join(self._reasons(part, statistic, used, n_samples, n_real, numbers)),
        )

    def profile_row(self, part: Part, statistic: Statistic) -> Score:
        """The row of a statistic of whole profiles."""
        flights = self.found.whole[statistic.name]
        used = ~flights.isnan()
        everywhere = torch.ones(1, dtype=torch.bool, device=flights.device)
        numbers = self._numbers(statistic, flights, everywhere, self._spreads().square().nanmean().sqrt())
        numbers["nominal"] = float(self._of_nominal(statistic)[used].nanmean())
        reasons = []
        if not bool(used.any()):
            reasons.append(f"fewer than {statistic.needs}")
        elif statistic.has_floor and isnan(numbers["floor"]):
            reasons.append(f"no noise floor: fewer than {statistic.needs} on each side")
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

    def _has_nominal(self, statistic: Statistic) -> bool:
        return len(self.nominal[0]) > 0 and statistic.of_one is not None

    def _of_nominal(self, statistic: Statistic) -> Tensor:
        """The nominal descent's statistic, of the shape of the samples'; NaN where there is none."""
        if not self._has_nominal(statistic):
            return torch.full_like(self.found.whole[statistic.name], nan)
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
        if self._has_nominal(statistic) and isnan(numbers["nominal"]):
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
