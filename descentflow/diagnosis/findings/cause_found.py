"""A cause that is named: its size with intervals, and how much of the gap it closes."""

from dataclasses import dataclass, field

from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.plain_values import number, percent


@dataclass(frozen=True)
class ClosedShare:
    """Share of the gap that the causes close, with its 90 % interval; None where it cannot be said.

    Example:
        >>> print(ClosedShare(0.78, 0.75, 0.81))
        78 % (75 % to 81 %)
    """

    estimate: float | None
    low: float | None
    high: float | None

    def __str__(self) -> str:
        """For readers."""
        if self.low is None:
            return percent(self.estimate)
        return f"{percent(self.estimate)} ({percent(self.low)} to {percent(self.high)})"


@dataclass(frozen=True)
class Closure:
    """Share of the gap that all causes together close, measured on the simulator's flights with the causes in them.

    Example:
        >>> print(Closure(ClosedShare(0.8, 0.7, 0.9)).marginal)
        80 % (70 % to 90 %)
    """

    marginal: ClosedShare


@dataclass(frozen=True)
class ParameterEstimate(Measured):
    """One parameter with its 90 % interval, within its physical bounds; no interval where none is claimed.

    Example:
        >>> print(ParameterEstimate(10.13, 9.88, 10.4, "K", "deviation from the standard atmosphere"))
        deviation from the standard atmosphere 10.1 (9.88 to 10.4) K
    """

    unit: str = "1"
    label: str = ""

    @property
    def interval(self) -> str:
        """The 90 % interval in brackets, after a space; nothing where none is claimed."""
        return f" ({' to '.join(map(number, self.ends))})" if self.ends else ""

    @property
    def unit_text(self) -> str:
        """The unit after a space; nothing for a plain number."""
        return "" if self.unit == "1" else f" {self.unit}"

    def __str__(self) -> str:
        """For readers."""
        return f"{self.label} {number(self.estimate)}{self.interval}{self.unit_text}".strip()


@dataclass(frozen=True)
class ReportedSize:
    """A size of the effect as reported: in an aviation unit, of the flights that have the effect.

    Attributes:
        parameter: Name of the parameter.
        text: In words, with the 90 % interval.
        unit: Of ``value``: an aviation unit, ``factor`` or ``%``.
        value: The number.

    Example:
        >>> size = ReportedSize("extra_cd0", "CD0 x 1.58 (1.52 to 1.65)", "factor", Measured(1.58))
        >>> size.value.estimate
        1.58
    """

    parameter: str
    text: str
    unit: str
    value: Measured


@dataclass(frozen=True)
class OnBothSides:
    """Size of an effect on either side: sizes are differences of the two, or for a noise their ratio.

    Attributes:
        parameter: Name of the parameter.
        unit: Of both numbers.
        flights: What the real flights have.
        simulator: What the simulator's flights have (of a checkpoint, those it was trained on).

    Example:
        >>> OnBothSides("deviation_k", "K", flights=9.9, simulator=5.1).unit
        'K'
    """

    parameter: str
    unit: str
    flights: float
    simulator: float


@dataclass(frozen=True)
class Alternative:
    """An effect that may stand in the place of a cause, with the sizes that it then has.

    Attributes:
        effect: Its name in the catalogue.
        probability: Probability that it is among the causes.
        sizes: In aviation units, of the flights that have it, besides the other causes.
        share_of_flights: Share of the flights that have it; None where all have.

    Example:
        >>> Alternative("mass", 0.2, [ReportedSize("relative_change", "mass x 0.93", "factor", Measured(0.93))]).effect
        'mass'
    """

    effect: str
    probability: float
    sizes: list[ReportedSize] = field(default_factory=list)
    share_of_flights: ClosedShare | None = None


@dataclass(frozen=True)
class Cause:
    """An effect that is named.

    Attributes:
        effect: Its name in the catalogue.
        group: Effects that these data cannot tell from it.
        probability: Probability that it itself is among the causes.
        parameters: Estimates by name.
        evidence_nats: What its presence gains in the logarithm of the evidence.
        closure: How much of the gap all causes together close.
        inherited: Whether the simulator's own flights have it as well.
        label: Its name for readers.
        text: What it is in words, with the direction that was found.
        inclusion: Probability that it, or an effect that stands in its place, is among them; None where not computed.
        share_of_flights: Share of the flights that have it; None where all have.
        sizes: What ``parameters`` are in aviation units, of the flights that have the effect: real flights against
            the simulator's, so what to add to what it has.
        on_both_sides: What either side has by itself, where broadcast values measure it (temperature by TAS and Mach
            number, wind by groundspeed and TAS, noise).
        takes_away: By cost (``time``, ``rate``, ...) over all levels: the part of the difference, flights minus
            simulator, that goes once the simulator has this cause besides the others; in the cost's unit.
        alternatives: The effects of ``group`` with their sizes.
        of_air: Whether it is of the air that flights met, and not of the simulator's aircraft or crews.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> print(report.causes[0])
        mass: relative change of the mass -0.0... (-0.1... to -0.0...)
        >>> print("closed:", report.causes[0].closure.marginal)
        closed: ... % (... % to ... %)
    """

    effect: str
    group: list[str]
    probability: float
    parameters: dict[str, ParameterEstimate]
    evidence_nats: float
    closure: Closure
    inherited: bool = False
    label: str = ""
    text: str = ""
    inclusion: float | None = None
    share_of_flights: ClosedShare | None = None
    sizes: list[ReportedSize] = field(default_factory=list)
    on_both_sides: list[OnBothSides] = field(default_factory=list)
    takes_away: dict[str, float] = field(default_factory=dict)
    alternatives: list[Alternative] = field(default_factory=list)
    of_air: bool = False

    @property
    def meets_still_air(self) -> bool:
        """True if it is of the air, and the simulator's own flights have none of it: theirs is standard and calm.

        Example:
            >>> air = OnBothSides("deviation_k", "K", flights=9.9, simulator=0.0)
            >>> Cause("temperature", [], 1.0, {}, 9.0, Closure(ClosedShare(None, None, None)), of_air=True,
            ...       on_both_sides=[air]).meets_still_air
            True
        """
        return self.of_air and all(round(side.simulator, 1) == 0.0 for side in self.on_both_sides)

    def in_flights(self) -> str:
        """Flights that have it; empty where all have."""
        share = self.share_of_flights
        if share is None:
            return ""
        if percent(share.estimate) == percent(1.0):
            return "in nearly all flights"
        return f"in {percent(share.estimate)} of the flights"

    def __str__(self) -> str:
        """Its name and its size."""
        return f"{self.label or self.effect}: {'; '.join(str(p) for p in self.parameters.values())}"
