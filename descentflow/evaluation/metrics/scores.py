"""Scores of sampled against held-out descents (paper, section 4), each beside its real-against-real floor."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan, nan

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.evaluation.metrics.comparison import MIN_VALUES, STATISTICS, Comparison, compare, nominal_error
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.noise_floor import Values
from descentflow.evaluation.metrics.score_table import LevelScores, Score, ScoreTable

__all__ = ["MIN_VALUES", "STATISTICS", "DescentSet", "LevelScores", "Score", "ScoreTable", "score"]


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
    """Score samples against held-out flights.

    KS distance, Wasserstein distance and absolute difference of the means, of the time to bottom of descent of those
    that span the grid, and of CAS and rate at each level, averaged with equal weight over the levels above and over
    those at or below the transition (paper, sections 4.3 to 4.5).

    A distance between finite sets is above zero even for a perfect generator. So beside the score of all samples
    against all flights (the paper's), half of the flights are scored against as many samples (``equal_size``) and
    against the other half (``floor``), over the same random splits: equal sizes, hence equal noise. The halvings
    share flights, so ``floor_high`` tells how much the floor depends on the halving, not on the flights at hand.

    Levels where a set has fewer than :data:`MIN_VALUES` values are left out, and the note counts them.

    Args:
        samples: Sampled descents.
        real: Held-out flights on the same grid.
        transition_fl: Transition level of the type; infinite where the type holds no Mach.
        nominal: The one nominal BADA descent, of which only the mean can be scored.
        seed: Of the splits.
        n_splits: Number of random halvings.
        progress: Called with 1 after each of ``3 n_splits`` comparisons.

    Returns:
        Fifteen rows, one for each quantity and statistic, in s, kt and ft/min; NaN with a reason where there are too
        few values.

    Raises:
        DataError: If the grids differ or an observed value is not finite.
        ConfigError: If the transition is NaN or there are no splits.

    Example:
        >>> table = score(DescentSet.of_trajectories(drawn), DescentSet.of_profiles(held_out), 291.5)
        >>> table.get("cas_below_transition", "ks").equal_size
    """
    _check(samples, real, nominal, transition_fl, n_splits)
    rows: list[Score] = []
    levels: list[LevelScores] = []
    for quantity in QUANTITIES:
        sampled, observed = quantity.of(samples), quantity.of(real)
        found = _Scored(
            quantity,
            real.levels_fl,
            sampled,
            observed,
            compare(sampled, observed, seed, n_splits, progress),
            None if nominal is None else nominal_error(quantity.of(nominal), observed),
        )
        parts = parts_of(quantity, real.levels_fl, transition_fl)
        rows += [row for name, part in parts for row in found.rows(name, part)]
        if quantity.by_level:
            levels += found.by_level()
    return ScoreTable(tuple(rows), tuple(levels))


@dataclass(frozen=True)
class Quantity:
    """What is compared: values and mask of a set, in field units."""

    name: str
    unit: str
    of: Callable[[DescentSet], Values]
    by_level: bool = True


def _times(descents: DescentSet) -> Values:
    return (descents.time_s[:, 0] - descents.time_s[:, -1])[:, None], descents.spans_grid()[:, None]


QUANTITIES = (
    Quantity("time_to_bottom_of_descent", "s", _times, by_level=False),
    Quantity("cas", "kt", lambda s: (s.cas_mps / KT_MPS, s.mask)),
    Quantity("rocd", "ft/min", lambda s: (s.rate_mps / FPM_MPS, s.mask)),
)


def n_comparisons(n_splits: int) -> int:
    """How often :func:`score` calls its progress callback."""
    return len(QUANTITIES) * n_splits


def parts_of(quantity: Quantity, levels_fl: Tensor, transition_fl: float) -> list[tuple[str, Tensor]]:
    """Rows of the table that a quantity has: their names, and which of its levels (K,) each averages."""
    if not quantity.by_level:
        return [(quantity.name, torch.ones(1, dtype=torch.bool, device=levels_fl.device))]
    above = levels_fl > transition_fl
    return [(f"{quantity.name}_{side}_transition", part) for side, part in (("above", above), ("below", ~above))]


@dataclass(frozen=True)
class _Scored:
    """A quantity's comparison, from which rows of the table are averaged."""

    quantity: Quantity
    levels_fl: Tensor
    samples: Values
    real: Values
    found: Comparison
    nominal: Tensor | None

    def rows(self, name: str, part: Tensor) -> list[Score]:
        """Rows of the levels where ``part`` (K,) is true, one for each statistic."""
        counts = [int(chosen[1][:, part].any(1).sum()) for chosen in (self.samples, self.real)]
        return [self._row(name, part, index, *counts) for index in range(len(STATISTICS))]

    def _row(self, name: str, part: Tensor, index: int, n_samples: int, n_real: int) -> Score:
        whole = self.found.whole[index, part]
        used = ~whole.isnan()
        same, floor = (splits[:, index, part].nanmean(1) for splits in (self.found.equal_size, self.found.floor))
        nominal = self.nominal[part][used].mean() if self.nominal is not None and STATISTICS[index] == "mae" else None
        numbers = {
            "score": float(whole.nanmean()),
            "equal_size": float(same.mean()),
            "floor": float(floor.mean()),
            "floor_high": float(floor.quantile(0.95)),
            "nominal": nan if nominal is None else float(nominal),
        }
        return Score(
            name,
            STATISTICS[index],
            self._unit(index),
            **numbers,
            n_samples=n_samples,
            n_real=n_real,
            n_half=self.found.n_half,
            n_levels=int(used.sum()) if self.quantity.by_level else 0,
            worst_fl=self._worst_fl(part, whole) if bool(used.any()) else nan,
            note="; ".join(self._reasons(name, used, n_samples, n_real, numbers, nominal is not None)),
        )

    def _reasons(
        self, name: str, used: Tensor, n_samples: int, n_real: int, numbers: dict[str, float], has_nominal: bool
    ) -> list[str]:
        if len(used) == 0:
            return [f"no level of the grid is {'above' if 'above' in name else 'at or below'} the transition"]
        if isnan(numbers["score"]):
            what = "at any level" if self.quantity.by_level else "that span the grid"
            return [f"fewer than {MIN_VALUES} descents {what} ({n_samples} sampled, {n_real} real in all)"]
        reasons = []
        if not bool(used.all()):
            left_out = int((~used).sum())
            reasons.append(f"{left_out} of {len(used)} levels left out: fewer than {MIN_VALUES} descents")
        if isnan(numbers["floor"]):
            reasons.append(f"no floor: fewer than {MIN_VALUES} of {self.found.n_half} descents in a half")
        if has_nominal and isnan(numbers["nominal"]):
            reasons.append("the nominal descent does not cover these levels")
        return reasons

    def _worst_fl(self, part: Tensor, whole: Tensor) -> float:
        if not self.quantity.by_level:
            return nan
        return float(self.levels_fl[part][whole.nan_to_num(nan=-1.0).argmax()])

    def _unit(self, index: int) -> str:
        return "1" if STATISTICS[index] == "ks" else self.quantity.unit

    def by_level(self) -> list[LevelScores]:
        """Every statistic at every level."""
        return [self._level_scores(index) for index in range(len(STATISTICS))]

    def _level_scores(self, index: int) -> LevelScores:
        same, floor = self.found.equal_size[:, index], self.found.floor[:, index]
        # A level that most halvings leave out has no band worth drawing.
        same, floor = (splits.where((~splits.isnan()).float().mean(0) > 0.5, nan) for splits in (same, floor))
        low, high = (floor.nanquantile(q, 0) for q in (0.05, 0.95))
        return LevelScores(
            self.quantity.name,
            STATISTICS[index],
            self._unit(index),
            self.levels_fl,
            self.found.whole[index],
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
