"""Verdict of an evaluation in words: what its samples are good enough for, and why."""

from math import isnan

from descentflow.evaluation.metrics.classifier import MIN_PAIRS, Detection
from descentflow.evaluation.metrics.score_registry import level_parts
from descentflow.evaluation.metrics.score_table import ScoreTable

STATISTIC = "wasserstein"
"""Distance by which a quantity is judged."""
PASSES = 0.6
"""AUC up to which samples pass for flights: six of ten guesses are right."""


def verdict(scores: ScoreTable, detection: Detection) -> str:
    """Verdict: uses for which samples are good enough, and why.

    A quantity is near the flights if its distance at matched size is below the 95th percentile of the noise floor.

    Args:
        scores: With noise floors.
        detection: The classifier's.

    Example:
        >>> from torch import nan, tensor
        >>> from descentflow.evaluation.metrics.score_table import Score
        >>> near = Score("cas_below_transition", "wasserstein", "kt", equal_size=2.5, floor_high=3.5, n_each=40)
        >>> far = Score("rocd_below_transition", "wasserstein", "ft/min", equal_size=20.0, floor=10.0, floor_high=14.0)
        >>> print(verdict(ScoreTable((near, far)), Detection(tensor([nan]), ())))
        good enough for the distribution of CAS below: as near to held-out flights as other flights are;
        not for the distribution of rate below: 2.0 noise floors off;
        too few held-out flights to judge the course of single descents
    """
    names = {name: part.short for name, part in level_parts().items()}
    rows = [row for row in scores if row.statistic == STATISTIC]
    far = [row for row in rows if row.equal_size > row.floor_high]
    near = [row for row in rows if row.equal_size <= row.floor_high and row.n_each >= MIN_PAIRS]
    unknown = [names[row.quantity] for row in rows if row not in far and row not in near]
    course, auc = "the course of single descents", detection.auc
    lines = []
    if near:
        listed = ", ".join(names[row.quantity] for row in near)
        lines.append(f"good enough for the distribution of {listed}: as near to held-out flights as other flights are")
    if auc <= PASSES:
        lines.append(f"good enough for {course}: a classifier guesses little better than chance, AUC {auc:.2f}")
    for row in far:
        off = f"{row.equal_size / row.floor:.1f} noise floors off" if row.floor else "held-out flights are all alike"
        lines.append(f"not for the distribution of {names[row.quantity]}: {off}")
    if auc > PASSES:
        lines.append(f"not for {course}: a classifier tells samples from flights, AUC {auc:.2f} (chance is 0.5)")
    if isnan(auc):
        unknown.append(course)
    if unknown:
        lines.append(f"too few held-out flights to judge {', '.join(unknown)}")
    return ";\n".join(lines)
