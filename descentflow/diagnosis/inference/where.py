"""Where the gap lies: cells of quantity, altitude and slice, each against permuted flights."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.diagnosis.correction.closure import distances
from descentflow.diagnosis.inference.likelihood import Contest
from descentflow.diagnosis.inference.permutation import sides
from descentflow.diagnosis.inference.two_sides import Compared

BANDS_IN_CELL = 3
PERMUTATIONS = 199
FLOORS = 10
UNITS = {
    "rate": "relative",
    "lag": "relative",
    "cas": "kt",
    "mismatch": "kt",
    "tas": "relative",
    "wind": "m/s",
    "height": "m",
    "level": "s",
    "level_gaps": "1",
    "slow": "s",
    "missing": "1",
}
DISCOVERY = 0.05
MATTERS = 0.5
"""An excess over the floor below this many negligible shifts is not counted as a gap, however significant."""


@dataclass(frozen=True)
class Cell:
    """Entries (k,) of one quantity in neighbouring bands on one side of the transition."""

    quantity: str
    at: Tensor
    low_fl: float
    high_fl: float
    regime: str


def cells(compared: Compared, transition_fl: float) -> list[Cell]:
    """Cut the entries into cells."""
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


def where(contest: Contest, transition_fl: float, seed: int) -> tuple[list[dict[str, Any]], Tensor]:
    """Distances, floors and q-values of every cell, largest share first; and the entries (p,) that differ.

    Flights change sides by whole aircraft; the statistic of a cell is its standardised difference of means and of
    spreads. Slices: all flights, and the slower and faster half (by the aircraft's mean CAS) for the rate.
    """
    compared = contest.compared
    labels = sides(contest, PERMUTATIONS, seed)
    every = torch.ones(len(compared.y), dtype=torch.bool)
    cas = compared.state.cas_mps.mean(1)
    slow = cas <= cas.median()
    known = cells(compared, transition_fl)
    rows: list[dict[str, Any]] = []
    p_values: list[float] = []
    weights: list[float] = []
    for name, part in (("all", every), ("slower half", slow), ("faster half", ~slow)):
        chosen = known if name == "all" else [c for c in known if c.quantity == "rate"]
        statistic = _statistics(compared.y[part], labels[:, part], contest.has_reference)
        apart = distances(compared.y[part], contest.real[part], compared.scale, compared.counts())
        mixed = torch.stack([_mixed(contest, part, labels[1 + k]) for k in range(FLOORS)]).mean(0)
        for cell in chosen:
            total = statistic[:, cell.at].nan_to_num(0.0).sum(1)
            p_values.append(float((total >= total[0] - 1e-12).double().mean()))
            excess = (apart - mixed)[cell.at].clamp(min=0.0)
            weights.append(float(excess.sum()) if name == "all" else 0.0)
            scale = compared.scale[cell.at]
            unit = "ln" if cell.quantity.startswith("noise") else UNITS[cell.quantity]
            rows.append(
                {
                    "quantity": cell.quantity,
                    "level_low_fl": cell.low_fl,
                    "level_high_fl": cell.high_fl,
                    "regime": cell.regime,
                    "slice": name,
                    "distance": float((apart[cell.at] * scale).mean()),
                    "floor": float((mixed[cell.at] * scale).mean()),
                    "unit": unit,
                    "difference": _difference(compared, part, cell),
                }
            )
    q_values = benjamini_hochberg(p_values)
    affected = torch.zeros(len(compared.entries), dtype=torch.bool)
    for row, q in zip(rows, q_values, strict=True):
        row["q_value"] = q
    negligible = compared.negligible()
    for cell, row in zip(known, rows, strict=False):
        if row["q_value"] <= DISCOVERY and row["distance"] - row["floor"] > MATTERS * float(negligible[cell.at].mean()):
            affected[cell.at] = True
    counted = [bool(affected[c.at].all()) for c in known] + [False] * (len(rows) - len(known))
    total_weight = sum(w for w, c in zip(weights, counted, strict=True) if c)
    for row, is_counted, weight in zip(rows, counted, weights, strict=True):
        row["share"] = weight / total_weight if total_weight > 0 and is_counted else 0.0
    return sorted(rows, key=lambda r: (-r["share"], r["q_value"])), affected


def _difference(compared: Compared, part: Tensor, cell: Cell) -> float:
    """Mean of the real flights less that of the simulator's (zero where physics claims so)."""
    real = compared.y[part & compared.real][:, cell.at].nanmean(0)
    if bool((part & ~compared.real).any()):
        real = real - compared.y[part & ~compared.real][:, cell.at].nanmean(0).nan_to_num(0.0)
    return float(real.nanmean().nan_to_num(0.0))


def _mixed(contest: Contest, part: Tensor, label: Tensor) -> Tensor:
    y, scale = contest.compared.y[part], contest.compared.scale
    if not contest.has_reference:
        return distances(
            (y - y.nanmean(0)) * label[part][:, None],
            torch.ones(len(y), dtype=torch.bool),
            scale,
            contest.compared.counts(),
        )
    chosen = label[part] > 0.5
    if not bool(chosen.any()) or bool(chosen.all()):
        return torch.zeros_like(scale)
    return distances(y, chosen, scale, contest.compared.counts())


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


def benjamini_hochberg(p_values: list[float]) -> list[float]:
    """Smallest false-discovery rate at which each would be called (Benjamini and Hochberg 1995).

    Example:
        >>> benjamini_hochberg([0.01, 0.5, 0.02])
        [0.03, 0.5, 0.03]
    """
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    found, smallest = [1.0] * len(p_values), 1.0
    for rank, i in reversed(list(enumerate(order, start=1))):
        smallest = min(smallest, p_values[i] * len(p_values) / rank)
        found[i] = smallest
    return found


def strongest_block(contest: Contest, residual: Tensor) -> dict[str, Any] | None:
    """The contiguous block of bands whose mean rate differs most, by a scan over all blocks.

    Args:
        contest: Flights.
        residual: (n, p) what is left of each flight.
    """
    compared = contest.compared
    at = compared.columns("rate")
    if not len(at):
        return None
    y, real = residual[:, at], contest.real
    mean = y[real].nanmean(0)
    if contest.has_reference:
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
    return {"quantity": "rate", "level_low_fl": low, "level_high_fl": high, "difference": float(mean[i : j + 1].mean())}


def middles_fl(compared: Compared) -> list[float]:
    """Flight levels in the middle of each band."""
    return [float(x) / FL_M for x in compared.state.altitude_m]
