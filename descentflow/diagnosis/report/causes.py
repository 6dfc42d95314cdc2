"""Causes with their sizes, groups, closure and rivals, and what would separate what these data cannot."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from descentflow.diagnosis.correction.closure import Closure, rivals_closure
from descentflow.diagnosis.inference.likelihood import Contest
from descentflow.diagnosis.inference.selection import Chosen
from descentflow.diagnosis.inference.uncertainty import covariance
from descentflow.measurements.quantities import NEEDS

NINETY = 1.645
"""Standard errors on either side of a 90 % interval."""
GAUGE = ("mass", "idle_thrust", "drag_polar")
"""Of these three only ratios can be observed: one scale stays open unless a coefficient is known absolutely."""
SHOWS = {"TAS": "tas", "geoaltitude": "height", "groundspeed": "wind", "Mach": "mismatch"}
"""Channel -> the quantity that it makes."""


def causes_of(
    contest: Contest,
    chosen: Chosen,
    closure: Closure,
    lawful: Tensor,
    spreads: Mapping[str, float],
    say: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Every chosen effect, in order of selection.

    Args:
        contest: Flights and catalogue.
        chosen: Outcome of the selection.
        closure: Distances.
        lawful: (n, p) shift with each flight's own share.
        spreads: How widely the shares spread between flights, by effect.
        say: Told what is being done.
    """
    fit = chosen.fit
    spread = covariance(contest, fit).diagonal().clamp(min=0.0).sqrt()
    errors = dict(zip(fit.effects, torch.split(spread, [len(fit.theta[n]) for n in fit.effects]), strict=True))
    say("measuring what other effects would claim")
    alone = {name: single.fit.shift for name, single in chosen.singles.items()}
    rivals = rivals_closure(closure, alone, closure.floor(lawful))
    whole = {
        "marginal": closure.marginal(lawful),
        "conditional": closure.conditional(fit.shift),
        "transfer": closure.transfer(fit),
    }
    causes = []
    for name in fit.effects:
        gain, error = chosen.gains[name]
        causes.append(
            {
                "effect": name,
                "group": list(chosen.groups[name]),
                "probability": chosen.probability[name],
                "parameters": parameters(contest, name, fit.theta[name], errors[name]),
                "score_gain": {
                    "estimate": gain,
                    "low": gain - NINETY * error,
                    "high": gain + NINETY * error,
                    "unit": "nats",
                },
                "law": {"kind": contest.catalogue[name].law, "spread_of_shares": spreads[name]},
                "closure": whole,
                "rivals": [row for row in rivals if row["effect"] != name],
            }
        )
    return causes


def parameters(contest: Contest, name: str, theta: Tensor, error: Tensor) -> dict[str, dict[str, Any]]:
    """Estimate and 90 % interval of every parameter, kept within its physical bounds."""
    found: dict[str, dict[str, Any]] = {}
    for p, value, sd in zip(contest.catalogue[name].parameters, theta.tolist(), error.tolist(), strict=True):
        if sd == 0.0 and not p.by_law:
            # The data say nothing of it: a channel that is not there.
            continue
        # A law's share is a count of flights.
        sd = (value * (1 - value) / int(contest.real.sum())) ** 0.5 if p.by_law else math.hypot(sd, p.inexact)
        if sd == 0.0:
            found[p.name] = {"estimate": value, "low": None, "high": None, "unit": p.unit}
            continue
        low, high = max(value - NINETY * sd, p.low), min(value + NINETY * sd, p.high)
        found[p.name] = {"estimate": value, "low": low, "high": high, "unit": p.unit}
    return found


def would_split(contest: Contest, chosen: Chosen, causes: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Channels that are not there and would separate a cause from its group, or help an unknown one to a name."""
    there = set(contest.compared.quantities())
    found = []
    for cause in causes:
        names = [cause["effect"], *cause["group"]]
        missing = list(dict.fromkeys(c for n in names if n in contest.catalogue for c in contest.catalogue[n].splits))
        missing = [c for c in missing if SHOWS.get(c, c) not in there and (c in SHOWS or c in NEEDS)]
        gauge = [n for n in names if n in GAUGE]
        if len(names) > 1 and missing:
            found.append({"between": names, "channels": missing, "why": "they look alike in the channels given"})
        if gauge:
            found.append(
                {
                    "between": list(GAUGE),
                    "channels": [],
                    "why": "mass, thrust and drag may all be scaled together without a trace: only a coefficient "
                    "that is known absolutely (a weighed aircraft, a measured thrust) tells which of them is off",
                }
            )
    if not causes:
        for channel, quantity in SHOWS.items():
            if quantity not in there:
                found.append({"between": ["unknown"], "channels": [channel], "why": "it is not among the channels"})
    return found
