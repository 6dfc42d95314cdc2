r"""The gap in some entries, the share of it that causes close, and what the next round is compared with.

With s the spread between flights, the gap of an entry is :math:`|\bar y_r - \bar y_s| / s`; that of several is the mean
over their quantities, each of which counts once. Of a gap before and after the simulator has the causes,

.. math:: \mathrm{closure} = 1 - \frac{\mathrm{after} - \mathrm{floor}}{\mathrm{before} - \mathrm{floor}},

with the noise floor that two samples of one population of these sizes show. Errors are by the jackknife over groups of
whole aircraft. The page, `gap.json` and the round after all take these numbers.
"""

from collections.abc import Sequence
from statistics import fmean

import torch
from torch import Tensor

from descentflow.diagnosis.findings.cause_found import ClosedShare
from descentflow.diagnosis.findings.costs_found import NINETY
from descentflow.diagnosis.findings.gap_found import MeasuredEntry
from descentflow.diagnosis.gap._labellings import distances, labellings_of, mean_over_quantities, noise_floor
from descentflow.diagnosis.sides.vectors import Vectors

FLOOR_LABELLINGS = 30
"""Labellings behind a noise floor."""
JACKKNIFE_GROUPS = 20
"""Groups of aircraft that are left out in turn."""
LEAST_GAP = 1.02
"""Gap, in noise floors, below which there is none to close."""
SAME_EDGE_FL = 0.5
"""Edges of bands are the same within half a level."""


class MeasuredGap:
    """Difference of the means of both sides over some entries, before and after a correction."""

    def __init__(self, compared: Vectors, entries: Tensor, seed: int, spreads: Tensor | None = None) -> None:
        """Measure the gap.

        Args:
            compared: Flights of both sides.
            entries: (p,) those over which it is measured.
            seed: Of the labellings and groups of aircraft.
            spreads: (p,) in which distances are given; those of the flights if absent.
        """
        self._at = torch.nonzero(entries)[:, 0]
        self._part = compared.only(self._at)
        self._scale = self._part.scale if spreads is None else spreads[self._at]
        # Of means: that a simulator's flights differ less widely than real ones is no cause's matter.
        self._means = torch.ones(len(self._at), dtype=torch.bool)
        self._dealt = list(labellings_of(self._part, FLOOR_LABELLINGS, seed))[1:]
        names, index = torch.unique(self._part.airframe, return_inverse=True)
        group = torch.randperm(len(names), generator=torch.Generator().manual_seed(seed))[index] % JACKKNIFE_GROUPS
        self._without = [group != k for k in range(JACKKNIFE_GROUPS)]
        self.before = self._over(self._apart(self._part.y))
        self._before = [self._over(self._apart(self._part.y, kept)) for kept in self._without]

    @property
    def error(self) -> float:
        """Standard error of the gap before."""
        return _jackknife(self._before)

    def entries(self) -> list[MeasuredEntry]:
        """The gap before and its floor, entry by entry."""
        apart, floor, part = self._apart(self._part.y), self._floors(self._part.y), self._part
        return [
            MeasuredEntry(e.quantity, *part.level_range(e), float(self._scale[i]), float(apart[i]), float(floor[i]))
            for i, e in enumerate(part.entries)
        ]

    def after(self, left: Tensor) -> float:
        """The gap once entries are (n, p)."""
        return self._over(self._apart(left[:, self._at]))

    def floor(self, left: Tensor) -> float:
        """The gap that two samples of one population of these sizes show, by entries (n, p)."""
        return self._over(self._floors(left[:, self._at]))

    def share(self, left: Tensor) -> ClosedShare:
        """Share of the gap above the floor that is closed, with a 90 % interval."""
        floor = self.floor(left)
        estimate = closed_share(self.before, floor, self.after(left), floor)
        pairs = zip(self._before, self._without, strict=True)
        shares = [
            closed_share(before, floor, self._over(self._apart(left[:, self._at], kept)), floor)
            for before, kept in pairs
        ]
        known = [one for one in shares if one is not None]
        if estimate is None or len(known) < JACKKNIFE_GROUPS:
            return ClosedShare(estimate, None, None)
        half = NINETY * _jackknife(known)
        return ClosedShare(estimate, estimate - half, estimate + half)

    def _apart(self, y: Tensor, kept: Tensor | None = None) -> Tensor:
        """Distance (k,) of the entries (n, k) of all flights, or of those that are kept."""
        rows = slice(None) if kept is None else kept
        return distances(y[rows], self._part.real[rows], self._scale, self._means)

    def _floors(self, y: Tensor) -> Tensor:
        return noise_floor(y, self._part.real, self._dealt, self._scale, self._means)

    def _over(self, values: Tensor) -> float:
        return float(mean_over_quantities(self._part, values, self._means))


def _jackknife(without: Sequence[float]) -> float:
    """Standard error by values that each leave one group out."""
    mean, count = fmean(without), len(without)
    return float(((count - 1) / count * sum((one - mean) ** 2 for one in without)) ** 0.5)


def closed_share(before: float, floor_before: float, after: float, floor_after: float) -> float | None:
    """Share of a gap that is closed: one where the rest is at the floor; None where there was no gap.

    Example:
        >>> closed_share(1.1, 0.1, 0.35, 0.1), closed_share(0.1, 0.1, 0.1, 0.1)
        (0.75, None)
    """
    none = before <= floor_before * LEAST_GAP
    return None if none else 1.0 - (after - floor_after) / (before - floor_before)


def measured_again(compared: Vectors, before: Sequence[MeasuredEntry]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Entries (p,) of an earlier gap that are compared now, and the spreads, distances and floors (p,) that they had.

    Args:
        compared: Flights of both sides.
        before: Entries of the earlier round; those that are not measured now are left out.
    """
    chosen = torch.zeros(len(compared.entries), dtype=torch.bool)
    spreads, distance, floor = (compared.scale.clone() for _ in range(3))
    for one in before:
        for i, entry in enumerate(compared.entries):
            low, high = compared.level_range(entry)
            same = abs(low - one.low_fl) < SAME_EDGE_FL and abs(high - one.high_fl) < SAME_EDGE_FL
            if entry.quantity == one.quantity and (entry.band < 0 or same):
                chosen[i], spreads[i], distance[i], floor[i] = True, one.spread, one.distance, one.floor
    return chosen, spreads, distance, floor
