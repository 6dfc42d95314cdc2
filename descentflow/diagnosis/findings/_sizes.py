"""Sizes of an effect in aviation units, of the flights that have it, next to what either side has by itself."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from descentflow.diagnosis.findings.cause_found import ClosedShare, OnBothSides, ParameterEstimate, ReportedSize
from descentflow.diagnosis.findings.costs_found import NINETY, Measured
from descentflow.diagnosis.findings.plain_values import number, percent
from descentflow.effects import Effect, Parameter

DERIVATIVE_STEP = 1e-5
"""Step of derivatives, in sizes of a parameter that matter."""


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
    estimates: dict[str, ParameterEstimate] = {}
    known = known_errors(effect, theta, error, flights)
    for p, value, sd in zip(effect.parameters, theta.tolist(), known.tolist(), strict=True):
        if sd == 0.0 and not p.from_heterogeneity:
            # The data say nothing of it: a channel that is not there.
            continue
        half = NINETY * sd
        low, high = (max(value - half, p.low), min(value + half, p.high)) if sd > 0.0 else (None, None)
        estimates[p.name] = ParameterEstimate(value, low, high, p.unit, p.text)
    return estimates


def sizes_of(effect: Effect, theta: Tensor, error: Tensor, flights: int) -> list[ReportedSize]:
    """Every parameter as reported, of the flights that have the effect.

    Args:
        effect: Whose parameters they are.
        theta: Estimates (k,), of all flights together.
        error: Standard errors (k,), zero where the data say nothing.
        flights: Real flights, by which a share of them is known.

    Returns:
        The sizes with 90 % intervals, but the share itself, see :func:`share_of`.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> theta = torch.tensor([0.36, 190.0, 265.0, 0.62, 0.0, 0, 0, 0]).double()
        >>> error = torch.tensor([0.02, 1.0, 1.0, 0.02, 0.0, 0.0, 0.0, 0.0]).double()
        >>> sizes = sizes_of(EFFECTS["speed_brake"], theta, error, 400)
        >>> [size.text for size in sizes]
        ['CD0 x 1.58 (1.52 to 1.65)', 'lower end FL190 (FL187 to FL193)', 'upper end FL265 (FL262 to FL268)']
    """
    error = known_errors(effect, theta, error, flights)
    _, whole = effect.mixture(theta)
    spread = torch.zeros_like(theta)
    for i, parameter in enumerate(effect.parameters):
        # Errors of the parameters are taken as independent, which that of a mean and of a share nearly are.
        step, size = torch.zeros_like(theta), DERIVATIVE_STEP * parameter.scale
        step[i] = size
        slope = (effect.mixture(theta + step)[1] - effect.mixture(theta - step)[1]) / (2 * size)
        spread = spread + (slope * error[i]) ** 2
    sizes = []
    for p, value, sd, known in zip(effect.parameters, whole.tolist(), spread.sqrt().tolist(), error > 0, strict=True):
        if p.shown_as != "flights" and bool(known):
            low, high = max(value - NINETY * sd, p.low), min(value + NINETY * sd, max(p.high, value))
            reported = Measured(p.reported(value), p.reported(low), p.reported(high))
            sizes.append(ReportedSize(p.name, reported_text(p, reported), p.reported_unit, reported))
    return sizes


def share_of(effect: Effect, theta: Tensor, error: Tensor, flights: int) -> ClosedShare | None:
    """Share of the flights that have the effect, with its 90 % interval; None where all have it.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> theta = torch.tensor([0.36, 190.0, 265.0, 0.62, 0.0, 0, 0, 0]).double()
        >>> print(share_of(EFFECTS["speed_brake"], theta, torch.full((8,), 0.02).double(), 400))
        62 % (58 % to 66 %)
        >>> share_of(EFFECTS["temperature"], torch.tensor([10.0]), torch.tensor([0.5]), 400) is None
        True
    """
    share, _ = effect.mixture(theta)
    if share >= 1.0:
        return None
    known = zip(effect.parameters, known_errors(effect, theta, error, flights).tolist(), strict=True)
    sd = next((sd for p, sd in known if p.shown_as == "flights"), 0.0)
    if sd == 0.0:
        return ClosedShare(share, None, None)
    return ClosedShare(share, max(share - NINETY * sd, 0.0), min(share + NINETY * sd, 1.0))


def known_errors(effect: Effect, theta: Tensor, error: Tensor, flights: int) -> Tensor:
    """Standard errors (k,) with what the equations leave open, and that of a share of flights as of a count.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> theta = torch.tensor([0.3, 190.0, 265.0, 0.5, 0.0, 0.0, 0.0, 0.0])
        >>> known_errors(EFFECTS["speed_brake"], theta, torch.zeros(8), 400)
        tensor([0.0000, 0.0000, 0.0000, 0.0250, 0.0000, 0.0000, 0.0000, 0.0000])
    """
    errors = error.clone()
    for i, p in enumerate(effect.parameters):
        value, sd = float(theta[i]), float(error[i])
        if p.is_spread:
            errors[i] = 0.0
        elif p.from_heterogeneity:
            errors[i] = (max(value * (1 - value), 0.0) / flights) ** 0.5
        elif sd > 0.0:
            errors[i] = math.hypot(sd, p.inexact)
    return errors


def reported_text(parameter: Parameter, value: Measured) -> str:
    """A parameter in words, from reported values.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> reported_text(EFFECTS["temperature"].parameters[0], Measured(7.2, 6.8, 7.6))
        'ISA +7.2 K (+6.8 to +7.6)'
        >>> reported_text(EFFECTS["wind_gradient"].parameters[0], Measured(-1.6))
        'tailwind -1.6 kt per 1,000 ft'
    """
    unit, name = parameter.reported_unit, parameter.symbol or parameter.text
    if unit == "FL":
        return f"{name} FL{value.estimate:.0f}{_ends(value, lambda x: f'FL{x:.0f}')}"
    if unit == "factor":
        return f"{name} x {value.estimate:.2f}{_ends(value, lambda x: f'{x:.2f}')}"
    if unit == "%":
        return f"{name} {percent(value.estimate / 100)}{_ends(value, lambda x: f'{x:.0f} %')}"
    signed = parameter.low < 0
    after = "" if unit == "1" else f" {unit}"
    return f"{name} {_number(value.estimate, signed)}{after}{_ends(value, lambda x: _number(x, signed))}"


def _number(value: float, signed: bool) -> str:
    shown = number(value)
    return f"+{shown}" if signed and value > 0 else shown


def _ends(value: Measured, shown: Callable[[float], str]) -> str:
    return f" ({' to '.join(map(shown, value.ends))})" if value.ends else ""


@dataclass(frozen=True)
class BothSides:
    """Size of an effect on either side.

    Attributes:
        has_some: Whether the simulator's flights have some, or may have, for nothing proves that they have none.
        measured: By parameter, what either side shows; empty where unknown.

    Example:
        >>> BothSides().has_some
        False
    """

    has_some: bool = False
    measured: list[OnBothSides] = field(default_factory=list)


def sizes_beside(effect: Effect, sizes: Sequence[ReportedSize], both: BothSides) -> list[ReportedSize]:
    """Sizes as differences, next to what either side has, where the simulator's flights have some of the effect.

    Args:
        effect: Whose sizes they are.
        sizes: Real flights against the simulator's, as :func:`sizes_of` has them.
        both: What either side has.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> warmer = ReportedSize("deviation_k", "", "K", Measured(4.8, 4.4, 5.2))
        >>> both = BothSides(True, [OnBothSides("deviation_k", "K", 9.9, 5.1)])
        >>> sizes_beside(EFFECTS["temperature"], [warmer], both)[0].text
        "+4.8 K (+4.4 to +5.2): ISA +9.9 K against the simulator's ISA +5.1 K"
    """
    if not (both.has_some and effect.against):
        return list(sizes)
    measured = {row.parameter: row for row in both.measured}
    known = {p.name: p for p in effect.parameters}
    return [_size_beside(size, measured.get(size.parameter), known[size.parameter], len(sizes) > 1) for size in sizes]


def _size_beside(size: ReportedSize, row: OnBothSides | None, p: Parameter, several: bool) -> ReportedSize:
    bare = reported_text(p, size.value).removeprefix(f"{p.symbol or p.text} ")
    if row is None:
        # One of several needs its name: nothing else says what it is a size of.
        return size if several else replace(size, text=bare)
    # To a hundredth of a size that matters, so that nearly none reads as none.
    digits = max(1 - math.floor(math.log10(abs(p.reported(p.scale)))), 0)
    of_flights, of_simulator = (reported_text(p, Measured(round(x, digits))) for x in (row.flights, row.simulator))
    return replace(size, text=f"{bare}: {of_flights} against the simulator's {of_simulator}")
