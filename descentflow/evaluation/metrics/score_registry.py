"""Everything that is scored: one entry has the name of a quantity or a statistic, its unit and how it is computed.

To add a score, add an entry to :data:`STATISTICS`: the table, its CSV file, the bootstrap intervals, the figures, the
callbacks and the study take it from there.
"""

from typing import TypeVar

import torch

from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.evaluation.metrics.classifier import MIN_PAIRS, classifier_auc
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.distances import (
    Values,
    error_of_one,
    error_of_the_mean,
    ks_distance,
    wasserstein_distance,
)
from descentflow.evaluation.metrics.proper import (
    crps_of,
    crps_of_one,
    energy_scores,
    energy_scores_of_one,
    joint_energy_scores,
)
from descentflow.evaluation.metrics.statistic_kinds import (
    DescentQuantity,
    DescentStatistic,
    LevelPart,
    LevelStatistic,
    ProfileStatistic,
    Statistic,
)
from descentflow.physics.fuel import burnt_kg

Kind = TypeVar("Kind", bound=Statistic)


def _times(descents: DescentSet) -> Values:
    return (descents.time_s[:, 0] - descents.time_s[:, -1])[:, None], descents.spans_grid()[:, None]


def _fuel(descents: DescentSet) -> Values:
    flow = descents.fuel_flow_kg_s
    if flow is None:
        nothing = torch.zeros_like(descents.time_s[:, :1])
        return nothing, nothing.bool()
    known = descents.spans_grid() & flow.isfinite().all(1)
    burnt = burnt_kg(flow, descents.time_s, descents.mask)[:, :1]
    return torch.where(known[:, None], burnt, 0.0), known[:, None]


def _cas_and_rate(descents: DescentSet) -> Values:
    (cas, mask), (rate, _) = QUANTITIES[1].of(descents), QUANTITIES[2].of(descents)
    return torch.cat([cas, rate], 1), torch.cat([mask, mask], 1)


QUANTITIES = (
    DescentQuantity("time_to_bottom_of_descent", "Time to bottom of descent", "time to bottom", "s", _times, False),
    DescentQuantity("cas", "CAS", "CAS", "kt", lambda descents: (descents.cas_mps / KT_MPS, descents.mask)),
    DescentQuantity(
        "rocd",
        "Rate of climb or descent",
        "rate",
        "ft/min",
        lambda descents: (descents.rate_mps / FPM_MPS, descents.mask),
    ),
)

FUEL = DescentQuantity("fuel", "Fuel from entry to bottom", "fuel", "kg", _fuel, False)
"""Scored where flights have a fuel flow."""

WHOLE = LevelPart(
    DescentQuantity("descent", "Whole descent", "whole descent", "1", _cas_and_rate),
    "descent",
    "Whole descent",
    "whole descent",
)
"""Quantity of statistics of whole descents: CAS and rate together, at all levels."""

STATISTICS: dict[str, Statistic] = {
    statistic.name: statistic
    for statistic in (
        LevelStatistic("ks", "KS distance", "KS", "1", in_figure=True, compute=ks_distance),
        LevelStatistic(
            "wasserstein",
            "Wasserstein distance",
            "Wasserstein",
            in_figure=True,
            compute=wasserstein_distance,
        ),
        LevelStatistic("mae", "error of the mean", "mean", of_one=error_of_one, compute=error_of_the_mean),
        LevelStatistic("crps", "CRPS", "CRPS", additive=True, of_one=crps_of_one, compute=crps_of),
        ProfileStatistic(
            "energy", "energy score", "energy", additive=True, of_one=energy_scores_of_one, compute=energy_scores
        ),
        DescentStatistic(
            "joint_energy", "joint energy score", "joint energy", "1", additive=True, compute=joint_energy_scores
        ),
        DescentStatistic(
            "auc",
            "AUC of a classifier",
            "AUC",
            "1",
            additive=True,
            compute=classifier_auc,
            costly=True,
            most_splits=3,
            needs=f"{MIN_PAIRS} flights",
        ),
    )
}
"""Statistic by name, in the order of the table."""


def statistics_of(kind: type[Kind]) -> list[Kind]:
    """The registered statistics of a kind.

    Example:
        >>> [one.name for one in statistics_of(LevelStatistic)]
        ['ks', 'wasserstein', 'mae', 'crps']
    """
    return [statistic for statistic in STATISTICS.values() if isinstance(statistic, kind)]


def parts_of(quantity: DescentQuantity) -> list[LevelPart]:
    """Above and at or below the transition for quantities compared by level, else the whole.

    Example:
        >>> [part.name for part in parts_of(QUANTITIES[1])]
        ['cas_above_transition', 'cas_below_transition']
    """
    if not quantity.by_level:
        return [LevelPart(quantity, quantity.name, quantity.label, quantity.short)]
    return [
        LevelPart(
            quantity,
            f"{quantity.name}_{name}_transition",
            f"{quantity.label} {side} the transition altitude",
            f"{quantity.short} {in_short}",
            side,
        )
        for name, side, in_short in (("above", "above", "above transition"), ("below", "at or below", "below"))
    ]


def profile_of(quantity: DescentQuantity) -> LevelPart:
    """The whole profile of a quantity.

    Example:
        >>> profile_of(QUANTITIES[2]).label
        'Rate of climb or descent, whole profile'
    """
    label = f"{quantity.label}, whole profile"
    return LevelPart(quantity, f"{quantity.name}_profile", label, f"{quantity.short} profile")


def level_parts() -> dict[str, LevelPart]:
    """The parts that statistics by level are averaged over, by name: the paper's five quantities.

    Example:
        >>> level_parts()["cas_below_transition"].label
        'CAS at or below the transition altitude'
    """
    return {part.name: part for quantity in QUANTITIES for part in parts_of(quantity)}
