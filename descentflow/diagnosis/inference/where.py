"""Place of the gap: cells of quantity, altitude and slice, each against permuted flights."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.diagnosis.findings.gap_found import GapCell
from descentflow.diagnosis.inference.cells import Cell, cell_scores, cells
from descentflow.diagnosis.inference.gap_distances import distances, noise_floor
from descentflow.diagnosis.inference.labellings import Labellings, labellings_of
from descentflow.diagnosis.inference.step_down import step_down
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import QUANTITIES

PERMUTATIONS = 1999
"""Behind the p-value of each cell, which is at least one in 2,000: 5 % is known to half a percent."""
FLOORS = 10
"""Permutations behind the noise floor of each cell."""
FALSE_CELLS = 0.05
"""Chance that any cell is called where there is no gap."""
MATTERS = 0.5
"""An excess over the floor below this many negligible shifts is not counted as a gap, however significant."""


ALL = "all"
"""Name of the slice that is all flights."""


@dataclass(frozen=True)
class Slice:
    """Some of the flights, by name, and the cells that are looked at in them; ``y`` (n, p) is NaN for the others.

    Example:
        >>> Slice("slower half", torch.zeros(4, 2), torch.tensor([True, True, False, False]), []).name
        'slower half'
    """

    name: str
    y: Tensor
    flights: Tensor
    cells: list[Cell]


def where(compared: Compared, transition_fl: float, seed: int) -> tuple[list[GapCell], Tensor]:
    """Distances, noise floors and corrected p-values of every cell, largest share first; and entries (p,) that differ.

    Labels are permuted by whole aircraft. Slices: all flights, and the slower and faster half (by the flight's mean
    CAS) for the rate.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> found, affected = where(example_sides(EFFECTS["temperature"], [10.0]), transition_fl=290.0, seed=0)
        >>> found[0].quantity, bool(affected.any())
        ('tas', True)
    """
    dealt = labellings_of(compared, PERMUTATIONS, seed)
    slices = _slices(compared, transition_fl)
    p_values = step_down(torch.cat([cell_scores(part.y, dealt, part.cells) for part in slices], 1)).tolist()
    measured = [row for part in slices for row in _measured(compared, part, dealt)]
    negligible = compared.negligible()
    affected = torch.zeros(len(compared.entries), dtype=torch.bool)
    # The slices of the rate show more of the same: cells of all flights alone say what differs.
    counted = []
    for (row, cell, _), p_value in zip(measured, p_values, strict=True):
        large = row.distance - row.floor > MATTERS * float(negligible[cell.at].mean())
        counted.append(row.slice == ALL and p_value <= FALSE_CELLS and large)
        if counted[-1]:
            affected[cell.at] = True
    total = sum(excess for (_, _, excess), counts in zip(measured, counted, strict=True) if counts)
    rows = [
        replace(row, p_value=p_value, share=excess / total if counts else 0.0)
        for (row, _, excess), p_value, counts in zip(measured, p_values, counted, strict=True)
    ]
    return sorted(rows, key=lambda row: (-row.share, row.p_value)), affected


def _slices(compared: Compared, transition_fl: float) -> list[Slice]:
    """All flights with all cells, and the slower and faster half with those of the rate."""
    cas = compared.state.cas_mps.mean(1)
    slow = cas <= cas.median()
    known = cells(compared, transition_fl)
    of_rate = [cell for cell in known if cell.quantity == "rate"]
    found = [Slice(ALL, compared.y, torch.ones_like(slow), known)]
    for name, part in (("slower half", slow), ("faster half", ~slow)) if of_rate else ():
        found.append(Slice(name, torch.where(part[:, None], compared.y, torch.nan), part, of_rate))
    return found


def _measured(compared: Compared, part: Slice, dealt: Labellings) -> list[tuple[GapCell, Cell, float]]:
    """Each cell of a slice, still without a p-value, and its excess over the floor in spreads."""
    some = [dealt.flights(1 + k)[part.flights] for k in range(min(FLOORS, len(dealt) - 1))]
    y, real = compared.y[part.flights], compared.real[part.flights]
    apart = distances(y, real, compared.scale, compared.counts())
    mixed = noise_floor(y, real, some, compared.scale, compared.counts())
    found = []
    for cell in part.cells:
        scale = compared.scale[cell.at]
        row = GapCell(
            quantity=cell.quantity,
            level_low_fl=cell.low_fl,
            level_high_fl=cell.high_fl,
            regime=cell.regime,
            slice=part.name,
            distance=float((apart[cell.at] * scale).mean()),
            floor=float((mixed[cell.at] * scale).mean()),
            unit=QUANTITIES[cell.quantity].unit,
            difference=_difference(y[:, cell.at], real),
            p_value=1.0,
            share=0.0,
        )
        found.append((row, cell, float((apart - mixed)[cell.at].clamp(min=0.0).sum())))
    return found


def _difference(y: Tensor, real: Tensor) -> float:
    """Mean of the real flights minus that of the simulator's (zero where physics claims so)."""
    mean = y[real].nanmean(0)
    if not bool(real.all()):
        mean = mean - y[~real].nanmean(0).nan_to_num(0.0)
    return float(mean.nanmean().nan_to_num(0.0))
