"""Causes that can be planted in flights, with their values, units, defaults and bounds, as `plantable.toml` lists them.

They stand apart from what the causes do, for a command's help lists them without loading what flies.
"""

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from descentflow.core.errors import ConfigError
from descentflow.core.files import table_beside

Values = Mapping[str, float]
ORDERS = {"<": operator.lt, "<=": operator.le}


@dataclass(frozen=True)
class CauseValue:
    """One number of a cause.

    Example:
        >>> CauseValue("deviation_k", "K", 10.0, -60.0, 60.0, "mean deviation from the standard atmosphere").text
        'deviation_k=10 [K] mean deviation from the standard atmosphere'
    """

    name: str
    unit: str
    """``1`` for a plain number."""
    default: float
    """Value if left out; spreads are 0 and all flights are alike by default."""
    low: float
    high: float
    """Least and largest that can be flown."""
    description: str

    @property
    def text(self) -> str:
        """A line of help."""
        unit = "" if self.unit == "1" else f" [{self.unit}]"
        return f"{self.name}={self.default:g}{unit} {self.description}"


@dataclass(frozen=True)
class Plantable:
    """Causes and their values.

    Example:
        >>> PLANTABLE["mass"].description, [value.name for value in PLANTABLE["mass"].values]
        ('flights heavier or lighter', ['factor', 'spread', 'share'])
    """

    description: str
    values: tuple[CauseValue, ...]
    together: tuple[tuple[str, str, str], ...] = ()
    """Rules of values that are each possible and not together: sum, order and bound, as `("low_fl", "<", "high_fl")`.
    """


def _plantable(table: Mapping[str, Any]) -> Plantable:
    values = tuple(CauseValue(name, *numbers) for name, numbers in table["values"].items())
    return Plantable(table["description"], values, tuple(map(tuple, table.get("together", ()))))


PLANTABLE = {name: _plantable(table) for name, table in table_beside(__file__).items()}
"""By the name of the cause: first those of the diagnosis's catalogue, then those outside it."""


def complete(causes: Mapping[str, Values], known: Mapping[str, Plantable] = PLANTABLE) -> dict[str, dict[str, float]]:
    """Values of causes with the defaults of those that are left out.

    Args:
        causes: Values by the name of the cause.
        known: Causes there are.

    Raises:
        ConfigError: If there is no such cause or value, or a value cannot be flown.

    Example:
        >>> complete({"temperature": {"deviation_k": 3.0}})
        {'temperature': {'deviation_k': 3.0, 'spread_k': 0.0, 'daily_spread_k': 0.0}}
        >>> complete({"vertical_rate_lag": {"lag_s": -3.0}})
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: vertical_rate_lag with lag_s=-3; expected a finite number, at least 0...
    """
    unknown = [name for name in causes if name not in known]
    if unknown:
        raise ConfigError(f"to plant {unknown[0]}", expected=f"one of {', '.join(known)}", mend="correct the name")
    return {name: _completed(name, known[name], given) for name, given in causes.items()}


def _completed(name: str, cause: Plantable, given: Values) -> dict[str, float]:
    """All values of a cause, of some of them."""
    whole = {value.name: float(given.get(value.name, value.default)) for value in cause.values}
    for word in given:
        if word not in whole:
            raise ConfigError(
                f"{name} with {word}",
                expected=f"of {name}: {'; '.join(value.text for value in cause.values)}",
                mend="correct the name of the value",
            )
    for value in cause.values:
        number = whole[value.name]
        if not (math.isfinite(number) and value.low <= number <= value.high):
            raise ConfigError(
                f"{name} with {value.name}={number:g}",
                expected=f"a finite number, at least {value.low:g} and at most {value.high:g}",
                mend="correct the value",
            )
    for left, order, right in cause.together:
        sums = (
            sum(whole[term] if term in whole else float(term) for term in side.split(" + ")) for side in (left, right)
        )
        if not ORDERS[order](*sums):
            got = ", ".join(f"{value}={number:g}" for value, number in whole.items())
            raise ConfigError(f"{name} with {got}", expected=f"{left} {order} {right}", mend="correct the values")
    return whole
