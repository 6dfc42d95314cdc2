"""A shift of no particular cause: smooth in altitude, in any quantity, and for the rate in speed and depth too.

It knows nothing of the catalogue. Where it explains much more than the best effects do, the cause is not among them.
"""

import torch
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import BY_BAND

KNOTS = {"rate": 7, "cas": 4}
"""Bumps over altitude of the quantities that have many bands of detail..."""
OTHER_KNOTS = 3
"""...and of the others. Set by hand."""
SPREAD = 10.0
"""Prior spread of a bump, in negligible shifts of its quantity."""
TOP_M = 1200.0
"""Depth below the top over which an aircraft settles into its descent."""


def discrepancy_columns(compared: Compared) -> tuple[Tensor, tuple[str, ...]]:
    """Columns (n, p, e) with unit prior spread, and a name for each.

    Args:
        compared: Flights of both sides.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> columns, names = discrepancy_columns(sides)
        >>> columns.shape[2] == len(names), names[0]
        (True, 'rate 0')
    """
    n, p = compared.y.shape
    negligible = compared.negligible()
    columns, names = [], []
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        size = SPREAD * negligible[at]
        if quantity not in BY_BAND:
            column = torch.zeros(n, p, dtype=torch.float64)
            column[:, at] = size
            columns.append(column)
            names.append(quantity)
            continue
        bands = torch.tensor([compared.entries[i].band for i in at.tolist()])
        altitude = compared.state.altitude_m[bands]
        for k, bump in enumerate(_bumps(altitude, KNOTS.get(quantity, OTHER_KNOTS))):
            column = torch.zeros(n, p, dtype=torch.float64)
            column[:, at] = size * bump
            columns.append(column)
            names.append(f"{quantity} {k}")
        if quantity == "rate":
            for name, weight in _covariates(compared).items():
                column = torch.zeros(n, p, dtype=torch.float64)
                column[:, at] = size * weight[:, bands]
                columns.append(column)
                names.append(f"rate by {name}")
    return torch.stack(columns, 2), tuple(names)


def _bumps(altitude_m: Tensor, count: int) -> Tensor:
    """Hat functions (count, k) that add up to one."""
    if len(altitude_m) < 2:
        return torch.ones(1, len(altitude_m), dtype=torch.float64)
    count = min(count, len(altitude_m))
    knots = torch.linspace(float(altitude_m[0]), float(altitude_m[-1]), count, dtype=torch.float64)
    width = float(knots[1] - knots[0]) if count > 1 else 1e9
    return (1 - (altitude_m - knots[:, None]).abs() / width).clamp(min=0.0)


def _covariates(compared: Compared) -> dict[str, Tensor]:
    """What a missing cause may depend on besides altitude, (n, K) of order one."""
    state = compared.state
    mach = state.mach()
    usual = (mach * state.mask).sum(0) / state.mask.sum(0).clamp(min=1)
    return {
        "Mach": ((mach - usual) / 0.02).clamp(-2.0, 2.0),
        "high Mach": ((mach - 0.76) / 0.02).clamp(0.0, 2.0),
        "depth below the top": torch.exp(-state.depth_m / TOP_M),
    }
