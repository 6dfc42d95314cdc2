"""A shift of no particular cause: smooth in altitude, in any quantity, and for the rate in speed and depth too.

It knows nothing of the catalogue. Where it explains much more than the best effects do, the cause is not among them.
"""

from dataclasses import dataclass

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
SPREADS = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Prior spreads of which the most probable is taken, in :data:`SPREAD`: from nothing to 6 % of the rate at a knot."""
SWEEPS = 2
"""Over the quantities: how wide one is hardly moves what another is."""
TOP_M = 1200.0
"""Depth below the top over which an aircraft settles into its descent."""


@dataclass(frozen=True, eq=False)
class DiscrepancyColumns:
    """Columns of a shift without a cause, of unit prior spread: d that differ between flights, then those alike in all.

    Attributes:
        names: (e,) of the columns.
        differing: (n, p, d).
        alike: (p, e - d), once for all flights: of 4,000, those of every flight would be 130 MB.

    Example:
        >>> DiscrepancyColumns(("rate by Mach", "rate 0"), torch.ones(5, 3, 1), torch.zeros(3, 1)).columns().shape
        torch.Size([5, 3, 2])
    """

    names: tuple[str, ...]
    differing: Tensor
    alike: Tensor

    def __len__(self) -> int:
        """Columns."""
        return len(self.names)

    def columns(self) -> Tensor:
        """All of them (n, p, e)."""
        return torch.cat([self.differing, self.alike.expand(len(self.differing), -1, -1)], 2)


def discrepancy_columns(compared: Compared) -> DiscrepancyColumns:
    """The columns of some flights.

    Args:
        compared: Flights of both sides.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> columns = discrepancy_columns(sides)
        >>> len(columns), columns.names[0], columns.names[3]
        (17, 'rate by Mach', 'rate 0')
    """
    p = compared.y.shape[1]
    negligible = compared.negligible()
    alike: dict[str, Tensor] = {}
    differing: dict[str, Tensor] = {}
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        size = SPREAD * negligible[at]
        if quantity not in BY_BAND:
            alike[quantity] = _placed(size, at, p)
            continue
        bands = torch.tensor([compared.entries[i].band for i in at.tolist()])
        altitude = compared.state.altitude_m[bands]
        for k, bump in enumerate(_bumps(altitude, KNOTS.get(quantity, OTHER_KNOTS))):
            alike[f"{quantity} {k}"] = _placed(size * bump, at, p)
        for name, weight in _covariates(compared).items() if quantity == "rate" else ():
            differing[f"rate by {name}"] = _placed(size * weight[:, bands], at, p)
    none = compared.y.new_zeros(*compared.y.shape, 0)
    parts = torch.cat([none, *(column[:, :, None] for column in differing.values())], 2)
    return DiscrepancyColumns((*differing, *alike), parts, torch.stack(list(alike.values()), 1))


def _placed(values: Tensor, at: Tensor, p: int) -> Tensor:
    """Values (..., k) at their entries: (..., p)."""
    column = torch.zeros(*values.shape[:-1], p, dtype=torch.float64)
    column[..., at] = values
    return column


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


def learnt_precision(information: Tensor, gradient: Tensor, of: Tensor) -> tuple[Tensor, float]:
    r"""Prior precision (e,) of coefficients under which the flights are most probable, one for each quantity.

    Beside it, what the freedom costs (nats): the second term below, by which a shape that could have been any is less
    probable than one that an effect foretells.

    With information A and gradient g of the coefficients, all else profiled out, and a normal prior of precision
    diagonal R, :math:`\ln p(y) = \tfrac12 g^\top (A + R)^{-1} g - \tfrac12 \ln \det (I + R^{-1} A)` up to a constant.
    A quantity that shows nothing gets a prior that leaves it alone.

    Args:
        information: (e, e).
        gradient: (e,).
        of: (e,) number of the quantity that each column shifts.

    Example:
        >>> information = 100.0 * torch.eye(4).double()
        >>> gradient, of = torch.tensor([90.0, -80.0, 5.0, 9.0]).double(), torch.tensor([0, 0, 1, 1])
        >>> precision, cost = learnt_precision(information, gradient, of)
        >>> precision.round().tolist(), round(cost, 1)  # ln(101) of the first two, ln(1.09) of the others, halved
        ([1.0, 1.0, 1111.0, 1111.0], 4.7)
    """
    spread = torch.full((len(gradient),), SPREADS[0], dtype=gradient.dtype)
    for _ in range(SWEEPS):
        for quantity in torch.unique(of).tolist():
            tried = torch.stack([torch.where(of == quantity, value, spread) for value in SPREADS])
            spread = tried[_evidence(information, gradient, tried).argmax()]
    return spread**-2, _volume(information, spread)


def _volume(information: Tensor, spread: Tensor) -> float:
    scaled = spread[:, None] * information * spread + torch.eye(len(spread), dtype=spread.dtype)
    return float(torch.linalg.cholesky(scaled).diagonal().log().sum())


def _evidence(information: Tensor, gradient: Tensor, spreads: Tensor) -> Tensor:
    """Of each row (t,) of spreads (t, e)."""
    scaled = spreads[:, :, None] * information * spreads[:, None] + torch.eye(len(information), dtype=spreads.dtype)
    lower = torch.linalg.cholesky(scaled)
    half = torch.linalg.solve_triangular(lower, (spreads * gradient)[:, :, None], upper=False)
    found: Tensor = 0.5 * half.square().sum((1, 2)) - lower.diagonal(dim1=1, dim2=2).log().sum(1)
    return found


def quantity_of(columns: DiscrepancyColumns, compared: Compared) -> Tensor:
    """Number (e,) of the quantity that each column shifts.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> quantity_of(discrepancy_columns(sides), sides).tolist()  # rate, cas, tas
        [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2]
    """
    names = compared.quantities()
    number = torch.tensor([names.index(entry.quantity) for entry in compared.entries])
    largest = torch.cat([columns.differing.abs().amax(0), columns.alike.abs()], 1)
    return number[largest.argmax(0)]
