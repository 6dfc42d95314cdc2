"""Differences in aviation units: ft/min and kt instead of relative numbers and logarithms."""

import math
from collections.abc import Sequence

from descentflow.core.units import FT_M, KT_MPS
from descentflow.diagnosis.findings.costs_found import LevelMeans, Measured
from descentflow.diagnosis.findings.plain_values import number
from descentflow.measurements.quantity_registry import QUANTITIES

DECIMALS = {"s": 0, "NM": 1, "ft/min": 0, "kt": 1, "ft": 0, "%": 1, "factor": 2, "kg": 1}
"""Digits after the point that a reader cares for."""


def aviation_value(
    quantity: str, value: float, low_fl: float, high_fl: float, profile: Sequence[LevelMeans]
) -> tuple[float, str]:
    """A difference of a quantity (flights minus simulator) in an aviation unit.

    Args:
        quantity: Name, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`.
        value: The difference in the quantity's own unit.
        low_fl: Lower end of the levels that it is of.
        high_fl: Upper end.
        profile: What the simulator flies on average by level; a relative number stays one (in percent) without.

    Returns:
        The number and its unit. Of a logarithm of noise it is a factor.

    Example:
        >>> profile = [LevelMeans(157.5, rate_fpm=2000.0, cas_kt=280.0, tas_kt=350.0)]
        >>> value, unit = aviation_value("tas", 0.02, 150, 165, profile)
        >>> round(value, 2), unit
        (7.07, 'kt')
        >>> aviation_value("level", 51.0, 150, 165, [])
        (51.0, 's')
    """
    unit = QUANTITIES[quantity].unit if quantity in QUANTITIES else "1"
    if unit == "relative":
        inside = [m for m in profile if low_fl <= m.level_fl <= high_fl]
        if not inside:
            return 100 * math.expm1(value), "%"
        shown_unit = "kt" if quantity == "tas" else "ft/min"
        mean = sum(m.tas_kt if shown_unit == "kt" else m.rate_fpm for m in inside) / len(inside)
        return mean * math.expm1(value), shown_unit
    if unit == "ln":
        return math.exp(value), "factor"
    if quantity == "missing":
        return 100 * value, "%"
    factor, shown_unit = {"m/s": (1 / KT_MPS, "kt"), "m": (1 / FT_M, "ft")}.get(unit, (1.0, unit))
    return value * factor, shown_unit


def at_level(profile: Sequence[LevelMeans], level_fl: float) -> list[LevelMeans]:
    """The level of a profile that is nearest, moved to this one; empty where there is no profile.

    Example:
        >>> at_level([LevelMeans(157.5, 2000.0, 280.0, 350.0)], 160.0)
        [LevelMeans(level_fl=160.0, rate_fpm=2000.0, cas_kt=280.0, tas_kt=350.0)]
    """
    if not profile:
        return []
    one = min(profile, key=lambda m: abs(m.level_fl - level_fl))
    return [LevelMeans(level_fl, one.rate_fpm, one.cas_kt, one.tas_kt)]


def with_unit(value: float, unit: str, *, signed: bool = False) -> str:
    """A number with its unit, in as many digits as a reader cares for.

    Example:
        >>> with_unit(-112.3, "ft/min"), with_unit(1.26, "factor"), with_unit(2.04, "NM", signed=True)
        ('-112 ft/min', 'x 1.26', '+2.0 NM')
    """
    if unit == "factor":
        return f"x {value:.2f}"
    text = _rounded(value, _decimals(value, unit), signed)
    return text if unit == "1" else f"{text} {unit}"


def _decimals(value: float, unit: str) -> int | None:
    """Digits after the point, more where the number is smaller than its last digit; None of units without a habit."""
    decimals = DECIMALS.get(unit)
    if decimals is not None:
        decimals += 1 if decimals == 0 and abs(value) < 10 else 0
        decimals += 1 if 0 < abs(value) < 0.5 * 10**-decimals else 0
    return decimals


def _rounded(value: float, decimals: int | None, signed: bool) -> str:
    text = number(value) if decimals is None else f"{value:,.{decimals}f}"
    if float(text.replace(",", "")) == 0:
        return text.lstrip("-")
    return f"+{text}" if signed and value > 0 else text


def between(value: Measured, unit: str) -> str:
    """A difference with its sign and its interval.

    Example:
        >>> between(Measured(25.0, 22.0, 28.0), "s")
        '+25 s (+22 to +28)'
        >>> between(Measured(-0.01, -3.3, 3.28), "s"), between(Measured(2.0, -8.0, 29.0), "s")
        ('0.0 s (-3.3 to +3.3)', '+2 s (-8 to +29)')
    """
    # The digits of the widest are enough for all three.
    decimals = _decimals(max(map(abs, (value.estimate, *value.ends))), unit)
    text, *ends = (_rounded(one, decimals, True) for one in (value.estimate, *value.ends))
    text = text if unit == "1" else f"{text} {unit}"
    return f"{text} ({' to '.join(ends)})" if ends else text


def level_range(low_fl: float, high_fl: float) -> str:
    """Two flight levels as readers write them.

    Example:
        >>> level_range(149.96, 195.0)
        'FL150 to FL195'
    """
    return f"FL{low_fl:.0f} to FL{high_fl:.0f}"
