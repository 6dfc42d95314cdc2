"""Actions for the owner of a simulator: the recipe, and the round before."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from descentflow.diagnosis.findings.cause_found import ClosedShare
from descentflow.diagnosis.findings.costs_found import Measured

CHECKPOINT, FLIGHTS = "corrected.ckpt", "corrected.parquet"
"""Names of the corrected simulator next to `gap.json`: a checkpoint, and flights with the causes in them."""
Corrections = Mapping[str, Callable[[Path], None]]
"""Name of a file of the corrected simulator -> what writes it to a path."""


@dataclass(frozen=True)
class RecipeNumber:
    """One number to enter into a simulator, with its 90 % interval, for a range of levels.

    Example:
        >>> RecipeNumber("deviation from the standard atmosphere", "K", Measured(7.2, 6.8, 7.6)).unit
        'K'
    """

    label: str
    unit: str
    value: Measured
    low_fl: float | None = None
    high_fl: float | None = None


@dataclass(frozen=True)
class RecipeStep:
    """Change to make in the simulator for one cause.

    Attributes:
        effect: The cause.
        text: In words, physical units and levels: ``ISA + 7.2 K [6.8, 7.6]``.
        numbers: The same for programs.
        share_of_flights: Share of the flights that have it (1 is all).

    Example:
        >>> step = RecipeStep("temperature", "ISA + 7.2 K [6.8, 7.6]", [RecipeNumber("deviation", "K", Measured(7.2))])
        >>> step.share_of_flights
        1.0
    """

    effect: str
    text: str
    numbers: list[RecipeNumber] = field(default_factory=list)
    share_of_flights: float = 1.0


@dataclass(frozen=True)
class Previous:
    """The diagnosis before the owner changed the simulator, compared with this one.

    Attributes:
        report: Its `gap.json`.
        causes: What it named.
        predicted: Closure that it predicted.
        achieved: Closure that the changed simulator reached.
        gap_before: Gap then, in spreads between flights, over what both diagnoses measure.
        gap_now: Gap now, over the same.

    Example:
        >>> predicted, achieved = ClosedShare(0.9, 0.85, 0.95), ClosedShare(0.88, 0.8, 0.94)
        >>> Previous("gap/gap.json", ["temperature"], predicted, achieved, 0.6, 0.1).causes
        ['temperature']
    """

    report: str
    causes: list[str]
    predicted: ClosedShare
    achieved: ClosedShare
    gap_before: float | None = None
    gap_now: float | None = None

    @property
    def judged(self) -> str:
        """``less`` or ``more`` than predicted, or ``as`` predicted; empty where either is not known.

        Example:
            >>> predicted, achieved = ClosedShare(0.9, 0.85, 0.95), ClosedShare(0.7, 0.65, 0.75)
            >>> Previous("gap/gap.json", ["temperature"], predicted, achieved).judged
            'less'
        """
        p, a = self.predicted, self.achieved
        if p.low is None or p.high is None or a.low is None or a.high is None:
            return ""
        return "less" if a.high < p.low else "more" if a.low > p.high else "as"
