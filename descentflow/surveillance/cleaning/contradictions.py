"""Checks of the whole drop report: contradicting columns, other clocks, rows of one address and time."""

import re
import warnings
from collections.abc import Iterable

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.cleaning.flights import OTHER_VALUES
from descentflow.surveillance.cleaning.thresholds import Cleaning, Fixed
from descentflow.surveillance.cleaning.two_clocks import AGAIN
from descentflow.surveillance.cleaning.types_of_flights import SEVERAL
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.values_beside import APART, JOIN, OF_OTHER_ROWS

DESIGNATOR = re.compile(r"[A-Z][A-Z0-9]{1,3}")
"""A type in ICAO's Doc 8643."""


def check_designators(typecodes: Iterable[str]) -> None:
    """Warn of types that are no designators: no coefficients are found by them.

    Example:
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always")
        ...     check_designators(["A320", "A-320"])
        >>> print(caught[0].message)
        descents of type A-320, which is no designator of ICAO's Doc 8643; ...
    """
    odd = sorted({name for name in typecodes if not DESIGNATOR.fullmatch(name)})
    if odd:
        more = f" and {len(odd) - 5} more" if len(odd) > 5 else ""
        warnings.warn(
            f"descents of type {', '.join(name[:40] for name in odd[:5])}{more}, which is no designator of ICAO's "
            "Doc 8643; coefficients are found by designators, such as A320: correct the column typecode",
            DescentflowWarning,
            stacklevel=3,
        )


def check_report(report: DropReport, rules: Cleaning) -> None:
    """Refuse rows of which most contradict themselves; warn of rows of one time and address with other values.

    Args:
        report: Of all rows, with every step.
        rules: Thresholds that were used.

    Raises:
        DataError: If IAS contradicts Mach in most rows.

    Example:
        >>> from descentflow.surveillance.rows.drop_report import Step
        >>> check_report(DropReport([Step("IAS_contradicts_Mach", 9, 1, 1, 1)]), Cleaning())
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: IAS contradicts Mach and altitude by 25 kt or more in 9 of 10 rows; ...
    """
    step = next((one for one in report.steps if one.step == "IAS_contradicts_Mach"), None)
    judged = step.rows_dropped + step.rows_left if step else 0
    if step and step.rows_dropped > Fixed.contradicting_share * judged:
        raise DataError(
            f"IAS contradicts Mach and altitude by {rules.airspeeds_differ_kt:g} kt or more in {step.rows_dropped:,} "
            f"of {judged:,} rows",
            expected="indicated airspeed in kt, Mach and pressure altitude in ft of the same aircraft and time",
            mend="check that IAS is the indicated airspeed (not TAS or groundspeed) and that both are of one time; "
            "leave Mach out of the table if IAS is right, or say how far they may differ (--airspeeds-differ-kt)\n"
            f"{report}",
        )
    _tell_apart(report)
    if clocks := [note for note in report.notes if note.startswith(AGAIN.partition("{")[0])]:
        said = " and ".join(f"{report.notes[note]:,} {note}" for note in clocks)
        warnings.warn(
            f"{said}, are left out: write the times of all sources in UTC (the earlier of both are kept)",
            DescentflowWarning,
            stacklevel=3,
        )
    if several := report.notes.get(SEVERAL):
        warnings.warn(
            f"the rows of {several:,} flights name several types, and each flight is taken for the one that most of "
            "its rows name: correct the column typecode, or give rows of different aircraft different icao24",
            DescentflowWarning,
            stacklevel=3,
        )
    read, other = report.left("read") or 0, report.notes.get(OTHER_VALUES, 0)
    if other > Fixed.other_values_share * read and report.steps[-1].rows_left:
        warnings.warn(
            f"{other:,} of {read:,} rows have the address and the time of another row but other values, and are left "
            "out as duplicates (the first of each is kept): if they are of another run or another receiver, give them "
            "addresses (icao24) or times of their own",
            DescentflowWarning,
            stacklevel=3,
        )


def _tell_apart(report: DropReport) -> None:
    """Warn of values that no row has beside IAS: descents lack them, and nothing can be said of air and wind."""
    apart = {
        name: report.notes[APART.format(name=name)] for name in OF_OTHER_ROWS if APART.format(name=name) in report.notes
    }
    if apart and report.steps and report.steps[-1].rows_left:
        said = ", ".join(f"{name} in {rows:,} rows" for name, rows in apart.items())
        warnings.warn(
            f"values without IAS beside them nor in a row within 5 s: {said}; descents lack them: "
            f"{JOIN.format(name=' and '.join(apart))}",
            DescentflowWarning,
            stacklevel=4,
        )
