"""Rows of judgements, and the record of them."""

from dataclasses import dataclass, field

from descentflow.diagnosis.findings.costs_found import Measured
from descentflow.diagnosis.findings.plain_values import NOT_WRITTEN
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.qualification.equivalence import Verdict


@dataclass(frozen=True)
class Row:
    """Judgement of one quantity at some levels, or after some minutes.

    Attributes:
        quantity: See :data:`descentflow.qualification.limits.UNITS`.
        unit: Of the numbers.
        low_fl: Lowest flight level.
        high_fl: Highest one.
        minutes: Time for which a prediction was made; None for others.
        limit: Size of the limit; None where the quantity is measured and not judged.
        flights: Real flights that show it.
        difference: Mean of the real flights minus the simulator's, with its 90 % interval; None of no flight.
        share_inside: Share of the real flights within the limit of the simulator's mean, with its 90 % interval.
        verdict: ``inside``, ``outside``, ``not enough flights`` or ``not judged``.
        more_flights: Further flights that would decide, of further aircraft and days alike; None where it is decided,
            or no such number would.
        decides: What would decide, in words; empty where it is decided.
        by_air: Part of the difference by the air that each flight measured; None where that is not known.
        corrected: The difference once the causes that were found are in the simulator; None where there is none.
        source: Of the limit.

    Example:
        >>> row = Row("rate", "ft/min", 200.0, 210.0, None, 200.0, 80, Measured(50.0, 20.0, 80.0), None, "inside")
        >>> row.verdict
        'inside'
    """

    quantity: str
    unit: str
    low_fl: float
    high_fl: float
    minutes: float | None
    limit: float | None
    flights: int
    difference: Measured | None
    share_inside: Measured | None
    verdict: Verdict
    more_flights: int | None = None
    decides: str = ""
    by_air: float | None = None
    corrected: Measured | None = None
    source: str = ""


@dataclass(frozen=True)
class Record:
    """Judgements of a simulator, and what assurance asks for besides them.

    Attributes:
        verdict: ``inside`` if every row is; ``outside`` if one surely is; else ``not enough flights``; ``not judged``
            without limits.
        limits: Name of the limits.
        source: Where they come from.
        rows: Judgements: airspeed and rate by level from below, each with all levels last; then predictions.
        domain: Where the answer holds: types, levels, days, places, weather.
        independence: Whether the flights that judge were used to make the simulator.
        budget: What makes the numbers unsure, and how much.
        factors: The factors of NASA-STD-7009 (2008), and where the evidence of each stands.
        gap: Diagnosis of the same flights.

    Example:
        >>> from descentflow.qualification.qualify import qualify
        >>> isinstance(qualify("descents.parquet", "A320"), Record)
        True
    """

    verdict: Verdict
    limits: str
    source: str
    rows: list[Row]
    domain: dict[str, str]
    independence: str
    budget: dict[str, str]
    factors: dict[str, str]
    gap: GapReport = field(metadata=NOT_WRITTEN)
