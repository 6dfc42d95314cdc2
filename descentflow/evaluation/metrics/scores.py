"""Scores of sampled against held-out descents (paper, section 4), each beside its noise floor."""

from collections.abc import Callable
from math import isnan

import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.noise_floor import compare, compare_flights
from descentflow.evaluation.metrics.score_registry import (
    FUEL,
    QUANTITIES,
    WHOLE,
    descent_statistics,
    level_statistics,
    parts_of,
    profile_of,
    profile_statistics,
)
from descentflow.evaluation.metrics.score_table import LevelScores, Score, ScoreTable
from descentflow.evaluation.metrics.scored_quantity import ScoredQuantity


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
        costly: Whether costly statistics are among them: the AUC of a classifier takes seconds.
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
    nominal = nominal or real.subset(torch.arange(0))
    _check(samples, real, nominal, transition_fl, n_splits)
    rows: list[Score] = []
    whole: list[Score] = []
    by_flight: dict[tuple[str, str], Tensor] = {}
    levels: list[LevelScores] = []
    burns = real.fuel_flow_kg_s is not None and samples.fuel_flow_kg_s is not None
    for quantity in (*QUANTITIES, *([FUEL] if burns else [])):
        sampled, observed = quantity.of(samples), quantity.of(real)
        one = quantity.of(nominal)
        found = ScoredQuantity(
            quantity,
            real.levels_fl,
            sampled,
            observed,
            compare(sampled, observed, seed, n_splits, (lambda _: None) if quantity is FUEL else progress),
            one,
        )
        for part in parts_of(quantity):
            chosen = part.levels(real.levels_fl, transition_fl)
            rows += [found.row(part, chosen, statistic) for statistic in level_statistics()]
        if quantity.by_level:
            levels += [found.by_level(statistic) for statistic in level_statistics()]
            for statistic in profile_statistics():
                compared = compare_flights(statistic, sampled, observed, seed, n_splits)
                profiles = ScoredQuantity(quantity, real.levels_fl, sampled, observed, compared, one)
                whole.append(profiles.profile_row(profile_of(quantity), statistic))
                by_flight[profile_of(quantity).name, statistic.name] = compared.whole[statistic.name]
    both = WHOLE.quantity.of(samples), WHOLE.quantity.of(real)
    for of_descents in descent_statistics(costly=costly):
        compared = compare_flights(of_descents, samples, real, seed, n_splits)
        whole.append(ScoredQuantity(WHOLE.quantity, real.levels_fl, *both, compared).profile_row(WHOLE, of_descents))
        by_flight[WHOLE.name, of_descents.name] = compared.whole[of_descents.name]
    return ScoreTable((*rows, *whole), tuple(levels), by_flight)


def n_comparisons(n_splits: int) -> int:
    """The sum of what :func:`score` calls its progress callback with.

    Example:
        >>> n_comparisons(n_splits=20)  # three quantities
        60
    """
    return len(QUANTITIES) * n_splits


def _check(samples: DescentSet, real: DescentSet, nominal: DescentSet, transition_fl: float, n_splits: int) -> None:
    for name, other in (("samples", samples), ("the nominal descent", nominal)):
        if not torch.equal(other.levels_fl.double(), real.levels_fl.double()):
            raise DataError(
                f"{name} on {_grid(other)} and flights on {_grid(real)}",
                expected="one grid for both",
                mend="put the flights on the checkpoint's grid",
            )
    if len(nominal) > 1:
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
