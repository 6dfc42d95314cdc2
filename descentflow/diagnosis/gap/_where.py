"""Place of the gap: cells of quantity and altitude, each against permuted flights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import torch
from torch import Tensor

from descentflow.diagnosis.findings.gap_found import GapCell
from descentflow.diagnosis.gap._labellings import Labellings, distances, labellings_of, noise_floor, step_down
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Vectors
from descentflow.measurements.quantity_registry import QUANTITIES

PERMUTATIONS = 1999
"""Behind the p-value of each cell, which is at least one in 2,000: 5 % is known to half a percent."""
FLOOR_PERMUTATIONS = 10
"""Permutations behind the noise floor of each cell."""
LEAST_EXCESS = 0.5
"""An excess over the floor below this many negligible shifts is not counted as a gap, however significant."""


BANDS_IN_CELL = 3
"""Neighbouring bands of a cell, some 4,500 ft: fewer would be tests of little power, more would hide where it is."""
MIN_FLIGHTS_IN_CELL = 3
"""Flights, and aircraft, of either side that must show an entry for a difference to be measured in spreads."""


@dataclass(frozen=True)
class Cell:
    """Entries (k,) of one quantity in neighbouring bands on one side of the transition.

    Example:
        >>> cell = Cell("tas", torch.tensor([22, 23, 24]), 150.0, 210.0, "below")
        >>> len(cell.at)
        3
    """

    quantity: str
    at: Tensor
    low_fl: float
    high_fl: float
    regime: str


def cells(compared: Vectors, transition_fl: float) -> list[Cell]:
    """Cut the entries into cells."""
    cut: list[Cell] = []
    for quantity in compared.quantities():
        columns = compared.columns(quantity).tolist()
        for regime, run in groupby(columns, key=lambda i: _regime(compared, i, transition_fl)):
            bands = list(run)
            for at in (bands[k : k + BANDS_IN_CELL] for k in range(0, len(bands), BANDS_IN_CELL)):
                first, last = (compared.level_range(compared.entries[i]) for i in (at[0], at[-1]))
                cut.append(Cell(quantity, torch.tensor(at), first[0], last[1], regime))
    return cut


def _regime(compared: Vectors, i: int, transition_fl: float) -> str:
    if compared.entries[i].band < 0:
        return "all"
    low, high = compared.level_range(compared.entries[i])
    return "above" if (low + high) / 2 > transition_fl else "below"


def cell_scores(y: Tensor, labels: Labellings, chosen: Sequence[Cell]) -> Tensor:
    """Difference of both sides in every cell under every labelling: (1 + b, cells), near normal without a gap.

    The squares of Welch's t, of means and of squares, are added over a cell's entries; their cube root is close to a
    normal law (Wilson and Hilferty 1931), whatever the number of entries, and is measured in the labellings' own mean
    and spread, the true one among them like any other.

    Args:
        y: (n, p) flights, NaN where an entry is not seen.
        labels: Of the aircraft.
        chosen: Cells to score.
    """
    used, place = torch.unique(torch.cat([cell.at for cell in chosen]), return_inverse=True)
    statistic, places = squared_t(y[:, used], labels), torch.split(place, [len(cell.at) for cell in chosen])
    root = torch.stack([statistic[:, at].sum(1) for at in places], 1) ** (1 / 3)
    scores: Tensor = (root - root.mean(0)) / root.std(0).clamp(min=1e-12)
    return scores


def squared_t(y: Tensor, labels: Labellings) -> Tensor:
    """Squares of Welch's t (1 + b, p) of both sides' means, plus those of their squares about the common mean.

    Variances are of sums over whole aircraft, side by side. So they are right however many flights each aircraft has,
    and permutations hold for sides whose aircraft differ in that (Janssen 1997; Chung and Romano 2013): only the
    aircraft must be many. Where there is one side, means alone are compared with zero.

    Example:
        >>> from descentflow.diagnosis.gap._labellings import labellings
        >>> y = torch.tensor([[0.0], [1.0], [2.0], [6.0], [7.0], [8.0]]).double()
        >>> labels = labellings(torch.arange(6), torch.arange(6) > 2, 0, seed=0)
        >>> of_means = 6.0**2 / (1.0 / 3 + 1.0 / 3)
        >>> squares = (y - 4) ** 2  # their means are alike
        >>> torch.allclose(squared_t(y, labels), torch.tensor([[of_means]]).double())
        True
    """
    seen = y.isfinite()
    if not labels.two_sided:
        return _one_sided(y.nan_to_num(0.0), seen, labels)
    centred = torch.where(seen, y - y.nanmean(0), 0.0)
    variance = centred.square().sum(0) / seen.sum(0).clamp(min=1)
    squares = torch.where(seen, centred.square() / variance.clamp(min=1e-18), 0.0)
    count = labels.by_aircraft(seen.double())
    return _welch(centred, count, labels) + _welch(squares, count, labels)


def _welch(values: Tensor, count: Tensor, labels: Labellings) -> Tensor:
    """Squared t of the difference of two means; ``count`` (c, p) is how many flights of each aircraft are in them."""
    total = labels.by_aircraft(values)
    parts = [count, total, total.square(), total * count, count.square(), (count > 0).double()]
    stacked = torch.cat(parts, 1)
    mine = labels.sums(stacked)
    means, variances = [], []
    for side in (mine, stacked.sum(0) - mine):
        n, sum_y, sum_yy, sum_yn, sum_nn, aircraft = side.chunk(len(parts), 1)
        mean = sum_y / n.clamp(min=1)
        scatter = (sum_yy - 2 * mean * sum_yn + mean.square() * sum_nn).clamp(min=0.0)
        variance = scatter / n.clamp(min=1).square() * aircraft / (aircraft - 1).clamp(min=1)
        means.append(mean)
        variances.append(torch.where((n < MIN_FLIGHTS_IN_CELL) | (aircraft < MIN_FLIGHTS_IN_CELL), torch.inf, variance))
    difference = means[0] - means[1]
    return difference.square() / (variances[0] + variances[1]).clamp(min=1e-18)


def _one_sided(y: Tensor, seen: Tensor, labels: Labellings) -> Tensor:
    """Squared t of a mean that is claimed to be zero; signs leave the squares of aircraft as they are."""
    total = labels.by_aircraft(torch.where(seen, y, 0.0))
    t_squared: Tensor = labels.sums(total).square() / total.square().sum(0).clamp(min=1e-18)
    return t_squared


def where(compared: Compared, transition_fl: float, seed: int) -> list[GapCell]:
    """Distances, noise floors and corrected p-values of every cell, largest share first.

    Labels are permuted by whole aircraft.
    """
    dealt, known = labellings_of(compared, PERMUTATIONS, seed), cells(compared, transition_fl)
    p_values = step_down(cell_scores(compared.y, dealt, known)).tolist()
    some = [dealt.flights(1 + k) for k in range(min(FLOOR_PERMUTATIONS, len(dealt) - 1))]
    y, real, scale, negligible = compared.y, compared.real, compared.scale, compared.negligible()
    apart = distances(y, real, scale, compared.counts())
    mixed = noise_floor(y, real, some, scale, compared.counts())
    excess, rows = (apart - mixed).clamp(min=0.0), []
    for cell, p_value in zip(known, p_values, strict=True):
        distance, floor = (float((of_entry * scale)[cell.at].mean()) for of_entry in (apart, mixed))
        large = distance - floor > LEAST_EXCESS * float(negligible[cell.at].mean())
        counts = large and p_value <= compared.assumed.false_cells
        row = GapCell(
            quantity=cell.quantity,
            level_low_fl=cell.low_fl,
            level_high_fl=cell.high_fl,
            regime=cell.regime,
            distance=distance,
            floor=floor,
            unit=QUANTITIES[cell.quantity].unit,
            difference=float(compared.difference(y)[cell.at].nanmean().nan_to_num(0.0)),
            p_value=p_value,
            share=float(excess[cell.at].sum()) if counts else 0.0,
        )
        rows.append(row)
    total = sum(row.share for row in rows) or 1.0
    return sorted((replace(row, share=row.share / total) for row in rows), key=lambda row: (-row.share, row.p_value))
