"""How the values of one column are read: in which unit, and as which quantity."""

from dataclasses import dataclass

OFF_COST = 6.0
"""A column that no unit explains counts as much as so many that are in another unit."""


@dataclass(frozen=True)
class Reading:
    """How the values of a column are read.

    Attributes:
        words: What a message says of it; empty for the expected unit.
        factor: To the expected unit.
        meaning: The quantity that it is instead, `TAS` or `IAS`, or `unsigned`; empty for the one that it should be.
        off: Whether no unit is assumed: the column is left out of all comparisons.

    Example:
        >>> Reading("in km/h", 0.5).factor * 500
        250.0
    """

    words: str
    factor: float = 1.0
    meaning: str = ""
    off: bool = False

    @property
    def cost(self) -> float:
        """What it counts among the changes that make columns agree."""
        return OFF_COST if self.off else float(bool(self.words))


AS_GIVEN, OFF = Reading(""), Reading("wrong", off=True)
