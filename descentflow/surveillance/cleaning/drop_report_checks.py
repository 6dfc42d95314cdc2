"""Checks of the whole drop report: types that are absent, columns that contradict each other, and nothing left."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict

import polars as pl

from descentflow.core.errors import CleaningError, warn
from descentflow.core.files import table_beside
from descentflow.surveillance.cleaning._flights import FLIGHTS_OF_SEVERAL_TYPES, NO_TYPES, OTHER_VALUES
from descentflow.surveillance.cleaning._two_clocks import ROWS_OF_OTHER_CLOCK
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows._placeholder_values import TAKEN_FOR_MISSING
from descentflow.surveillance.rows._values_of_other_rows import JOIN_MEND, OF_OTHER_ROWS, VALUES_APART
from descentflow.surveillance.rows.drop_report import DropReport, Step
from descentflow.surveillance.rows.schema import AIRSPEEDS, COLUMNS, POSSIBLE, ROWS_WITHOUT

MAX_LISTED_TYPES = 12
MAX_CONTRADICTING_SHARE = 0.5
"""Share of rows whose IAS contradicts Mach, above which the column is wrong, not its rows; real ones have 0.001."""
NONE_OF = "types asked for besides others, of which there is no row: "
"""Note in the report."""
ADVICE = {
    OTHER_VALUES: "give rows of another run or another receiver addresses (icao24) or times of their own; the first of "
    "each was kept",
    FLIGHTS_OF_SEVERAL_TYPES: "correct the column typecode, or give rows of different aircraft different icao24",
    **{VALUES_APART.format(name=name): JOIN_MEND.format(name=name) for name in OF_OTHER_ROWS},
}
"""Note -> advice of its warning."""


def tell_absent_types(wanted: Sequence[str], present: Iterable[str], what: str, option: str) -> None:
    """Warn of types that were asked for besides others, and of which there is none."""
    known = sorted(name for name in present if name)
    if absent := asked_in_vain(wanted, known):
        there = ", ".join(known[:MAX_LISTED_TYPES]) + (", ..." if len(known) > MAX_LISTED_TYPES else "")
        warn(
            f"no {what} of type {', '.join(absent)}, which {option} asks for besides others; there are {there}: "
            "designators of ICAO Doc 8643 are taken, as B738; to mend it, correct it or leave it out"
        )


def asked_in_vain(wanted: Sequence[str], present: Iterable[str]) -> list[str]:
    """Types that were asked for and that there are none of."""
    known = set(present)
    return [name.upper() for name in wanted if name.upper() not in known]


def check_report(report: DropReport, rules: Cleaning) -> None:
    """Refuse rows of which most contradict themselves; warn of notes for which there is advice."""
    step = next((step for step in report.steps if step.step == "IAS_contradicts_Mach"), None)
    judged = step.rows_dropped + step.rows_left if step else 0
    if step and step.rows_dropped > MAX_CONTRADICTING_SHARE * judged:
        raise CleaningError(
            f"IAS contradicts Mach and altitude by {rules.airspeeds_differ_kt:g} kt or more in {step.rows_dropped:,} "
            f"of {judged:,} rows",
            expected="indicated airspeed in kt, Mach and pressure altitude in ft of the same aircraft and time",
            mend="check that IAS is the indicated airspeed (not TAS or groundspeed) and that both are of one time; "
            "leave Mach out of the table if IAS is right, or say how far they may differ (--airspeeds-differ-kt)\n"
            f"{report}",
        )
    if clocks := [note for note in report.notes if note.startswith(ROWS_OF_OTHER_CLOCK.partition("{")[0])]:
        said = " and ".join(f"{report.notes[note]:,} {note}" for note in clocks)
        warn(f"{said}, are left out: write the times of all sources in UTC (the earlier of both are kept)")
    for note in report.notes:
        if note.endswith(TAKEN_FOR_MISSING):
            warn(f"{report.notes[note]:,} {note}; to mend it, leave these cells of the source empty")
    for note in ADVICE if report.steps and report.steps[-1].rows_left else ():
        if number := report.notes.get(note):
            warn(f"{number:,} {note}; to mend it, {ADVICE[note]}")


def check_left(
    report: DropReport,
    wanted: Sequence[str],
    present: Mapping[str, int],
    types: pl.DataFrame | None = None,
    untyped: Mapping[str, int] | None = None,
) -> None:
    """Refuse rows of which none is left before cleaning, and say why."""
    if not report.left("duplicate"):
        return
    if not report.left("unknown_type") and types is not None and untyped:
        raise _no_address_named(types, untyped)
    if not report.left("unknown_type"):
        raise CleaningError(
            f"rows without any typecode ({', '.join(NO_TYPES[:2])} and the like are none)",
            expected="a column typecode, or a types table",
            mend="add a column typecode, or give `descentflow prepare` a table of columns icao24,typecode "
            "(--types TABLE.csv); --typecode gives rows no type, it only selects among those that they have",
        )
    if wanted and not report.left("other_type"):
        often = sorted(present, key=lambda name: (-present[name], name))[:12]
        raise CleaningError(
            f"no row of type {', '.join(wanted)}", expected=f"one of {', '.join(often)}", mend="change --typecode"
        )


def _no_address_named(types: pl.DataFrame, untyped: Mapping[str, int]) -> CleaningError:
    """The error where a table of types and the rows have no address in common, with what each of them has."""
    listed = types["icao24"].drop_nulls().unique().sort()
    shared = sum(address in untyped for address in listed)
    busiest = sorted(untyped, key=lambda address: (-untyped[address], address))[:5]
    often = ", ".join(f"{address} ({untyped[address]:,} rows)" for address in busiest)
    blank = ", without a type" if shared else ""
    return CleaningError(
        f"a types table that names the type of no row: {shared:,} of its {len(listed):,} addresses "
        f"({', '.join(listed[:3])}) are among the {len(untyped):,} of the {sum(untyped.values()):,} rows{blank}",
        expected=f"lines icao24,typecode with addresses of the rows, the busiest of which are {often}",
        mend="check that icao24 holds the 24-bit address as the rows have it, and typecode a type such as A320",
    )


REASONS = {step: (reason["rows"], reason["mend"]) for step, reason in table_beside(__file__).items()}
"""Step of cleaning, or the beginning of its name, -> what its rows have in common, and what to do about it."""


def nothing_left(report: DropReport, cleaning: Cleaning) -> CleaningError:
    """The error to raise if cleaning left no descent."""
    read = report.steps[0].rows_left + report.steps[0].rows_dropped if report.steps else 0
    if not read:
        nothing = f"no row in what was given\n{report}"
        return CleaningError(nothing, expected="surveillance rows", mend="pass other files")
    most = max(report.steps, key=lambda step: step.rows_dropped, default=Step("read", 0, None, 0, None))
    why, mend = _reason(most.step, cleaning)
    lacking = {name: number for name in COLUMNS if (number := report.notes.get(ROWS_WITHOUT + name))}
    if lacking and most.step == "missing_value":
        why = f"lack a value ({', '.join(f'{name} in {number:,}' for name, number in lacking.items())})"
        mend = _mend_of_missing(report, lacking, read) or mend
    return CleaningError(
        f"no free descent is left: {most.rows_dropped:,} of {read:,} rows {why} ({most.step})",
        expected=f"descents of airliners over {cleaning.fewest_levels} levels above FL{cleaning.bottom_fl}, with IAS, "
        "Mach and altitude",
        mend=f"{mend}\n{report}",
    )


def _mend_of_missing(report: DropReport, lacking: Mapping[str, int], read: int) -> str | None:
    """Advice on the column that is empty, where it is not airspeed; None if it is."""
    if VALUES_APART.format(name="altitude") in report.notes:
        return JOIN_MEND.format(name="altitude")
    empty = [name for name, number in lacking.items() if number == read and name not in AIRSPEEDS]
    return f"fill the column {empty[0]}, which is empty in every row" if empty else None


def _reason(step: str, cleaning: Cleaning) -> tuple[str, str]:
    column = step.removeprefix("impossible_")
    if step != column and column in POSSIBLE:
        low, high = POSSIBLE[column]
        return f"hold a value of {column} outside {low:g} to {high:g}", REASONS["impossible_"][1]
    for name, (why, mend) in REASONS.items():
        if step == name or (name.endswith("_") and step.startswith(name)):
            return why.format(**asdict(cleaning)), mend
    return "were dropped", "see what that step asks for in configs/prepare/default.yaml"
