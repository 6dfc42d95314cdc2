"""Flights worth a look: those that show most of what no named cause explains."""

import torch
from torch import Tensor

from descentflow.diagnosis.findings.costs_found import LevelMeans
from descentflow.diagnosis.findings.inputs_found import FlightWorthALook
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.report.trade_units import in_trade

MOST = 10
"""Flights that are named."""
NEIGHBOURS = 0.5
"""Bands beside the one with the largest difference belong to it while theirs, of the same sign, is so large a share."""


def flights_worth_a_look(
    likelihood: EffectsLikelihood, shift: Tensor, profile: list[LevelMeans]
) -> list[FlightWorthALook]:
    r"""Real flights, those first that are best explained by having what is left of the mean difference.

    With what is left of the means, m, a flight i shows :math:`m^T S^{-1} r_i - \tfrac12 m^T S^{-1} m` nats of it, over
    the entries that it shows, where r is what it has beyond the simulator's mean and the named causes.

    Args:
        likelihood: Flights of both sides.
        shift: (n, p) of the named causes.
        profile: What the simulator flies on average by level, for units of the trade.

    Returns:
        At most :data:`MOST`; none where the flights' identifiers are not known or no quantity by level is compared.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> likelihood.compared = replace(likelihood.compared, names=tuple(f"flight-{i}" for i in range(80)))
        >>> found = flights_worth_a_look(likelihood, torch.zeros_like(likelihood.y), [])
        >>> len(found), found[0].quantity, found[0].unit
        (10, 'tas', '%')
    """
    compared, real = likelihood.compared, likelihood.real
    left = compared.y - shift
    mean = left[real].nanmean(0)
    if likelihood.has_reference:
        mean = mean - left[~real].nanmean(0)
    mean = mean.nan_to_num(0.0)
    at = _largest(likelihood, mean)
    if not compared.names or not at:
        return []
    normal = left[~real].nanmean(0).nan_to_num(0.0) if likelihood.has_reference else torch.zeros_like(mean)
    rest = left[real] - normal
    seen = rest.isfinite()
    # Whitening knows flights of both sides by their place.
    pattern = torch.zeros_like(left)
    pattern[real] = torch.where(seen, mean, 0.0)
    weighted = likelihood.whitening.apply(pattern)[real]
    shown = (weighted * (rest.nan_to_num(0.0) - 0.5 * pattern[real])).sum(1)
    inside = rest[:, at].nanmean(1)
    entries = [compared.entries[i] for i in at]
    low = min(compared.level_range(entry)[0] for entry in entries)
    high = max(compared.level_range(entry)[1] for entry in entries)
    order = torch.argsort(shown, descending=True).tolist()
    found = []
    for i in [i for i in order if bool(inside[i].isfinite())][:MOST]:
        excess, unit = in_trade(entries[0].quantity, float(inside[i]), low, high, profile)
        found.append(FlightWorthALook(compared.names[i], excess, unit, entries[0].quantity, low, high))
    return found


def _largest(likelihood: EffectsLikelihood, mean: Tensor) -> list[int]:
    """Entries of the quantity by level in which most is left, in neighbouring bands."""
    compared = likelihood.compared
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
