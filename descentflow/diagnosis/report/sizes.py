"""Sizes of an effect as reported: in units of the trade, and of the flights that have it."""

import math
from collections.abc import Callable

import torch
from torch import Tensor

from descentflow.diagnosis.findings.cause_found import ClosedShare, TradeSize
from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.plain_values import number, percent
from descentflow.effects import Effect, Parameter

NINETY = 1.645
"""Standard errors on either side of a 90 % interval."""
STEP = 1e-5
"""Of derivatives, in sizes of a parameter that matter."""


def sizes_of(effect: Effect, theta: Tensor, error: Tensor, flights: int) -> list[TradeSize]:
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
        ['CD0 x 1.58 (1.52 to 1.65)', 'lower end FL190 (FL188 to FL192)', 'upper end FL265 (FL263 to FL267)']
    """
    error = known_errors(effect, theta, error, flights)
    _, whole = effect.mixture(theta)
    spread = torch.zeros_like(theta)
    for i, parameter in enumerate(effect.parameters):
        # Errors of the parameters are taken as independent, which that of a mean and of a share nearly are.
        step = torch.zeros_like(theta)
        step[i] = STEP * parameter.scale
        slope = (effect.mixture(theta + step)[1] - effect.mixture(theta - step)[1]) / (2 * STEP * parameter.scale)
        spread = spread + (slope * error[i]) ** 2
    found = []
    for p, value, sd, known in zip(effect.parameters, whole.tolist(), spread.sqrt().tolist(), error > 0, strict=True):
        if p.shown_as != "flights" and bool(known):
            low, high = max(value - NINETY * sd, p.low), min(value + NINETY * sd, max(p.high, value))
            told = Measured(p.told(value), p.told(low), p.told(high))
            found.append(
                TradeSize(p.name, told_text(p, Measured(told.estimate)), told_text(p, told), p.told_unit, told)
            )
    return found


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
    at = next((i for i, p in enumerate(effect.parameters) if p.shown_as == "flights"), None)
    sd = float(known_errors(effect, theta, error, flights)[at]) if at is not None else 0.0
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
    found = error.clone()
    for i, p in enumerate(effect.parameters):
        value, sd = float(theta[i]), float(error[i])
        if p.is_spread:
            found[i] = 0.0
        elif p.from_heterogeneity:
            found[i] = (max(value * (1 - value), 0.0) / flights) ** 0.5
        elif sd > 0.0:
            found[i] = math.hypot(sd, p.inexact)
    return found


def told_text(parameter: Parameter, value: Measured) -> str:
    """A parameter in words, from reported values.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> told_text(EFFECTS["temperature"].parameters[0], Measured(7.2, 6.8, 7.6))
        'ISA +7.2 K (+6.8 to +7.6)'
        >>> told_text(EFFECTS["wind_gradient"].parameters[0], Measured(-1.6))
        'tailwind -1.6 kt per 1,000 ft'
    """
    unit, name = parameter.told_unit, parameter.symbol or parameter.text
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
    return "" if value.low is None or value.high is None else f" ({shown(value.low)} to {shown(value.high)})"
