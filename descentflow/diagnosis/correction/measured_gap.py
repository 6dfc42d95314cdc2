"""The gap entry by entry, with its error: what the next round, with the same real flights, is compared with."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.diagnosis.findings.gap_found import MeasuredEntry
from descentflow.diagnosis.inference.labellings import distances, labellings_of, mean_over_quantities, noise_floor
from descentflow.diagnosis.inference.two_sides import Compared

REPLICATES = 40
"""Fleets behind a standard error, which is then good to a ninth; and permutations behind a floor."""
SAME_EDGE_FL = 0.5
"""Edges of bands are the same within half a level."""


@dataclass(frozen=True)
class MeasuredGap:
    """A gap over some entries: its parts, their mean over quantities, the same of the floor, and its standard error.

    Example:
        >>> MeasuredGap([], gap=0.6, floor=0.1, error=0.02).gap
        0.6
    """

    entries: list[MeasuredEntry]
    gap: float
    floor: float
    error: float


def measured_gap(compared: Compared, chosen: Tensor, seed: int, spreads: Tensor | None = None) -> MeasuredGap:
    """Measure the gap over chosen entries.

    The error is the standard deviation over fleets of whole aircraft, drawn with replacement from either side.

    Args:
        compared: Flights of both sides.
        chosen: (p,) entries.
        seed: Of permutations and fleets.
        spreads: (p,) in which distances are given; those of the flights if absent.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> found = measured_gap(sides, sides.of("tas"), seed=0)
        >>> len(found.entries), found.gap > 10 * found.floor > 0, found.error < 0.1 * found.gap
        (11, True, True)
    """
    at = torch.nonzero(chosen)[:, 0]
    part = compared.only(at)
    y, real, scale = part.y, part.real, (part.scale if spreads is None else spreads[at])
    everything = torch.ones(len(at), dtype=torch.bool)
    counts = everything  # differences of means, as closure is measured
    apart = distances(y, real, scale, counts)
    floor = noise_floor(y, real, list(labellings_of(part, REPLICATES, seed))[1:], scale, counts)
    drawn = [
        mean_over_quantities(part, distances(y[index], real[index], scale, counts), everything)
        for index in _fleets(part, seed)
    ]
    entries = [
        MeasuredEntry(e.quantity, *part.level_range(e), float(scale[i]), float(apart[i]), float(floor[i]))
        for i, e in enumerate(part.entries)
    ]
    gap, least = (float(mean_over_quantities(part, x, everything)) for x in (apart, floor))
    return MeasuredGap(entries, gap, least, float(torch.stack(drawn).std()))


def again(compared: Compared, before: Sequence[MeasuredEntry], seed: int) -> tuple[MeasuredGap, list[MeasuredEntry]]:
    """The gap of other flights over the entries of an earlier one, in its spreads; and those of its entries.

    Args:
        compared: Flights of both sides.
        before: Entries of the earlier round; those that are not measured now are left out.
        seed: Of permutations and fleets.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> warm, same = example_sides(EFFECTS["temperature"], [10.0]), example_sides()
        >>> then = measured_gap(warm, warm.of("tas"), seed=0)
        >>> now, of_then = again(same, then.entries, seed=0)
        >>> len(of_then), now.gap < 0.1 * then.gap
        (11, True)
    """
    chosen = torch.zeros(len(compared.entries), dtype=torch.bool)
    spreads, kept = compared.scale.clone(), []
    for one in before:
        for i, entry in enumerate(compared.entries):
            low, high = compared.level_range(entry)
            of_flight = entry.band < 0
            same = abs(low - one.low_fl) < SAME_EDGE_FL and abs(high - one.high_fl) < SAME_EDGE_FL
            if entry.quantity == one.quantity and (of_flight or same):
                chosen[i], spreads[i] = True, one.spread
                kept.append(one)
    found = measured_gap(compared, chosen, seed, spreads) if kept else MeasuredGap([], 0.0, 0.0, 0.0)
    return found, kept


def mean_of(entries: Sequence[MeasuredEntry]) -> tuple[float, float]:
    """Mean distance and floor over quantities, each of which counts once.

    Example:
        >>> cas, tas = (MeasuredEntry(q, 150.0, 165.0, 1.0, d, 0.1) for q, d in (("cas", 1.0), ("tas", 3.0)))
        >>> mean_of([cas, tas, tas])[0]
        2.0
    """
    names = dict.fromkeys(one.quantity for one in entries)
    of = [[one for one in entries if one.quantity == name] for name in names]
    means = [[sum(x) / len(part) for x in ([p.distance for p in part], [p.floor for p in part])] for part in of]
    count = max(len(means), 1)
    return sum(m[0] for m in means) / count, sum(m[1] for m in means) / count


def _fleets(compared: Compared, seed: int) -> list[Tensor]:
    """Positions of flights in fleets of as many aircraft as either side has, drawn with replacement."""
    generator = torch.Generator().manual_seed(seed + 1)
    names, index = torch.unique(compared.airframe, return_inverse=True)
    members = [torch.nonzero(index == c)[:, 0] for c in range(len(names))]
    owner = torch.zeros(len(names), dtype=torch.bool)
    owner[index] = compared.real
    sides = [side for side in (torch.nonzero(owner)[:, 0], torch.nonzero(~owner)[:, 0]) if len(side)]
    found = []
    for _ in range(REPLICATES):
        drawn = [side[torch.randint(len(side), (len(side),), generator=generator)] for side in sides]
        found.append(torch.cat([members[c] for part in drawn for c in part.tolist()]))
    return found
