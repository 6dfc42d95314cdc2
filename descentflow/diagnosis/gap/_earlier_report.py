"""A folder that holds the report of another diagnosis is not written over; the same inputs may be run again."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from descentflow.core.errors import DataError
from descentflow.diagnosis.findings.inputs_found import Provenance

NAME = "gap.json"
"""Of the report in its folder."""
SAME = ("name", "kind", "flights", "files")
"""Keys that identify inputs without a fingerprint."""


def check_no_other_report(out: str | Path, previous: str | Path | None, made: Provenance | None = None) -> None:
    """Refuse a folder of outputs that holds the report of other inputs, or the round before.

    Args:
        out: The folder.
        previous: `gap.json` of the round before, if there is one.
        made: What is diagnosed now; None where it is not known yet, and only the round before is looked for.

    Raises:
        DataError: If it does.

    Example:
        >>> check_no_other_report("gap", previous="gap/gap.json")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: output gap is the folder of the round before (--previous gap/gap.json); ...
    """
    if previous is not None and Path(previous).parent.resolve() == Path(out).resolve():
        raise DataError(
            f"output {out} is the folder of the round before (--previous {previous})",
            expected="a folder of its own for every round",
            mend="choose another output, for instance the next number",
        )
    there = Path(out) / NAME
    if made is None or not there.exists():
        return
    try:
        then = json.loads(there.read_text(encoding="utf-8"))["provenance"]
        sides = {
            "other real flights": (then["real"], made.real),
            "another simulator": (then["simulator"], made.simulator),
        }
        other = {what: earlier for what, (earlier, now) in sides.items() if _key(earlier) != _key(asdict(now))}
    except (OSError, ValueError, KeyError, TypeError):
        other = {"inputs that it does not name": {}}
    for what, earlier in other.items():
        name = f" ({earlier['name']})" if "name" in earlier else ""
        raise DataError(
            f"output {out} holds the report of another diagnosis, of {what}{name}",
            expected="a new folder, or that of the same flights and simulator",
            mend=f"choose another output, or remove {there}",
        )


def _key(used: Mapping[str, Any]) -> object:
    """Fingerprint of inputs; without one, what else identifies them."""
    return used["fingerprint"] or [used[name] for name in SAME]
