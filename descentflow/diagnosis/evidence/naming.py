"""Named effects, with what else may stand in their place, and the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from descentflow.diagnosis.evidence.assumptions import Assumptions
from descentflow.diagnosis.evidence.moments import Moments
from descentflow.diagnosis.evidence.set_fit import Names, SetFit, SetFits
from descentflow.diagnosis.findings.findings import Verdict
from descentflow.diagnosis.inference.linear_gaussian import Array

LEAST_SHOWN = 0.02
"""Probability below which an effect is not looked at."""


@dataclass(frozen=True)
class Named:
    """Result of the weights of sets.

    Attributes:
        weights: (sets,) that sum to one.
        probability: By effect: that it is among the causes.
        unknown: Probability of an unknown cause.
        none: Probability that there is nothing.
        groups: By named effect, likeliest first: others that may stand in its place.

    Example:
        >>> Named(np.ones(1), {"mass": 1.0}, 0.0, 0.0, {"mass": ()}).groups
        {'mass': ()}
    """

    weights: Array
    probability: Mapping[str, float]
    unknown: float
    none: float
    groups: Mapping[str, Names]


def name_effects(sets: Sequence[SetFit], assumed: Assumptions, alike: Sequence[Sequence[str]] = ()) -> Named:
    """Name the effects that are in nearly all of the weight, alone or with the fewest that may stand in their place.

    Args:
        sets: Fitted, with plausible sizes.
        assumed: Constants.
        alike: Groups of effects that no flight can tell apart.

    Example:
        >>> weights = {"mass": 0.0, "drag": -1.0}
        >>> fits = [SetFit((name,), {}, {}, {}, weight, {}, np.eye(1)) for name, weight in weights.items()]
        >>> name_effects(fits, Assumptions()).groups
        {'mass': ('drag',)}
    """
    weights = np.exp(np.array([one.log_weight for one in sets]) - max(one.log_weight for one in sets))
    weights = weights / weights.sum()

    def held(*names: str) -> float:
        """Weight of the sets that have one of these."""
        return float(sum(w for w, one in zip(weights, sets, strict=True) if set(names) & set(one.names)))

    every = dict.fromkeys(name for one in sets for name in one.names)
    probability = {name: held(name) for name in sorted(every, key=lambda name: -held(name))}
    groups: dict[str, Names] = {}
    for name, alone in probability.items():
        if alone < LEAST_SHOWN or any(name in group for group in groups.values()):
            continue
        group = [name]
        others = [other for other in probability if other not in groups and other != name]
        for other in others:
            if held(*group) >= assumed.named:
                break
            together = sum(w for w, one in zip(weights, sets, strict=True) if name in one.names and other in one.names)
            if together < 1.0 - assumed.named and held(*group, other) > held(*group) + LEAST_SHOWN:
                group.append(other)
        if held(*group) < assumed.named or alone < 1.0 / (len(group) + 1):
            continue
        same = [other for members in alike if name in members for other in members]
        group += [o for o in others if o in same and o not in group and probability[o] * assumed.alike > alone]
        groups[name] = tuple(group[1:])
    unknown = float(sum(w for w, one in zip(weights, sets, strict=True) if one.has_unknown))
    none = float(sum(w for w, one in zip(weights, sets, strict=True) if one.is_null))
    return Named(weights, probability, unknown, none, groups)


def verdict_of(named: Named, best: SetFit, known: Moments, fits: SetFits) -> Verdict:
    """Verdict: no gap, or a gap of which the named causes are all, a part, or none.

    Args:
        named: By the weights.
        best: The heaviest set with all that is named.
        known: Moments of both sides.
        fits: Of the catalogue.

    Example:
        >>> known = Moments(np.zeros(1), np.eye(1), np.zeros((1, 1)), np.ones(1), np.array(["rate"]), np.eye(1))
        >>> nothing = SetFit((), {}, {}, {}, 0.0, {}, np.eye(1))
        >>> verdict_of(Named(np.ones(1), {}, 0.0, 1.0, {}), nothing, known, SetFits(known, [], Assumptions()))
        'none'
    """
    if named.none > 1.0 - fits.assumed.named:
        return "none"
    if not named.groups:
        return "unknown"
    if named.unknown <= 0.5:
        return "effect"
    shift = sum((best.shifts[name] for name in named.groups), np.zeros(len(known.difference)))
    rest = known.difference - best.shift
    of_cause = {name: scale for name, scale in best.unknown.items() if name not in best.air}
    left = fits.unknown_covariance(of_cause) @ np.linalg.solve(best.noise, rest)
    explained, unexplained = (float(x @ np.linalg.solve(known.covariance, x)) for x in (shift, left))
    return "unknown" if unexplained > explained else "partial"
