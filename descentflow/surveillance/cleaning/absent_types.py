"""Types that are asked for and that no flight is of."""

import re
import warnings
from collections.abc import Iterable, Sequence

from descentflow.core.errors import DescentflowWarning

MOST_NAMED = 12
DESIGNATOR = re.compile(r"[A-Z][A-Z0-9]{1,3}")
"""Form of a designator of ICAO Doc 8643."""
NONE_OF = "types asked for beside others, of which there is no row: "
"""Note in the report."""


def tell_absent_types(wanted: Sequence[str] | None, present: Iterable[str], what: str, option: str) -> None:
    """Warn of types that were asked for beside others, and of which there is none.

    Args:
        wanted: Types to keep; None for all.
        present: Types that there are.
        what: There are of them: rows, or descents.
        option: That asked, for the message.

    Warns:
        DescentflowWarning: If there are such types.

    Example:
        >>> import warnings
        >>> with warnings.catch_warnings(record=True) as told:
        ...     warnings.simplefilter("always")
        ...     tell_absent_types(["A320", "B737-800"], ["A320", "B738"], "row", "--typecode")
        >>> print(told[0].message)
        no row of type B737-800, which --typecode asks for beside others; there are A320, B738: designators of ICAO ...
    """
    known = sorted(name for name in present if name)
    if absent := asked_in_vain(wanted, known):
        there = ", ".join(known[:MOST_NAMED]) + (", ..." if len(known) > MOST_NAMED else "")
        warnings.warn(
            f"no {what} of type {', '.join(absent)}, which {option} asks for beside others; there are {there}: "
            "designators of ICAO Doc 8643 are taken, as B738; to mend it, correct it or leave it out",
            DescentflowWarning,
            stacklevel=3,
        )


def asked_in_vain(wanted: Sequence[str] | None, present: Iterable[str]) -> list[str]:
    """Types that were asked for and that there are none of.

    Example:
        >>> asked_in_vain(["a319", "a320"], ["A320", "B738"])
        ['A319']
    """
    known = set(present)
    return [name.upper() for name in wanted or [] if name.upper() not in known]


def no_designators(names: Sequence[str]) -> list[str]:
    """Names that no designator of Doc 8643 looks like: of a family some types may be absent, these are mistakes.

    Example:
        >>> no_designators(["A319", "B737-800"])
        ['B737-800']
    """
    return [name for name in names if not DESIGNATOR.fullmatch(name.upper())]
