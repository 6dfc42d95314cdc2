"""Place of the gap, its remainder, and the data that would decide more."""

from dataclasses import dataclass

FALSE_GAP = 0.02
"""p-value up to which a gap is called: 2 of 100 comparisons without one."""


@dataclass(frozen=True)
class GapCell:
    """A quantity in neighbouring bands: how far flights and simulator are apart there.

    Attributes:
        quantity: Name, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`.
        level_low_fl: Lowest flight level.
        level_high_fl: Highest.
        regime: ``above`` or ``below`` the transition altitude, ``all`` for a quantity of the whole flight.
        distance: Wasserstein distance, in ``unit``.
        floor: The same between flights of one population.
        unit: Of distance, floor and difference.
        difference: Mean of the flights minus that of the simulator's.
        p_value: Chance that any cell without a gap would be called with it, so corrected for how many are looked at.
        share: Share of the whole gap.

    Example:
        >>> GapCell("tas", 150.0, 195.0, "below", 0.02, 0.001, "relative", 0.02, 0.005, 0.4).difference
        0.02
    """

    quantity: str
    level_low_fl: float
    level_high_fl: float
    regime: str
    distance: float
    floor: float
    unit: str
    difference: float
    p_value: float
    share: float


@dataclass(frozen=True)
class BelowRounding:
    """Largest difference of a quantity, of a gap that is more than chance and less than the rounding of one report.

    Attributes:
        quantity: Name, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`.
        level_low_fl: Lowest flight level.
        level_high_fl: Highest.
        difference: Distance beyond the noise floor, in the quantity's unit.
        rounding: Standard uncertainty of one flight's number from the rounding of its reports.

    Example:
        >>> BelowRounding("cas", 150.0, 195.0, difference=0.1, rounding=0.29).share < 0.5
        True
    """

    quantity: str
    level_low_fl: float
    level_high_fl: float
    difference: float
    rounding: float

    @property
    def share(self) -> float:
        """The difference in the uncertainty."""
        return self.difference / self.rounding


@dataclass(frozen=True)
class LargestDifference:
    """The largest difference of means that is left once the causes are in the simulator.

    Example:
        >>> LargestDifference("rate", 315.0, 330.0, difference=-0.02, in_negligible_shifts=2.0).quantity
        'rate'
    """

    quantity: str
    level_low_fl: float
    level_high_fl: float
    difference: float
    in_negligible_shifts: float


@dataclass(frozen=True)
class Remaining:
    """Gap that is left once the causes are in the simulator.

    Attributes:
        gap: Above the noise floor, in spreads between flights.
        share_unexplained: Of what effects and a free discrepancy explain together.
        largest: Where the largest difference is.

    Example:
        >>> largest = LargestDifference("rate", 315.0, 330.0, difference=-0.02, in_negligible_shifts=2.0)
        >>> Remaining(gap=0.01, share_unexplained=0.05, largest=largest).largest.level_low_fl
        315.0
    """

    gap: float
    share_unexplained: float
    largest: LargestDifference


@dataclass(frozen=True)
class WouldSplit:
    """Effects that these data cannot separate, and channels that would; empty where no channel would.

    Example:
        >>> WouldSplit(["mass", "drag_polar"], [], "they look alike in the channels given").channels
        []
    """

    between: list[str]
    channels: list[str]
    why: str


@dataclass(frozen=True)
class Nuisance:
    """Something that a simulator has too little of besides any cause, or below zero too much.

    Attributes:
        quantity: Name, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`.
        size: Difference of the means, in the quantity's unit; of noise the logarithm of the ratio.
        error: Standard error.

    Example:
        >>> Nuisance("noise_rate", 1.1, 0.05).size
        1.1
    """

    quantity: str
    size: float
    error: float


@dataclass(frozen=True)
class MeasuredEntry:
    """One quantity in one band of altitude: distance of both sides there, in spreads between flights.

    Attributes:
        quantity: Name, see :data:`descentflow.measurements.quantity_registry.QUANTITIES`.
        low_fl: Lower edge of the band; of the whole grid for a quantity of the whole flight.
        high_fl: Upper edge.
        spread: Standard deviation between flights, in the quantity's unit.
        distance: Distance of both sides, in spreads.
        floor: Of two samples of one population of these sizes.

    Example:
        >>> MeasuredEntry("tas", 150.0, 165.0, spread=0.004, distance=2.3, floor=0.1).distance
        2.3
    """

    quantity: str
    low_fl: float
    high_fl: float
    spread: float
    distance: float
    floor: float
