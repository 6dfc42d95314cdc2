"""Size of an effect on either side, so that a difference is not read as what real flights have."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import torch

from descentflow.diagnosis.findings.cause_found import OnBothSides, TradeSize
from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.plain_values import number
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.report.sizes import told_text
from descentflow.effects import Effect, Parameter
from descentflow.effects.effect import NOISE, NONE
from descentflow.measurements.level_channels import least_noise
from descentflow.measurements.quantity_registry import QUANTITIES

NO_NOISE = 1.1
"""Noise, in the least that exceeds rounding, up to which reports count as having none."""
LEAST_RATIO = 0.05
"""Logarithm of the ratio of noise up to which a channel is as noisy on both sides, and nothing is reported of it."""
LN_RATIO = "ln_ratio_"
"""Prefix of parameters that are noise of real flights over that of the simulator's."""


@dataclass(frozen=True)
class BothSides:
    """Report on an effect of which the simulator's flights have some.

    Attributes:
        has_some: Whether they have, or may have, for nothing proves that they have none.
        measured: By parameter, what either side shows by itself; empty where unknown.

    Example:
        >>> BothSides().has_some
        False
    """

    has_some: bool = False
    measured: list[OnBothSides] = field(default_factory=list)


def on_both_sides(compared: Compared, effect: Effect) -> BothSides:
    """Measurements of an effect on either side.

    Args:
        compared: Flights of both sides; a nominal descent has none of any effect.
        effect: Of which it is asked.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides = example_sides(EFFECTS["temperature"], [10.0])
        >>> found = on_both_sides(sides, EFFECTS["temperature"])
        >>> found.has_some, round(found.measured[0].flights), abs(found.measured[0].simulator) < 0.5
        (False, 10, True)
    """
    if not bool(compared.free.any()):
        return BothSides()
    if effect.is_noise:
        return BothSides(True, _noise(compared, effect))
    found = [_of_side(compared, effect, side) for side in (compared.real, ~compared.real)]
    if found[0] is None or found[1] is None:
        return BothSides(effect.against is not None)
    rows, some = [], False
    for p, flights, simulator in zip(effect.parameters, found[0], found[1], strict=True):
        some |= abs(simulator) >= NONE * p.scale
        rows.append(OnBothSides(p.name, p.told_unit, p.told(flights), p.told(simulator)))
    return BothSides(some, rows)


def _of_side(compared: Compared, effect: Effect, side: torch.Tensor) -> list[float] | None:
    """Parameters that one side shows by itself."""
    index, bands = torch.nonzero(side)[:, 0], len(compared.state.altitude_m)
    shown: dict[str, torch.Tensor] = {}
    for i, entry in enumerate(compared.entries):
        if entry.band >= 0:
            table = shown.setdefault(entry.quantity, torch.full((len(index), bands), torch.nan, dtype=torch.float64))
            table[:, entry.band] = compared.y[index, i]
    found = effect.measured(compared.state.rows(index), shown)
    return None if found is None else found.tolist()


def _noise(compared: Compared, effect: Effect) -> list[OnBothSides]:
    """Noise of either side, in the unit of the channel: geometric means over flights."""
    rows = []
    for i, entry in enumerate(compared.entries):
        name = f"{LN_RATIO}{entry.quantity.removeprefix(NOISE)}"
        if QUANTITIES[entry.quantity].is_noise and any(p.name == name for p in effect.parameters):
            sides = [float(compared.y[side, i].nanmean().exp()) for side in (compared.real, ~compared.real)]
            rows.append(OnBothSides(name, _unit_of_noise(entry.quantity), *sides))
    return rows


def _unit_of_noise(quantity: str) -> str:
    meaning = QUANTITIES[quantity].meaning
    return meaning.rpartition("(")[2].rstrip(")") if "(" in meaning else "1"


def told_of_both(effect: Effect, sizes: Sequence[TradeSize], both: BothSides) -> list[TradeSize]:
    """Sizes as reported where the simulator's flights have some of the effect; the largest noise first.

    Args:
        effect: Whose sizes they are.
        sizes: Real flights against the simulator's, as :func:`~descentflow.diagnosis.report.sizes.sizes_of` has them.
        both: What either side has.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> warmer = TradeSize("deviation_k", "", "", "K", Measured(4.8, 4.4, 5.2))
        >>> both = BothSides(True, [OnBothSides("deviation_k", "K", 9.9, 5.1)])
        >>> told_of_both(EFFECTS["temperature"], [warmer], both)[0].text
        "+4.8 K (+4.4 to +5.2): ISA +9.9 K against the simulator's ISA +5.1 K"
    """
    if not both.has_some:
        return list(sizes)
    measured = {row.parameter: row for row in both.measured}
    known = {p.name: p for p in effect.parameters}
    if effect.is_noise:
        largest = sorted(sizes, key=lambda size: -abs(math.log(size.value.estimate)))
        kept = [size for size in largest if abs(math.log(size.value.estimate)) > LEAST_RATIO] or largest[:1]
        return [_told_noise(size, measured.get(size.parameter), known[size.parameter]) for size in kept]
    if effect.against is None:
        return list(sizes)
    several = len(sizes) > 1
    return [_told(size, measured.get(size.parameter), known[size.parameter], several) for size in sizes]


def _told(size: TradeSize, row: OnBothSides | None, p: Parameter, several: bool) -> TradeSize:
    if row is None:
        # One of several needs its name: nothing else says what it is a size of.
        if several:
            return size
        return replace(size, short=_bare(p, size, False), text=_bare(p, size, True))
    # To a hundredth of a size that matters, so that nearly none is told as none.
    digits = max(1 - math.floor(math.log10(abs(p.told(p.scale)))), 0)
    of_flights, of_simulator = (told_text(p, Measured(round(x, digits))) for x in (row.flights, row.simulator))
    sides = f"{of_flights} against the simulator's {of_simulator}"
    return replace(size, short=f"{_bare(p, size, False)}: {sides}", text=f"{_bare(p, size, True)}: {sides}")


def _bare(p: Parameter, size: TradeSize, whole: bool) -> str:
    """A size without the name that restricts it to the real flights."""
    value = size.value if whole else Measured(size.value.estimate)
    return told_text(p, value).removeprefix(f"{p.symbol or p.text} ")


def _told_noise(size: TradeSize, row: OnBothSides | None, p: Parameter) -> TradeSize:
    if row is None:
        return size
    name, unit = p.symbol or p.text, "" if row.unit == "1" else f" {row.unit}"
    low, high = (None if x is None else x * row.simulator for x in (size.value.low, size.value.high))
    value = Measured(size.value.estimate * row.simulator, low, high)
    ends = "" if low is None or high is None else f" ({number(low)} to {number(high)})"
    least = least_noise(size.parameter.removeprefix(LN_RATIO))
    if row.simulator <= NO_NOISE * least:
        rest = ", where the simulator's reports have none"
        size = replace(size, value=value, unit=row.unit)
    else:
        rest = f" against the simulator's {number(row.simulator)}{unit} (x {size.value.estimate:.2f})"
    short = f"{name} {number(value.estimate)}{unit}"
    return replace(size, short=f"{short}{rest}", text=f"{short}{ends}{rest}")
