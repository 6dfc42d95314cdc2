"""Message where no descent meets a request: the nearest value among draws that meet the rest of it."""

from collections.abc import Callable
from dataclasses import replace
from math import ceil, floor

import numpy as np

from descentflow.core.errors import ImplausibleError
from descentflow.generation.conditional._latent_density import Array
from descentflow.generation.conditional._point_condition import since_entry
from descentflow.generation.conditional.constraints import (
    Constraint,
    DescentRequest,
    PointAsked,
    SpeedAsked,
    of_cas_mps,
)
from descentflow.representation.decoder.trajectories import Trajectories

LOOKED_AT = 1000
"""Descents among which the nearest value is sought: the ends of their range are those of one in a thousand."""
DIGITS = {"cas_kt": 1, "mach": 4, "time_s": 1, "distance_nm": 2}


def implausible(
    request: DescentRequest,
    culprit: Constraint,
    draws: Callable[[DescentRequest, int], Trajectories],
    levels_fl: list[float],
) -> ImplausibleError:
    """The error for a request, of which ``culprit`` cannot be met.

    Args:
        request: As asked.
        culprit: Which of its speeds, or its time or distance.
        draws: Draws n descents of a request.
        levels_fl: Of the grid.

    Returns:
        The error, with the name of what cannot be met and the nearest value of :data:`LOOKED_AT` draws, in its own
        units. One descent in some thousands may be nearer.

    Example:
        >>> from descentflow.core.units import KT_MPS
        >>> def draws(request, n):  # three descents, with 250, 270 and 280 kt at the lowest of two levels
        ...     cas = KT_MPS * torch.tensor([[250.0, 260.0], [270.0, 260.0], [280.0, 260.0]]).double()
        ...     entry = torch.ones(3, dtype=int)
        ...     return Trajectories(torch.tensor([200.0, 330.0]), entry, cas, cas, cas, cas, cas, cas)
        >>> speed = SpeedAsked("cas_kt", 0, 300.0, 310.0)
        >>> error = implausible(DescentRequest(1, (speed,)), speed, draws, [200.0, 330.0])
        >>> error.constraint, round(error.nearest, 6), error.got
        ('cas_kt', 280.0, 'cas_kt 300 to 310 at FL200, which no descent of the model has with entry at FL330')
    """
    speeds = tuple(speed for speed in request.speeds if speed is not culprit)
    rest = replace(request, speeds=speeds, points=tuple(point for point in request.points if point is not culprit))
    flown, name, low, high = draws(rest, LOOKED_AT), culprit.name, culprit.low, culprit.high
    if isinstance(culprit, SpeedAsked):
        values = _speeds(culprit, flown, levels_fl)
        text = culprit.text(levels_fl[int(flown.entry[0]) if culprit.level < 0 else culprit.level])
    else:
        values, text = _at_point(culprit, flown, levels_fl, request.deviation_k), culprit.text
    off = np.maximum(np.maximum(low - values, values - high), 0.0)
    nearest, digits = float(values[off.argmin()]), DIGITS[name]
    others = "; ".join(rest.words(levels_fl)) or "nothing else asked"
    got = f"{text}, which no descent of the model has with {others}"
    least, most, step = float(values.min()), float(values.max()), 10.0**-digits
    if most - least < step:  # a rounded value would be refused again
        band = f"({floor(least / step) * step:.{digits}f}, {ceil(most / step) * step:.{digits}f})"
        return ImplausibleError(
            got,
            expected=f"{nearest:.{digits + 3}f}, which follows from what else is asked",
            mend=f"leave {name} out there, or ask for the band {band}",
            constraint=name,
            nearest=nearest,
        )
    suggested = min(max(nearest, ceil(least / step) * step), floor(most / step) * step)
    ends = f"{least:.{digits}f} to {most:.{digits}f}"
    return ImplausibleError(
        got,
        expected=f"{ends}, as {LOOKED_AT:,} plausible draws have (rarer ones lie beyond)",
        mend=f"ask for the nearest of theirs, {name} {suggested:.{digits}f}, or for a band that holds it",
        constraint=name,
        nearest=nearest,
    )


def _speeds(asked: SpeedAsked, flown: Trajectories, levels_fl: list[float]) -> Array:
    entry = flown.entry.numpy()
    level = entry if asked.level < 0 else np.full(len(entry), asked.level)
    cas_mps = flown.cas_mps.numpy()[np.arange(len(level)), level]
    return np.array([of_cas_mps(asked.name, float(v), levels_fl[k]) for v, k in zip(cas_mps, level, strict=True)])


def _at_point(asked: PointAsked, flown: Trajectories, levels_fl: list[float], deviation_k: float) -> Array:
    since = since_entry(flown, asked.name, deviation_k).numpy()
    lowest, highest = np.interp(asked.levels, levels_fl, np.arange(len(levels_fl)))
    # Of a band of levels, the time at whichever of them is nearest.
    later, sooner = since[:, round(float(lowest))], since[:, round(float(highest))]
    values: Array = np.clip(asked.low, sooner / asked.unit, later / asked.unit)
    return values if asked.levels[0] < asked.levels[1] else later / asked.unit
