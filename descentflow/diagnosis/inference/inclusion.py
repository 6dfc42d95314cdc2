"""Which effects are named, from the weights of sets of them: inclusion probabilities, groups, thresholds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

NAMED = 0.95
"""Probability that an effect, or one that stands in its place, is in the set, from which it is named."""

Names = tuple[str, ...]


@dataclass(frozen=True)
class WeightedSet:
    """A set of effects with its weight among all that were tried; ``discrepancy`` with a shift of no cause beside it.

    Example:
        >>> WeightedSet(("mass",), discrepancy=False, weight=0.7).effects
        ('mass',)
    """

    effects: Names
    discrepancy: bool
    weight: float


@dataclass(frozen=True)
class Inclusion:
    """What the weights say.

    Attributes:
        best: The most probable set, with or without a discrepancy.
        named: Those of its effects that are named.
        groups: By effect of the best set: those that stand in its place.
        probability: Of every effect, that it is in the set.
        of_group: By effect of the best set: that it is, or one that stands in its place however rarely.
        discrepancy: Probability that a shift of no cause is beside the effects.

    Example:
        >>> sets = [WeightedSet(("mass",), False, 0.6), WeightedSet(("idle_thrust",), False, 0.4)]
        >>> found = inclusion(sets)
        >>> found.named, found.groups, found.probability["mass"]
        (('mass',), {'mass': ('idle_thrust',)}, 0.6)
    """

    best: Names
    named: Names
    groups: Mapping[str, Names]
    probability: Mapping[str, float]
    of_group: Mapping[str, float]
    discrepancy: float


def inclusion(sets: Sequence[WeightedSet], alone: Sequence[WeightedSet] = ()) -> Inclusion:
    """Inclusion probabilities, groups and names.

    A discrepancy may make room for an effect that explains nothing without it: an effect must be as probable among the
    sets without one.

    An effect that is not in the best set stands in for the one whose place it takes: the probability of the sets that
    have it and lack that one says so. The group of an effect is a credible set: as few of those that stand in for it as
    make one of them a cause with the probability from which effects are named.

    Args:
        sets: With weights that add up to one.
        alone: Those without a discrepancy, with weights of their own that add up to one; none to ask for no more.

    Example:
        >>> three = [(("lag", "mass"), 0.5), (("lag", "drag_polar"), 0.47), (("mass",), 0.03)]
        >>> found = inclusion([WeightedSet(names, False, weight) for names, weight in three])
        >>> found.named, found.groups
        (('lag', 'mass'), {'lag': (), 'mass': ('drag_polar',)})
    """
    total: dict[Names, float] = {}
    for one in sets:
        total[one.effects] = total.get(one.effects, 0.0) + one.weight
    best = max(total, key=lambda names: total[names])
    every = dict.fromkeys(name for names in total for name in names)
    probability = {name: sum(w for names, w in total.items() if name in names) for name in every}
    stand_ins: dict[str, Names] = dict.fromkeys(best, ())
    for other in sorted(every, key=lambda o: -probability[o]):
        if other in best or not best or probability[other] == 0.0:
            continue
        apart = {name: sum(w for n, w in total.items() if other in n and name not in n) for name in best}
        # The one that is missing with it more often than it is missing anyway.
        place = max(best, key=lambda name: apart[name] / probability[other] + probability[name])
        stand_ins[place] = (*stand_ins[place], other)
    groups: dict[str, Names] = dict.fromkeys(best, ())
    of_group = {}
    for name in best:
        for other in stand_ins[name]:
            if _either(total, {name, *groups[name]}) >= NAMED:
                break
            groups[name] = (*groups[name], other)
        either = {name, *stand_ins[name]}
        both = [sum(one.weight for one in part if either & set(one.effects)) for part in (sets, alone) if part]
        of_group[name] = min(both)
    named = tuple(name for name in best if of_group[name] >= NAMED)
    discrepancy = sum(one.weight for one in sets if one.discrepancy)
    return Inclusion(best, named, groups, probability, of_group, discrepancy)


def _either(total: Mapping[Names, float], names: set[str]) -> float:
    """Probability of the sets with any of some effects."""
    return sum(weight for effects, weight in total.items() if names & set(effects))
