"""Flights that the spread between flights is learnt from."""

import torch
from scipy.special import fdtri
from torch import Tensor

from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.measurements.quantity_registry import QUANTITIES

MIN_NORMAL_FLIGHTS = 100
"""Flights of a simulator from which the spread between flights is learnt without the real ones."""
FALSELY_NARROW = 0.001
"""Chance that a simulator whose flights scatter as real ones do is taken for one whose flights scatter less. Rare, for
then an effect that takes some flights and leaves others hides itself. At 0.01 or 0.0001 nothing changes where the
scatter is far from the real one: of 80 aircraft a side, variances that differ by a factor of 1.7, 2.0 or 2.4 count."""
OF_FLIGHT = ("rate", "cas")
"""Quantities that say whether flights of a simulator differ: how fast they descend at their own speed, and that speed.
In the air, in reports and in gaps a simulator with the right crews and aircraft may scatter less."""


def normal_flights(compared: Compared, *, narrow: bool) -> Tensor | None:
    """Flights that the spread is learnt from: the simulator's where they are enough, else all of both (None).

    An effect that takes some flights and leaves others would widen the spread in its own direction, and so hide itself.
    But the flights of a simulator that flies by a table hardly differ, and by their spread every percent of the rate
    would outweigh what the airspeeds say. So where they are too ``narrow``, real flights stand in their place.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides(n=120)
        >>> int(normal_flights(sides, narrow=False).sum()), normal_flights(example_sides(n=50), narrow=False) is None
        (120, True)
    """
    known = compared.real if narrow else ~compared.real
    enough = int(known.sum()) >= max(MIN_NORMAL_FLIGHTS, compared.y.shape[1])
    return known if enough and bool(compared.free.all()) else None


def is_narrow(compared: Compared, shift: Tensor | None = None) -> bool:
    """Whether a simulator's flights scatter less than real ones, by their variances of the rate and of the speed.

    Of both, at first: an effect that takes some flights and leaves others moves one of them. Once effects were fitted
    the rate decides alone, apart from what they add to each flight: what is left of its scatter they do not explain.

    Held against the F law with one degree of freedom less than aircraft, as if those of one aircraft were alike: so a
    simulator is rarely taken for narrower than it is.

    Args:
        compared: Flights of both sides.
        shift: (n, p) of each flight by the effects that were fitted; none were yet if absent.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> sides = example_sides()
        >>> table = replace(sides, y=torch.where(sides.real[:, None], sides.y, 0.2 * sides.y))
        >>> is_narrow(sides), is_narrow(table)
        (False, True)
    """
    if bool(compared.real.all()):
        return False
    y = compared.y if shift is None else compared.y - shift
    ratios = []
    variances = [_variance(y[side]) for side in (compared.real, ~compared.real)]
    asked = OF_FLIGHT if shift is None else ("rate",)
    for quantity in [name for name in asked if name in compared.quantities()]:
        at = compared.columns(quantity)
        real, simulated = (variance[at].nanmedian() for variance in variances)
        ratios.append(float((real / simulated.clamp(min=1e-18)).nan_to_num(1.0)))
    freedom = [len(torch.unique(compared.airframe[side])) - 1 for side in (compared.real, ~compared.real)]
    return min(ratios, default=1.0) > float(fdtri(*freedom, 1 - FALSELY_NARROW))


def left_between_means(compared: Compared, shift: Tensor) -> float:
    """How far the means of what flights do are from each other after a fit: mean square, in standard errors.

    The errors are those of either side's own scatter, so that fits under any spread can be set beside each other. Noise
    of reports is left out: no spread between flights decides whether it is named.

    Args:
        compared: Flights of both sides.
        shift: (n, p) of each flight by the effects that were fitted.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> warm = example_sides(EFFECTS["temperature"], [10.0])
        >>> left_between_means(warm, torch.zeros_like(warm.y)) > 10
        True
    """
    y = compared.y - shift
    sides = [y[side] for side in (compared.real, ~compared.real)]
    count = [one.isfinite().sum(0).clamp(min=1) for one in sides]
    least = compared.negligible() ** 2
    error = sum((_variance(one) + least) / n for one, n in zip(sides, count, strict=True))
    left = (sides[0].nanmean(0) - sides[1].nanmean(0)).square() / error
    return float(left[~torch.tensor([QUANTITIES[entry.quantity].is_noise for entry in compared.entries])].nanmean())


def _variance(y: Tensor) -> Tensor:
    """Variance (p,) of what is seen."""
    seen = y.isfinite()
    centred = torch.where(seen, y - y.nanmean(0), 0.0)
    return centred.square().sum(0) / (seen.sum(0) - 1).clamp(min=1)
