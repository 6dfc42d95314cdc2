"""What a comparison of times found: printed, as a table, and as primitives."""

from dataclasses import asdict, dataclass
from typing import Any

import polars as pl

from descentflow.diagnosis.level_times.leg_statistics import LegDifference
from descentflow.reporting.number_text import number

SIGNIFICANT = 0.02
"""Called a difference up to this p-value, as a diagnosis of whole flights does: in 2 of 100 comparisons without one."""
LACKING = (
    "airspeeds (IAS, Mach, TAS) and groundspeed: no score of CAS, and no telling a slower flight from one that "
    "descends at another rate at the same speed",
    "reported vertical rates: no lag of the altimeter, and no noise of any channel",
    "addresses of aircraft: flights of one aircraft count as independent, and those that a model was trained on are "
    "not recognised",
    "what lies between two points: a level-off or a held rate that is shorter than a pair of points is not seen",
)
"""What points of flight profiles do not have, and what that keeps from being told."""
ORIGIN = (
    "A filed profile (m1, ftfm) is computed by the network manager's own model of aircraft performance; a current one "
    "(m3, ctfm) is that, recomputed where surveillance departed from it by much. A small difference may be its own."
)
"""Whose the times are."""


@dataclass(frozen=True, repr=False)
class TimesFound:
    """Seconds between flight levels, flights against a simulator.

    Attributes:
        simulator: Its name.
        flights: What the flights are, in words.
        legs: Each leg that both sides show.
        left_out: Legs that were not compared, and why.
        alike: Labels of effects that change times and that times alone cannot tell apart.
        seed: Of the labellings.

    Example:
        >>> leg = LegDifference("FL200 to FL150", 40, 1000, 161.0, 155.0, 6.0, 2.0, 9.5, 6.5, 3.1, 0.004)
        >>> print(TimesFound("best.ckpt", "40 flights of A320", (leg,)))
        40 flights of A320 take other times than best.ckpt between flight levels (p-value 0.004).
        ...
    """

    simulator: str
    flights: str
    legs: tuple[LegDifference, ...]
    left_out: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    seed: int = 0

    @property
    def p_value(self) -> float:
        """That differences as large arise by chance on any leg."""
        return min(leg.p_value for leg in self.legs)

    @property
    def differs(self) -> bool:
        """Whether they do not arise by chance."""
        return self.p_value <= SIGNIFICANT

    @property
    def answer(self) -> str:
        """One sentence."""
        what = "take other times than" if self.differs else "cannot be told from"
        where = "between flight levels" if self.differs else "by their times between flight levels"
        return f"{self.flights} {what} {self.simulator} {where} (p-value {self.p_value:.2g})."

    @property
    def unresolved(self) -> str:
        """What cannot be told apart."""
        if not self.alike:
            return ""
        names = ", ".join(self.alike)
        return f"No cause is named: each of these changes times, and times alone do not tell them apart: {names}."

    def to_polars(self) -> pl.DataFrame:
        """A row for each leg, columns as the fields of :class:`~.leg_statistics.LegDifference`."""
        return pl.DataFrame([asdict(leg) for leg in self.legs]).fill_nan(None)

    def as_dict(self) -> dict[str, Any]:
        """Primitives for `level_times.json`."""
        return {
            "simulator": self.simulator,
            "flights": self.flights,
            "p_value": self.p_value,
            "differs": self.differs,
            "legs": self.to_polars().to_dicts(),
            "left_out": list(self.left_out),
            "lacking": list(LACKING),
            "origin": ORIGIN,
            "cannot_be_told_apart": list(self.alike),
            "seed": self.seed,
        }

    def __str__(self) -> str:
        """The answer, a line a leg, and what these data lack."""
        lines = [self.answer, f"{'leg':<16}{'flights':>9}{'simulator':>11}{'difference':>12}  90 % interval (s)"]
        for leg in self.legs:
            means = f"{number(leg.mean_real_s):>7} s{number(leg.mean_simulated_s):>9} s"
            lines.append(f"{leg.leg:<16}{means}{leg.difference_s:>+10.1f} s  {leg.low_s:+.1f} to {leg.high_s:+.1f}")
        lines += [*self.left_out, "These flights lack:", *(f"  {text}" for text in LACKING), ORIGIN]
        return "\n".join([*lines, *filter(None, [self.unresolved])])

    __repr__ = __str__
