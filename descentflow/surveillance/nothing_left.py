"""The error when cleaning leaves no descent: first what took most rows and its mend, then every step."""

from dataclasses import asdict

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.drop_report import DropReport, Step
from descentflow.surveillance.rows.schema import POSSIBLE, REQUIRED, WITHOUT
from descentflow.surveillance.rows.values_beside import APART, JOIN

REASONS: dict[str, tuple[str, str]] = {
    "missing_value": (
        "lack a time, an address, an altitude, IAS or Mach",
        "see which column is empty; IAS and Mach come with Mode S enhanced surveillance (BDS 6,0), not with ADS-B; "
        "a table that has no column Mach gets it from IAS and altitude",
    ),
    "impossible_": (
        "hold a value that no airliner has",
        "check the unit of that column: altitude in ft, IAS in kt, Mach as 0.78, vertical_rate in ft/min",
    ),
    "duplicate": (
        "have the address and the time of another row",
        "check that rows of different aircraft have different icao24, and that each row has its own time",
    ),
    "other_clock": ("come again by another clock", "write the times of all sources in UTC"),
    "spike_": ("leap between neighbours", "check that rows of different aircraft have different icao24"),
    "stale_vertical_rate": (
        "repeat the same vertical rate while the altitude changes otherwise",
        "leave the column vertical_rate out if it is one number throughout: rates are then differenced from altitude; "
        "else give each row the time at which its values were measured",
    ),
    "stale_": ("repeat the same values", "give each row the time at which its values were measured"),
    "IAS_contradicts_Mach": (
        "hold an IAS that contradicts Mach and altitude",
        "check that IAS is the indicated airspeed (not TAS or groundspeed) and that both are of one time; "
        "--airspeeds-differ-kt is the largest difference",
    ),
    "not_descending": (
        "do not descend at {slowest_fpm:g} ft/min or more",
        "pass rows of descents; check that vertical_rate is in ft/min and negative in descent (--slowest-fpm)",
    ),
    "transient": (
        "lie within {transient_s:g} s of a level-off or climb",
        "pass rows at shorter intervals, or a smaller --transient-s",
    ),
    "constant_rate": (
        "are flown at a constant rate or path, not in free descent",
        "pass flights whose crews descend freely; --constant-rate-s is the longest that a rate may be held",
    ),
    "second_descent": ("belong to a descent after a climb", "pass each descent of a flight under its own flight_id"),
    "not_below_earlier_row": ("are not below an earlier row of their descent", "check that times and altitudes belong"),
    "banked": ("are turning", "pass --largest-bank-deg with a larger bank"),
    "cleared_": ("fly a speed or level that was cleared", "pass flights without such clearances"),
    "too_few_levels": (
        "belong to descents of fewer than {fewest_levels} levels above FL{bottom_fl}",
        "check first that altitude is in ft (metres are to be multiplied by 3.2808, flight levels by 100); else pass "
        "rows at shorter intervals and of higher levels; --bottom-fl and --fewest-levels of `descentflow prepare` say "
        "what is enough",
    ),
}
"""Step of cleaning, or the beginning of its name, -> what its rows have in common, and what to do about it."""


def nothing_left(report: DropReport, cleaning: Cleaning) -> DataError:
    """The error to raise if cleaning left no descent.

    Args:
        report: Of every step.
        cleaning: Its thresholds.

    Example:
        >>> report = DropReport([Step("read", 0, None, 9, None), Step("not_descending", 9, 1, 0, 0)])
        >>> print(nothing_left(report, Cleaning()))
        no free descent is left: 9 of 9 rows do not descend at 500 ft/min or more (not_descending); expected ...
    """
    read = report.steps[0].rows_left + report.steps[0].rows_dropped if report.steps else 0
    if not read:
        nothing = f"no row in what was given\n{report}"
        return DataError(nothing, expected="surveillance rows", mend="pass other files")
    most = max(report.steps, key=lambda step: step.rows_dropped, default=Step("read", 0, None, 0, None))
    why, mend = _reason(most.step, cleaning)
    empty = [f"{name} in {report.notes[WITHOUT + name]:,}" for name in REQUIRED if WITHOUT + name in report.notes]
    if empty and most.step == "missing_value":
        why = f"lack a value ({', '.join(empty)})"
        mend = _mend_of_missing(report, read) or mend
    return DataError(
        f"no free descent is left: {most.rows_dropped:,} of {read:,} rows {why} ({most.step})",
        expected=f"descents of airliners over {cleaning.fewest_levels} levels above FL{cleaning.bottom_fl}, with IAS, "
        "Mach and altitude",
        mend=f"{mend}\n{report}",
    )


def _mend_of_missing(report: DropReport, read: int) -> str | None:
    """Advice on the column that is empty, where it is not airspeed; None if it is."""
    if APART.format(name="altitude") in report.notes:
        return JOIN.format(name="altitude")
    empty = [name for name in ("icao24", "timestamp", "altitude") if report.notes.get(WITHOUT + name, 0) == read]
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
