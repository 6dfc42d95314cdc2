"""Scores of sampled against held-out descents (paper, section 4), each with its noise floor."""

from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.evaluation.metrics.descent_set import DescentSet
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
from descentflow.evaluation.metrics.scored_quantity import ScoredQuantity
from descentflow.evaluation.metrics.statistic_kinds import (
    DescentQuantity,
    DescentStatistic,
    LevelPart,
    LevelStatistic,
    ProfileStatistic,
    Statistic,
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
