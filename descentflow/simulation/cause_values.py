"""The numbers of a cause: units, defaults and bounds, and how those that are left out are completed."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from descentflow.core.errors import ConfigError

Values = Mapping[str, float]


@dataclass(frozen=True)
class CauseValue:
    """One number of a cause.

    Example:
        >>> CauseValue("deviation_k", "K", 10.0, "mean deviation from the standard atmosphere").text
        'deviation_k=10 [K] mean deviation from the standard atmosphere'
    """

    name: str
    unit: str
    """``1`` for a plain number."""
    default: float
    """Value if left out; spreads are 0 and all flights are alike by default."""
    description: str
    low: float = -math.inf
    high: float = math.inf
    """Least and largest that can be flown."""

    @property
    def text(self) -> str:
        """A line of help."""
        unit = "" if self.unit == "1" else f" [{self.unit}]"
        return f"{self.name}={self.default:g}{unit} {self.description}"


def _none(values: Values) -> None:
    """All values that are each possible are possible together."""


@dataclass(frozen=True)
class Plantable:
    """Causes and their values.

    Example:
        >>> from descentflow.simulation.plantable import PLANTABLE
        >>> PLANTABLE["mass"].description, PLANTABLE["mass"].units
        ('flights heavier or lighter', {'factor': '1', 'spread': '1', 'share': '1'})
    """

    description: str
    values: tuple[CauseValue, ...]
    impossible: Callable[[Values], str | None] = _none
    """Possible values instead, for values that are each possible and not together; None if they are."""

    @property
    def units(self) -> dict[str, str]:
        """Unit of every value."""
        return {value.name: value.unit for value in self.values}


def completed(name: str, known: Mapping[str, Plantable], given: Values) -> dict[str, float]:
    """Values of a cause with the defaults of those that are left out.

    Args:
        name: Of the cause.
        known: Those there are.
        given: Some of its values.

    Raises:
        ConfigError: If there is no such cause or value, or a value cannot be flown.

    Example:
        >>> known = {"late_rate": Plantable("late", (CauseValue("lag_s", "s", 12.0, "time constant", low=0.0),))}
        >>> completed("late_rate", known, {})
        {'lag_s': 12.0}
        >>> completed("late_rate", known, {"lag_s": -3.0})
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: late_rate with lag_s=-3; expected a finite number, at least 0...
    """
    if name not in known:
        raise ConfigError(f"to plant {name}", expected=f"one of {', '.join(known)}", mend="correct the name")
    values, impossible = known[name].values, known[name].impossible
    names = [value.name for value in values]
    for word in given:
        if word not in names:
            raise ConfigError(
                f"{name} with {word}",
                expected=f"of {name}: {'; '.join(value.text for value in values)}",
                mend="correct the name of the value",
            )
    full = {value.name: float(given.get(value.name, value.default)) for value in values}
    for value in values:
        if not (math.isfinite(full[value.name]) and value.low <= full[value.name] <= value.high):
            raise ConfigError(
                f"{name} with {value.name}={full[value.name]:g}",
                expected=f"a finite number{_bounds(value)}",
                mend="correct the value",
            )
    why = impossible(full)
    if why is not None:
        raise ConfigError(
            f"{name} with {', '.join(f'{k}={v:g}' for k, v in full.items())}", expected=why, mend="correct the values"
        )
    return full


def _bounds(value: CauseValue) -> str:
    ends = [f"at {word} {end:g}" for word, end in (("least", value.low), ("most", value.high)) if math.isfinite(end)]
    return f", {' and '.join(ends)}" if ends else ""
