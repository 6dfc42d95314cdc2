"""Where the gap lies: cells of quantity, altitude and slice, each against permuted flights."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.diagnosis.findings.gap_found import Block, GapCell
from descentflow.diagnosis.inference.false_discovery import benjamini_hochberg
from descentflow.diagnosis.inference.gap_distances import distances
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.permutation import permuted_labels
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import QUANTITIES

BANDS_IN_CELL = 3
"""Neighbouring bands of a cell, some 4,500 ft: fewer would be tests of little power, more would hide where it is."""
PERMUTATIONS = 199
"""Behind the p-value of each cell, which is at least one in 200."""
FLOORS = 10
"""Permutations behind the noise floor of each cell."""
DISCOVERY = 0.05
"""False-discovery rate at which a cell is called (Benjamini and Hochberg 1995)."""
MATTERS = 0.5
"""An excess over the floor below this many negligible shifts is not counted as a gap, however significant."""


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


def cells(compared: Compared, transition_fl: float) -> list[Cell]:
    """Cut the entries into cells.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> [(c.low_fl, c.high_fl, c.regime) for c in cells(sides, transition_fl=290.0) if c.quantity == "tas"][:2]
        [(150.0, 210.0, 'below'), (210.0, 270.0, 'below')]
    """
    found: list[Cell] = []
    for quantity in compared.quantities():
        run: list[int] = []
        for i in [*compared.columns(quantity).tolist(), -1]:
            if run and (
                i < 0
                or len(run) == BANDS_IN_CELL
                or _regime(compared, i, transition_fl) != _regime(compared, run[0], transition_fl)
            ):
                low, high = (
                    compared.level_range(compared.entries[run[0]])[0],
                    compared.level_range(compared.entries[run[-1]])[1],
                )
                found.append(Cell(quantity, torch.tensor(run), low, high, _regime(compared, run[0], transition_fl)))
                run = []
            run.append(i)
    return found


def _regime(compared: Compared, i: int, transition_fl: float) -> str:
    if compared.entries[i].band < 0:
        return "all"
    low, high = compared.level_range(compared.entries[i])
    return "above" if (low + high) / 2 > transition_fl else "below"


def where(likelihood: EffectsLikelihood, transition_fl: float, seed: int) -> tuple[list[GapCell], Tensor]:
    """Distances, noise floors and q-values of every cell, largest share first; and the entries (p,) that differ.

    Labels are permuted by whole aircraft; the statistic of a cell is its standardised difference of means and of
    spreads. Slices: all flights, and the slower and faster half (by the aircraft's mean CAS) for the rate.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> found, affected = where(likelihood, transition_fl=290.0, seed=0)
        >>> found[0].quantity, bool(affected.any())
        ('tas', True)
    """
    compared = likelihood.compared
    labels = permuted_labels(likelihood, PERMUTATIONS, seed)
    every = torch.ones(len(compared.y), dtype=torch.bool)
    cas = compared.state.cas_mps.mean(1)
    slow = cas <= cas.median()
    known = cells(compared, transition_fl)
    of_rate = [cell for cell in known if cell.quantity == "rate"]
    parts = (("all", every, known), ("slower half", slow, of_rate), ("faster half", ~slow, of_rate))
    measured = [one for name, part, chosen in parts for one in _measured(likelihood, labels, name, part, chosen)]
    q_values = benjamini_hochberg([p_value for _, p_value, _ in measured])
    affected = torch.zeros(len(compared.entries), dtype=torch.bool)
    negligible = compared.negligible()
    for cell, (row, _, _), q in zip(known, measured, q_values, strict=False):
        if q <= DISCOVERY and row.distance - row.floor > MATTERS * float(negligible[cell.at].mean()):
            affected[cell.at] = True
    counted = [bool(affected[cell.at].all()) for cell in known] + [False] * (len(measured) - len(known))
    total = sum(excess for (_, _, excess), counts in zip(measured, counted, strict=True) if counts)
    rows = [
        replace(row, q_value=q, share=excess / total if total > 0 and counts else 0.0)
        for (row, _, excess), q, counts in zip(measured, q_values, counted, strict=True)
    ]
    return sorted(rows, key=lambda row: (-row.share, row.q_value)), affected


def _measured(
    likelihood: EffectsLikelihood, labels: Tensor, name: str, part: Tensor, chosen: list[Cell]
) -> Iterator[tuple[GapCell, float, float]]:
    """Each cell of a slice (n,) of the flights, its p-value, and its excess over the floor in spreads."""
    compared = likelihood.compared
    statistic = _statistics(compared.y[part], labels[:, part], likelihood.has_reference)
    apart = distances(compared.y[part], likelihood.real[part], compared.scale, compared.counts())
    mixed = torch.stack([_mixed(likelihood, part, labels[1 + k]) for k in range(FLOORS)]).mean(0)
    for cell in chosen:
        total = statistic[:, cell.at].nan_to_num(0.0).sum(1)
        p_value = float((total >= total[0] - 1e-12).double().mean())
        excess = (apart - mixed)[cell.at].clamp(min=0.0)
        scale = compared.scale[cell.at]
        row = GapCell(
            quantity=cell.quantity,
            level_low_fl=cell.low_fl,
            level_high_fl=cell.high_fl,
            regime=cell.regime,
            slice=name,
            distance=float((apart[cell.at] * scale).mean()),
            floor=float((mixed[cell.at] * scale).mean()),
            unit=QUANTITIES[cell.quantity].unit,
            difference=_difference(compared, part, cell),
            q_value=1.0,
            share=0.0,
        )
        yield row, p_value, float(excess.sum())


def _difference(compared: Compared, part: Tensor, cell: Cell) -> float:
    """Mean of the real flights minus that of the simulator's (zero where physics claims so)."""
    real = compared.y[part & compared.real][:, cell.at].nanmean(0)
    if bool((part & ~compared.real).any()):
        real = real - compared.y[part & ~compared.real][:, cell.at].nanmean(0).nan_to_num(0.0)
    return float(real.nanmean().nan_to_num(0.0))


def _mixed(likelihood: EffectsLikelihood, part: Tensor, label: Tensor) -> Tensor:
    y, scale = likelihood.compared.y[part], likelihood.compared.scale
    if not likelihood.has_reference:
        return distances(
            (y - y.nanmean(0)) * label[part][:, None],
            torch.ones(len(y), dtype=torch.bool),
            scale,
            likelihood.compared.counts(),
        )
    chosen = label[part] > 0.5
    if not bool(chosen.any()) or bool(chosen.all()):
        return torch.zeros_like(scale)
    return distances(y, chosen, scale, likelihood.compared.counts())


def _statistics(y: Tensor, labels: Tensor, two_sided: bool) -> Tensor:
    """Squared standardised differences (b, p) of means, and of spreads, for every labelling."""
    seen = y.isfinite().double()
    centred = torch.where(seen > 0, y - y.nanmean(0), 0.0) if two_sided else y.nan_to_num(0.0)
    spread = centred.square().sum(0) / seen.sum(0).clamp(min=1)
    if not two_sided:
        mean = labels @ centred / seen.sum(0).clamp(min=1)
        return mean**2 / spread.clamp(min=1e-18) * seen.sum(0)
    squares = torch.where(seen > 0, centred**2 / spread.clamp(min=1e-18) - 1, 0.0)
    mine, theirs = labels @ seen, (1 - labels) @ seen
    enough = (mine > 2) & (theirs > 2)
    size = torch.where(enough, 1 / mine.clamp(min=1) + 1 / theirs.clamp(min=1), torch.inf)
    found = torch.zeros_like(mine)
    for values, variance in ((centred, spread), (squares, squares.square().sum(0) / seen.sum(0).clamp(min=1))):
        difference = labels @ values / mine.clamp(min=1) - (1 - labels) @ values / theirs.clamp(min=1)
        found = found + difference**2 / size / variance.clamp(min=1e-18)
    return found


def strongest_block(likelihood: EffectsLikelihood, residual: Tensor) -> Block | None:
    """The contiguous block of bands whose mean rate differs most, by a scan over all blocks.

    Args:
        likelihood: Flights.
        residual: (n, p) what is left of each flight.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> strongest_block(likelihood, likelihood.compared.y).quantity
        'rate'
    """
    compared = likelihood.compared
    at = compared.columns("rate")
    if not len(at):
        return None
    y, real = residual[:, at], likelihood.real
    mean = y[real].nanmean(0)
    if likelihood.has_reference:
        mean = mean - y[~real].nanmean(0)
    middle = mean - mean.nanmedian()
    best: tuple[float, int, int] = (0.0, 0, 0)
    for i in range(len(at)):
        for j in range(i, min(i + len(at) // 2, len(at))):
            value = float(middle[i : j + 1].sum().abs()) / (j - i + 1) ** 0.5
            best = max(best, (value, i, j))
    _, i, j = best
    low = compared.level_range(compared.entries[int(at[i])])[0]
    high = compared.level_range(compared.entries[int(at[j])])[1]
    return Block("rate", low, high, float(mean[i : j + 1].mean()))
