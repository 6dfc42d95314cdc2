"""Gap that is left with the causes in the simulator: by level, in which flights, and data that would decide more."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from descentflow.diagnosis.findings.aviation_units import aviation_value
from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.costs_found import LevelMeans
from descentflow.diagnosis.findings.findings import Curve
from descentflow.diagnosis.findings.gap_found import LargestDifference, Remaining, WouldSplit
from descentflow.diagnosis.findings.inputs_found import FlightWorthALook, LeftOutChannel
from descentflow.diagnosis.inference.moments import moments
from descentflow.diagnosis.inference.naming import free_in_every_set
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.measured_sides import OWN_FLIGHTS
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Vectors
from descentflow.effects import UNKNOWN, Effect
from descentflow.measurements.quantity_registry import SHOWN_BY

MOST_FLIGHTS = 10
"""Flights that are named."""
CERTAIN_ERRORS = 3.0
"""Standard errors from which a difference of means is more than chance, of all that are looked at."""
NEIGHBOURS = 0.5
"""Neighbours of the band with the largest difference belong to it while theirs is so large a share of it."""


def standard_errors(compared: Compared) -> Tensor:
    """Standard error (p,) of each difference of means, by whole aircraft and days: their flights are alike."""
    return torch.from_numpy(moments(compared).covariance.diagonal() ** 0.5)


def remaining_of(compared: Vectors, left: Tensor, error: Tensor, gap: float, share_unexplained: float) -> Remaining:
    """Gap that is left once the causes are in the simulator, and its largest part.

    Args:
        compared: Flights of both sides.
        left: (n, p) the same once the causes are in the simulator, or off the flights.
        error: (p,) standard error of each difference.
        gap: Left above the noise floor, in spreads.
        share_unexplained: Of what effects and a free discrepancy explain together.
    """
    mean = compared.difference(left)
    standing = (mean.abs() / compared.negligible()).nan_to_num(0.0)
    # What the simulator lacks besides any cause is no part of the difference that is explained.
    standing = torch.where(free_in_every_set(compared), 0.0, standing)
    # The largest of those that are more than chance, where any is.
    certain = torch.where(mean.abs() > CERTAIN_ERRORS * error, standing, 0.0)
    most = int((certain if bool(certain.any()) else standing).argmax())
    entry = compared.entries[most]
    low, high = compared.level_range(entry)
    largest = LargestDifference(entry.quantity, low, high, float(mean[most]), float(standing[most]))
    return Remaining(max(gap, 0.0), share_unexplained, largest)


def curves(compared: Vectors, left: Tensor, error: Tensor) -> dict[str, Curve]:
    """Mean difference by band with its error (p,), before and after, for the figures.

    Args:
        compared: Flights of both sides.
        left: (n, p) the same once the causes are in the simulator, or off the flights.
        error: (p,) standard error of each difference.
    """
    levels, by_quantity = compared.middles_fl(), {}
    before, after = compared.difference(compared.y), compared.difference(left)
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        bands = [compared.entries[i].band for i in at.tolist()]
        middles = [levels[b] if b >= 0 else None for b in bands]
        by_quantity[quantity] = Curve(middles, before[at].tolist(), after[at].tolist(), error[at].tolist())
    return by_quantity


def flights_worth_a_look(compared: Vectors, left: Tensor, profile: list[LevelMeans]) -> list[FlightWorthALook]:
    """Real flights that are furthest from the simulator's mean where most is left, in the direction of what is left.

    Args:
        compared: Flights of both sides.
        left: (n, p) the same once the causes are in the simulator, or off the flights.
        profile: What the simulator flies on average by level, for aviation units.

    Returns:
        At most :data:`MOST_FLIGHTS`; none where flights have no identifiers or no quantity by level is compared.
    """
    real = left[compared.real]
    normal = left[~compared.real].nanmean(0).nan_to_num(0.0) if compared.has_simulated else 0.0 * left[0]
    rest = real - normal
    mean = rest.nanmean(0).nan_to_num(0.0)
    at = _largest(compared, mean)
    if not compared.names or not at:
        return []
    inside = rest[:, at].nanmean(1)
    towards = float(mean[at].sum())
    quantity, levels = compared.entries[at[0]].quantity, compared.only(torch.tensor(at)).levels()
    showing = [i for i, seen in enumerate(inside.isfinite().tolist()) if seen]
    furthest = []
    for i in sorted(showing, key=lambda i: -float(inside[i]) * towards)[:MOST_FLIGHTS]:
        excess, unit = aviation_value(quantity, float(inside[i]), *levels, profile)
        furthest.append(FlightWorthALook(compared.names[i], excess, unit, quantity, *levels))
    return furthest


def _largest(compared: Vectors, mean: Tensor) -> list[int]:
    """Entries of the quantity by level in which most is left, in neighbouring bands."""
    banded = [i for i, entry in enumerate(compared.entries) if entry.band >= 0]
    if not banded:
        return []
    standing = (mean / compared.negligible()).nan_to_num(0.0)
    most = max(banded, key=lambda i: abs(float(standing[i])))
    quantity = {e.band: i for i, e in enumerate(compared.entries) if e.quantity == compared.entries[most].quantity}
    entries = [most]
    for step in (-1, 1):
        band = compared.entries[most].band + step
        while band in quantity and float(standing[quantity[band]] / standing[most]) >= NEIGHBOURS:
            entries.append(quantity[band])
            band += step
    return sorted(entries)


def would_split(compared: Vectors, catalogue: Mapping[str, Effect], causes: Sequence[Cause]) -> list[WouldSplit]:
    """Channels that are not there and would separate a cause from its group, or help an unknown one to a name.

    Args:
        compared: Flights of both sides.
        catalogue: Effects by name.
        causes: That were named.
    """
    there = set(compared.quantities())
    splits = []
    for cause in causes:
        names = [cause.effect, *cause.group]
        able = list(dict.fromkeys(channel for name in names for channel in catalogue[name].splits))
        missing = [channel for channel in able if channel in SHOWN_BY and SHOWN_BY[channel] not in there]
        if len(names) > 1 and missing:
            splits.append(WouldSplit(names, missing, "they look alike in the channels given"))
        groups = dict.fromkeys(catalogue[name].scale_group for name in names)
        splits += [WouldSplit(list(group.members), [], group.why) for group in groups if group]
    if not causes:
        why = "it is not among the channels"
        splits += [WouldSplit([UNKNOWN], [c], why) for c, quantity in SHOWN_BY.items() if quantity not in there]
    return splits


def not_identifiable(settings: Settings, source: str) -> list[WouldSplit]:
    """Effects that a simulator's flights hide, by their origin.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.sides.simulator import Simulator
        >>> from descentflow.effects import EFFECTS
        >>> asked = Settings(Simulator(aircraft("A320")), EFFECTS, [], 0, str)
        >>> "mass" in not_identifiable(asked, "training flights")[0].between, not_identifiable(asked, "simulator")
        (True, [])
    """
    if source != OWN_FLIGHTS:
        return []
    names = [name for name, effect in settings.catalogue.items() if effect.inherited_from is None]
    why = "not identifiable where the simulator's own flights have them as well"
    return [WouldSplit(names, [], why)]


def left_out_channels(lacked: Mapping[str, str], catalogue: Mapping[str, Effect]) -> list[LeftOutChannel]:
    """Channels left out on both sides because one lacks them.

    Args:
        lacked: Channel -> the side that lacks it.
        catalogue: Effects that may be named: each names the channels it needs, and which tell it from others.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> left_out_channels({"geoaltitude": "real"}, EFFECTS)[0].would_separate
        ['temperature']
    """
    return [
        LeftOutChannel(channel, side, [n for n, e in catalogue.items() if channel in (*e.needs, *e.splits)])
        for channel, side in lacked.items()
    ]
