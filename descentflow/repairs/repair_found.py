"""A repaired type: its estimates, its files' coefficients before and after, and its errors on aircraft not used."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from descentflow.repairs.held_out import HeldOut
from descentflow.repairs.mixed_model import MixedModelPosterior
from descentflow.repairs.type_fit import Repairable

FACTORS = ("parasitic", "induced", "idle")
"""Factors of drag and thrust in the order of the estimates."""
SPEEDS = {"des_mach": 2, "des_cas_high_kt": 0, "des_cas_low_kt": 0}
"""Speed of the schedule -> decimals of an APF file."""


@dataclass(frozen=True)
class CoefficientEstimate:
    """One coefficient: the file's value, the repaired one and its 90 % interval.

    Example:
        >>> CoefficientEstimate("cd0_cr", 0.0175, 0.0182, 0.0171, 0.0194, "flights").name
        'cd0_cr'
    """

    name: str
    before: float
    after: float
    low: float
    high: float
    source: str
    aircraft: int = 0
    """Aircraft that show a speed; 0 for what all flights tell together."""


@dataclass(frozen=True)
class Repair:
    """A repaired aircraft, and how it was found.

    Attributes:
        before: Coefficients as they were.
        after: Coefficients as they are written; the same as before where flights do not predict others better.
        estimates: What was estimated, coefficient by coefficient.
        held_out: Errors on aircraft that were not used.
        posterior: Of the mixed model; the type's own numbers are the first.
        flights: Number of flights by type: its own, then those of sisters that were used.
        counts: What was left out or set apart, by reason.
        levels_fl: Lowest and highest level of the flights.
        last_day: Of the flights, as BADA's files have dates (``Mar 08 2024``).
        own: The licence holder's file that was repaired; None for an open type.

    Example:
        >>> from descentflow.repairs.repair import repair
        >>> repaired = repair("descents.parquet", aircraft="A320")
        >>> repaired.changed, [one.name for one in repaired.estimates][:2]
        (True, ['cd0_cr', 'cd2_cr'])
    """

    before: Repairable
    after: Repairable
    estimates: tuple[CoefficientEstimate, ...]
    held_out: HeldOut
    posterior: MixedModelPosterior
    flights: Mapping[str, int]
    counts: Mapping[str, float]
    levels_fl: tuple[float, float]
    last_day: str
    own: Path | None = None

    @property
    def what_stays(self) -> str:
        """Coefficients that flights in free descent do not tell, and the levels seen."""
        low, high = self.levels_fl
        return (
            f"Mass, thrust and drag scale together without a trace: all numbers hold at the reference mass. Polars "
            f"with flaps, approach and landing thrust, climb thrust and fuel are as they were. Thrust above idle that "
            f"flights have alike passes for less drag. Flights were seen from FL{low:.0f} to FL{high:.0f}."
        )

    @property
    def changed(self) -> bool:
        """True if other aircraft are predicted better; the coefficients stay as they were if not."""
        return self.held_out.better

    def __str__(self) -> str:
        """Estimates and errors in a few lines."""
        score = self.held_out
        head = (
            f"{self.before.typecode}: {score.flights:,} flights of {score.aircraft:,} aircraft"
            f"{'' if self.changed else '; the file stays, for other aircraft are predicted no better'}"
        )
        lines = [
            f"  {one.name:<16}{one.before:>10.4g} -> {one.after:<10.4g} 90 %: {one.low:.4g} to {one.high:.4g}"
            for one in self.estimates
        ]
        time = (
            f"  time at the flights' own speeds, aircraft not used: {score.time.before:+.1f} % before, "
            f"{score.time.after:+.1f} % {'after' if self.changed else 'by these'} "
            f"(90 %: {score.time.low:+.1f} to {score.time.high:+.1f}; "
            f"chance {score.time.floor:.1f}); of single flights {score.absolute[0]:.1f} % and {score.absolute[1]:.1f} %"
        )
        gauge = f"  at the reference mass, {float(self.before.mass_reference_kg):,.0f} kg: flights do not tell the mass"
        return "\n".join([head, *lines, time, gauge])
