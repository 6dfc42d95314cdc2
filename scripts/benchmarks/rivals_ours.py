"""descentflow's own answer, beside the rivals'."""

from benchmarks.rivals_scoring import Answer
from benchmarks.rivals_sets import RivalSet
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.report.gap_report import GapReport


def answer(one: RivalSet, seed: int) -> Answer:
    """Answer of `diagnose` for the set's flights against the simulator's flights."""
    report = diagnose(one.folder / "real.parquet", one.folder / "simulator.parquet", typecode=one.typecode, seed=seed)
    return of_report(report)


def of_report(report: GapReport) -> Answer:
    """The answer of a report."""
    named = tuple(frozenset({cause.effect}) for cause in report.causes)
    return Answer(named, gap=report.verdict != "none", unknown=report.verdict in ("unknown", "partial"))
