"""Closure of a corrected simulator, measured on fresh flights with the same causes."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from descentflow.core.errors import DescentflowError
from studies.blind_diagnosis.blind_flights import write_set
from studies.blind_diagnosis.blind_plan import SetPlan

FRESH_SEED: Final = 2**31
"""Added to the seed of a set: no seed of a study is that large, so that its fresh flights are in no other set."""


def closing(one: SetPlan, report: Path) -> dict[str, Any] | None:
    """Closure that a report states, and what its corrected flights close on fresh flights.

    Args:
        one: The set that was diagnosed; its fresh flights have the same causes and another seed.
        report: Folder of the report, with the corrected flights.

    Returns:
        ``reported`` and ``measured`` shares of the gap; None without corrected flights, or where no gap is left to
        measure.

    Raises:
        DataError: If the corrected flights cannot be read.

    Example:
        >>> one = SetPlan("blind_0", "blind", "null", {}, 0.0, "all", 9, "simulator_0", 1, "own", "A320")
        >>> closing(one, Path("no_report")) is None
        True
    """
    from descentflow.diagnosis.diagnose import diagnose

    corrected = report / "corrected.parquet"
    if not corrected.is_file():
        return None
    with TemporaryDirectory() as folder:
        fresh = Path(folder) / "fresh.parquet"
        write_set(replace(one, seed=one.seed + FRESH_SEED), fresh)
        try:
            found = diagnose(fresh, corrected, previous=report / "gap.json", seed=0).previous
        except DescentflowError:
            return None
    if found is None or found.predicted.estimate is None or found.achieved.estimate is None:
        return None
    return {"reported": found.predicted.estimate, "measured": found.achieved.estimate}
