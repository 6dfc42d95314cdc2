"""The number in which a time or a distance at a level is nearly linear in what is drawn."""

from dataclasses import dataclass

import numpy as np

from descentflow.generation.conditional.flown_profiles import Array


@dataclass(frozen=True)
class Measure:
    """Transform T of a time or a distance: its reciprocal, or minus its logarithm. Both fall as it grows.

    Example:
        >>> ten = np.array([10.0])
        >>> Measure(logarithm=False).of(ten), Measure(logarithm=True).back(Measure(logarithm=True).of(ten)).round(9)
        (array([0.1]), array([10.]))
    """

    logarithm: bool

    def of(self, value: Array) -> Array:
        """T of values."""
        found: Array = -np.log(value) if self.logarithm else 1 / value
        return found

    def back(self, measured: Array) -> Array:
        """Values of T."""
        found: Array = np.exp(-measured) if self.logarithm else 1 / measured
        return found

    def slope(self, measured: Array) -> Array:
        """Fall of T with the value, at T."""
        found: Array = np.exp(measured) if self.logarithm else measured**2
        return found

    def share(self, measured: Array) -> Array:
        """Change of T where the value changes by as much as it is."""
        return np.ones_like(measured) if self.logarithm else measured
