"""Choice of the causes: the best sets of effects, and the smallest sizes that would have been named."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Subset:
    """A set of effects and its weight among all sets that were fitted.

    Example:
        >>> Subset(["temperature", "mass"], weight=0.8).effects
        ['temperature', 'mass']
    """

    effects: list[str]
    weight: float


@dataclass(frozen=True)
class DetectionLimit:
    """The smallest size of an effect that would be named in 80 of 100 cases, for these flights and channels.

    Attributes:
        effect: Its name in the catalogue.
        parameter: Which of its parameters ``size`` is of.
        size: In ``unit``; None where no physically possible size would be named.
        unit: Of the size, as of the parameter.
        label: What readers call the parameter.

    Example:
        >>> DetectionLimit("temperature", "deviation_k", 1.2, "K", "deviation from the standard atmosphere").size
        1.2
    """

    effect: str
    parameter: str
    size: float | None
    unit: str
    label: str = ""
