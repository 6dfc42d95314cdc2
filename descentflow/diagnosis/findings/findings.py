"""All that a diagnosis finds, as typed objects."""

from dataclasses import dataclass, field
from typing import Literal

from descentflow.diagnosis.findings.cause_found import Cause
from descentflow.diagnosis.findings.correction_found import Corrections, Previous, RecipeStep
from descentflow.diagnosis.findings.costs_found import Cost, LevelMeans
from descentflow.diagnosis.findings.gap_found import (
    BelowRounding,
    GapCell,
    MeasuredEntry,
    Nuisance,
    Remaining,
    WouldSplit,
)
from descentflow.diagnosis.findings.inputs_found import FlightWorthALook, LeftOutChannel, Provenance
from descentflow.diagnosis.findings.plain_values import NOT_WRITTEN

SEEN = "flights_that_the_simulator_has_seen"
"""Among the counts: real flights that the simulator was trained or validated on, which are compared as the others are.
"""
Verdict = Literal["none", "effect", "partial", "unknown"]
"""``none``: no gap, or none that matters; ``effect``: a gap with named causes; ``partial``: the named causes are real,
and what they leave is still a gap, of no named cause; ``unknown``: a gap of no named cause."""


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


@dataclass(frozen=True)
class Discrepancy:
    """Evidence of an unknown cause beyond the named effects.

    Attributes:
        explained: Nats of evidence that the named effects gain.
        rest: Nats that an unknown cause gains besides them.
        probability: Of an unknown cause.

    Example:
        >>> from descentflow.diagnosis.findings.plain_values import primitives
        >>> list(primitives(Discrepancy(300.0, 12.0, 0.04)))[:2]
        ['explained_nats', 'rest_nats']
    """

    explained: float = field(metadata={"json": "explained_nats"})
    rest: float = field(metadata={"json": "rest_nats"})
    probability: float

    @property
    def named(self) -> bool:
        """True if there is probably one."""
        return self.probability > 0.5


@dataclass(frozen=True)
class SingleEffect:
    """An effect of the catalogue alone: its gain in evidence (nats) over no effect, and the parameters.

    ``refused`` is the reason not to name it with these parameters; empty where it can.

    Example:
        >>> SingleEffect("drag_polar", gain_nats=210.0, parameters={"relative_change": 0.12}).gain_nats
        210.0
    """

    effect: str
    gain_nats: float
    parameters: dict[str, float]
    refused: str = ""


@dataclass(frozen=True)
class Curve:
    """Mean difference of one quantity by band, before and after the causes are added, with its standard error.

    ``level_fl`` is None for a quantity of the whole flight.

    Example:
        >>> Curve([157.5, 172.5], before=[0.05, 0.03], after=[0.0, 0.01], error=[0.01, 0.01]).after
        [0.0, 0.01]
    """

    level_fl: list[float | None]
    before: list[float]
    after: list[float]
    error: list[float]


FEW = "flights_short_of_all_causes"
"""Count of flights that a side lacks for all causes to be sought."""


@dataclass(frozen=True)
class Details:
    """Details for figures and careful readers besides the answer.

    Attributes:
        simulator: Its name.
        regime: ``anchored``: against the simulator's own flights or physics; ``refit``: they have the causes as well.
        typecode: Aircraft type.
        normal_from: Where the simulator's side comes from: ``training flights``, ``simulator flights`` or ``physics``.
        seed: Of permutations, folds, bootstrap and samples.
        quantities: Names of what is compared.
        transition_fl: Flight level at which nominal BADA hands over from Mach to CAS.
        mass_kg: Mass at which sensitivities are taken.
        n_permutations: Behind the p-value.
        discrepancy: What the named effects leave.
        singles: Every effect alone, best first.
        curves: By quantity.
        labels: Effect -> its name for readers.
        subsets: The best sets of effects, heaviest first.
        detection_limits: Of each effect, the smallest size that would be named in 80 of 100 cases.
        profile: What the simulator flies on average by level.
        measured_over: What the gap was measured over, for the next round.
        gap_error: Standard error of the gap before the causes, in spreads.
        lacks: What the simulator's flights lack besides any cause: noise of reports, level-offs.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> report.details.normal_from, report.details.label("mass")
        ('physics', 'mass')
    """

    simulator: str
    regime: str
    typecode: str
    normal_from: str
    seed: int
    quantities: list[str]
    transition_fl: float
    mass_kg: float
    n_permutations: int
    discrepancy: Discrepancy
    singles: list[SingleEffect] = field(metadata={"json": "contest"})
    curves: dict[str, Curve]
    labels: dict[str, str] = field(default_factory=dict)
    subsets: list[Subset] = field(default_factory=list)
    detection_limits: list[DetectionLimit] = field(default_factory=list)
    profile: list[LevelMeans] = field(default_factory=list)
    measured_over: list[MeasuredEntry] = field(default_factory=list)
    gap_error: float | None = None
    lacks: list[Nuisance] = field(default_factory=list)

    def label(self, effect: str) -> str:
        """Name of an effect of the catalogue for readers; ``unknown`` is the one outside it."""
        return self.labels.get(effect, effect.replace("_", " "))


@dataclass(frozen=True)
class Findings:
    """All that a diagnosis found; :class:`descentflow.diagnosis.report.gap_report.GapReport` prints and writes it.

    Attributes:
        verdict: See :data:`Verdict`.
        p_value: Probability of a gap as large as this between flights of one population.
        floor: Gap that two samples of one population of these sizes show.
        gap_before: Gap between simulator and flights (mean over the affected quantities of the Wasserstein distance in
            standard deviations between flights).
        where: Cells, largest share first.
        causes: Effects, the one that takes most of the time away first.
        gap_after: Gap once the causes are in the simulator.
        remaining: What is left, and where.
        would_split: Channels or slices that would separate what these data cannot.
        dropped: Counts of flights and rows left out, by reason; and of flights that the simulator has seen.
        details: Everything else: settings, every effect alone, curves behind the figures.
        costs: What the gap costs, the whole range of levels first, then parts of it.
        recipe: What to change in the simulator, cause by cause.
        left_out_channels: Channels that one side lacks.
        flights_worth_a_look: Those with most of what no named cause explains, largest first.
        previous: The round before, where one was given.
        provenance: What went in; without names where it is not known.
        corrected_file: Name of the corrected simulator next to `gap.json`; empty where there is none.
        corrections: By file: writes the checkpoint with the causes in it, or prepared descents with them.
        below_rounding: Of a gap that is more than chance and yet less than the rounding of one report, the largest
            difference of each quantity; empty of any other.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]})
        >>> isinstance(report, Findings), report.verdict, report.gap_after < report.gap_before
        (True, 'effect', True)
    """

    verdict: Verdict
    p_value: float
    floor: float
    gap_before: float
    where: list[GapCell]
    causes: list[Cause]
    gap_after: float
    remaining: Remaining
    would_split: list[WouldSplit]
    dropped: dict[str, int]
    details: Details
    costs: list[Cost] = field(default_factory=list)
    recipe: list[RecipeStep] = field(default_factory=list)
    left_out_channels: list[LeftOutChannel] = field(default_factory=list)
    flights_worth_a_look: list[FlightWorthALook] = field(default_factory=list)
    previous: Previous | None = None
    provenance: Provenance = field(default_factory=Provenance)
    corrected_file: str = ""
    below_rounding: list[BelowRounding] = field(default_factory=list)
    corrections: Corrections = field(default_factory=dict, compare=False, metadata=NOT_WRITTEN)

    @property
    def is_few(self) -> bool:
        """True if a side had too few flights for all causes to be sought; they are counted in ``dropped``.

        Example:
            >>> from descentflow.diagnosis.diagnose import diagnose
            >>> from descentflow.effects import EFFECTS
            >>> diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}).is_few
            False
        """
        return bool(self.dropped.get(FEW, 0))

    @property
    def is_small(self) -> bool:
        """True if there is a gap that is more than chance and does not matter.

        Example:
            >>> from descentflow.diagnosis.diagnose import diagnose
            >>> from descentflow.effects import EFFECTS
            >>> diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}).is_small
            False
        """
        return self.verdict == "none" and bool(self.below_rounding)
