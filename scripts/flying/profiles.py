"""Numbers by flight level, as they are given on a command line: `100:-1500,200:-2000`."""

import argparse
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Profile:
    """Values at flight levels; linear between them, held outside."""

    levels_fl: tuple[float, ...]
    values: tuple[float, ...]

    def at(self, level_fl: float) -> float:
        """Value at a level."""
        return float(np.interp(level_fl, self.levels_fl, self.values))

    @classmethod
    def of_text(cls, text: str) -> "Profile":
        """From `level:value,level:value`, levels upwards or not.

        Raises:
            argparse.ArgumentTypeError: If it is not of this form, or a level is given twice.
        """
        try:
            pairs = sorted((float(a), float(b)) for a, b in (part.split(":") for part in text.split(",")))
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{text!r} is not level:value,level:value, as 100:-1500") from error
        levels = tuple(level for level, _ in pairs)
        if len(set(levels)) < len(levels):
            raise argparse.ArgumentTypeError(f"{text!r} gives a level twice")
        return cls(levels, tuple(value for _, value in pairs))
