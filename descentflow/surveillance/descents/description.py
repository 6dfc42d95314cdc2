"""The description that prepared files and stores carry: schema version, inputs with hashes, settings, report."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

from descentflow.core.errors import DataError

SCHEMA_VERSION = 1
KEY = "descentflow"
"""Key of the Parquet metadata that holds the description."""
ENTRIES: dict[str, tuple[type, ...]] = {
    "schema_version": (int,),
    "bottom_fl": (int, float),
    "top_fl": (dict,),
    "settings": (dict,),
    "typecodes": (list, str),
    "inputs": (list,),
    "report": (dict,),
}
"""Entries of a description -> the types that they may have; an absent one is not known."""
MEND = "pass the Parquet file or the folder that `descentflow prepare` wrote"


def _no_number(name: str) -> float:
    raise ValueError(name)


def _finite(text: str) -> float:
    value = float(text)
    return value if isfinite(value) else _no_number(text)


def described(text: str, path: str | Path) -> dict[str, Any]:
    """The description of a prepared table.

    Args:
        text: JSON.
        path: Where it was read, for the message.

    Raises:
        DataError: If it is no JSON object, or an entry of it is of another type than it should be.

    Example:
        >>> described('{"schema_version": 1}', "descents.parquet")
        {'schema_version': 1}
    """
    try:
        found = json.loads(text, parse_constant=_no_number, parse_float=_finite)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise DataError(f"{path}: a damaged description", expected="a JSON object in the metadata", mend=MEND)
    wrong = [name for name, kinds in ENTRIES.items() if not isinstance(found.get(name), (*kinds, type(None)))]
    tops = found.get("top_fl") or {}
    if not wrong and not all(isinstance(top, int | float) for top in tops.values()):
        wrong = ["top_fl"]
    if not wrong and not _is_report(found.get("report") or {}):
        wrong = ["report"]
    if wrong:
        raise DataError(
            f"{path}: a damaged description ({wrong[0]} is {str(found[wrong[0]])[:60]})",
            expected="the description that `descentflow prepare` writes",
            mend=MEND,
        )
    return found


def _is_report(report: dict[str, Any]) -> bool:
    """True for a report of ``prepare``: counts of rows and flights by step, and notes of what changed."""
    if not report:
        return True
    steps, notes = report.get("steps"), report.get("notes")
    if set(report) != {"steps", "notes"} or not isinstance(steps, list) or not isinstance(notes, dict):
        return False
    counts = {"rows_dropped": int, "rows_left": int, "flights_dropped": int | None, "flights_left": int | None}
    return all(isinstance(number, int) for number in notes.values()) and all(
        isinstance(step, dict)
        and set(step) == {"step", *counts}
        and isinstance(step["step"], str)
        and all(isinstance(step[name], kind) for name, kind in counts.items())
        for step in steps
    )
