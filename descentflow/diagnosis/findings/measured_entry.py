"""Entries over which a gap was measured, so that the next round can measure over the same."""

from dataclasses import dataclass


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
