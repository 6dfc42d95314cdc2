"""Causes with their sizes, groups, closure and rivals, and what would separate what these data cannot."""

from collections.abc import Mapping, Sequence

from torch import Tensor

from descentflow.diagnosis.findings.cause_found import Cause, ParameterEstimate
from descentflow.diagnosis.findings.gap_found import WouldSplit
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.report.sizes import NINETY, known_errors
from descentflow.effects import UNKNOWN, Effect

SHOWS = {"TAS": "tas", "geoaltitude": "height", "groundspeed": "wind", "Mach": "mismatch"}
"""Channel -> the quantity that it makes, the one most often worth adding first."""


def parameters(effect: Effect, theta: Tensor, error: Tensor, flights: int) -> dict[str, ParameterEstimate]:
    """Estimate and 90 % interval of every parameter, kept within its physical bounds.

    Args:
        effect: Whose parameters they are.
        theta: Estimates (k,).
        error: Standard errors (k,), zero where the data say nothing.
        flights: Real flights, by which a share of them is known.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> theta, error = torch.tensor([10.0]), torch.tensor([0.5])
        >>> print(parameters(EFFECTS["temperature"], theta, error, 400)["deviation_k"])
        deviation from the standard atmosphere 10 (9.18 to 10.8) K
    """
    found: dict[str, ParameterEstimate] = {}
    known = known_errors(effect, theta, error, flights)
    for p, value, sd in zip(effect.parameters, theta.tolist(), known.tolist(), strict=True):
        if p.is_spread:
            if value > 0.0:
                found[p.name] = ParameterEstimate(value, None, None, p.unit, p.text)
            continue
        if sd == 0.0 and not p.from_heterogeneity:
            # The data say nothing of it: a channel that is not there.
            continue
        low: float | None = None
        high: float | None = None
        if sd > 0.0:
            low, high = max(value - NINETY * sd, p.low), min(value + NINETY * sd, p.high)
        found[p.name] = ParameterEstimate(value, low, high, p.unit, p.text)
    return found


def would_split(
    compared: Compared,
    catalogue: Mapping[str, Effect],
    causes: Sequence[Cause],
    undecided: Sequence[Sequence[str]] = (),
) -> list[WouldSplit]:
    """Channels that are not there and would separate a cause from its group, or help an unknown one to a name.

    Args:
        compared: Flights of both sides.
        catalogue: Effects by name.
        causes: That were named.
        undecided: Effects that would be named, each with those that it may be as well for lack of their channels.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> [row.channels for row in would_split(example_sides(), EFFECTS, [])]  # of an unknown cause
        [['geoaltitude'], ['groundspeed'], ['Mach']]
    """
    there = set(compared.quantities())
    found = []
    for alike in undecided:
        needed = list(dict.fromkeys(channel for name in alike for channel in catalogue[name].needs))
        found.append(WouldSplit(list(alike), needed, "they look alike in the channels given, so neither is named"))
    for cause in causes:
        names = [cause.effect, *cause.group]
        able = list(dict.fromkeys(channel for name in names for channel in catalogue[name].splits))
        missing = [channel for channel in able if channel in SHOWS and SHOWS[channel] not in there]
        if len(names) > 1 and missing:
            found.append(WouldSplit(names, missing, "they look alike in the channels given"))
        groups = dict.fromkeys(catalogue[name].scale_group for name in names)
        found += [WouldSplit(list(group.members), [], group.why) for group in groups if group is not None]
    if not causes:
        why = "it is not among the channels"
        found += [WouldSplit([UNKNOWN], [c], why) for c, quantity in SHOWS.items() if quantity not in there]
    return found
