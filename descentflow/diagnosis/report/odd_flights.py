"""Flights worth a look: those that show most of what no named cause explains."""

from torch import Tensor

from descentflow.diagnosis.findings.costs_found import LevelMeans
from descentflow.diagnosis.findings.inputs_found import FlightWorthALook
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.report.trade_units import in_trade

MOST = 10
"""Flights that are named."""
NEIGHBOURS = 0.5
"""Bands beside the one with the largest difference belong to it while theirs, of the same sign, is so large a share."""


def flights_worth_a_look(compared: Compared, left: Tensor, profile: list[LevelMeans]) -> list[FlightWorthALook]:
    """Real flights that are furthest from the simulator's mean where most is left, in the direction of what is left.

    Args:
        compared: Flights of both sides.
        left: (n, p) the same once the causes are in the simulator, or off the flights.
        profile: What the simulator flies on average by level, for units of the trade.

    Returns:
        At most :data:`MOST`; none where the flights' identifiers are not known or no quantity by level is compared.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> sides = replace(sides, names=tuple(f"flight-{i}" for i in range(80)))
        >>> found = flights_worth_a_look(sides, sides.y, [])
        >>> len(found), found[0].quantity, found[0].unit
        (10, 'tas', '%')
    """
    real = left[compared.real]
    normal = left[~compared.real].nanmean(0).nan_to_num(0.0) if compared.has_reference else 0.0 * left[0]
    rest = real - normal
    mean = rest.nanmean(0).nan_to_num(0.0)
    at = _largest(compared, mean)
    if not compared.names or not at:
        return []
    inside = rest[:, at].nanmean(1)
    towards = float(mean[at].sum())
    entries = [compared.entries[i] for i in at]
    low = min(compared.level_range(entry)[0] for entry in entries)
    high = max(compared.level_range(entry)[1] for entry in entries)
    order = (inside * towards).nan_to_num(-1e30).argsort(descending=True).tolist()
    found = []
    for i in [i for i in order if bool(inside[i].isfinite())][:MOST]:
        excess, unit = in_trade(entries[0].quantity, float(inside[i]), low, high, profile)
        found.append(FlightWorthALook(compared.names[i], excess, unit, entries[0].quantity, low, high))
    return found


def _largest(compared: Compared, mean: Tensor) -> list[int]:
    """Entries of the quantity by level in which most is left, in neighbouring bands."""
    banded = [i for i, entry in enumerate(compared.entries) if entry.band >= 0]
    if not banded:
        return []
    standing = (mean / compared.negligible()).nan_to_num(0.0)
    most = max(banded, key=lambda i: abs(float(standing[i])))
    quantity = {e.band: i for i, e in enumerate(compared.entries) if e.quantity == compared.entries[most].quantity}
    found = [most]
    for step in (-1, 1):
        band = compared.entries[most].band + step
        while band in quantity and float(standing[quantity[band]] / standing[most]) >= NEIGHBOURS:
            found.append(quantity[band])
            band += step
    return sorted(found)
