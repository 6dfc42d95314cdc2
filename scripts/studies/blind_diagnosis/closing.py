"""Closure of a corrected simulator, measured on fresh flights of it."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import torch

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import DescentflowError
from descentflow.diagnosis.correction.corrected_descents import corrected_descents
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects
from descentflow.diagnosis.findings.correction_found import Previous
from descentflow.effects import EFFECTS
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from studies.blind_diagnosis.blind_flights import simulator_path, write_simulator
from studies.blind_diagnosis.blind_plan import Form, SimulatorPlan

FRESH_SEED: Final = 2**31
"""Added to the seed of a simulator: no seed of a study is that large."""


def fly_fresh(plan: SimulatorPlan, form: Form, folder: Path) -> Path:
    """Flights of a simulator that no diagnosis has seen, flown if they are not in the folder.

    Example:
        >>> one = SimulatorPlan("a", 8, "own", "A320", 100)
        >>> Path("a_fresh_bare.parquet").touch()
        >>> fly_fresh(one, "bare", Path(".")).name
        'a_fresh_bare.parquet'
    """
    path = simulator_path(folder, f"{plan.name}_fresh", form)
    if not path.is_file():
        write_simulator(replace(plan, seed=plan.seed + FRESH_SEED), form, path)
    return path


def closing(rows: Path, fresh: Path, report: Path) -> dict[str, Any] | None:
    """Closure that a report states, and what fresh flights of the simulator with its correction reach.

    Args:
        rows: The real flights.
        fresh: Flights of the simulator that the diagnosis did not see.
        report: Folder of the report, with the corrected flights.

    Returns:
        ``reported`` and ``measured`` shares of the gap, and the ``error`` of a second diagnosis that was refused; None
        where nothing was corrected, or where there was no gap to close.

    Raises:
        DataError: If the corrected flights cannot be read.

    Example:
        >>> closing(Path("rows.parquet"), Path("fresh.parquet"), Path("no_report")) is None
        True
    """
    if not (report / "corrected.parquet").is_file():
        return None
    made = (read_descents(report / "corrected.parquet").metadata or {})["corrected"]
    try:
        previous = _second_round(rows, _corrected(read_descents(fresh), made), report)
    except DescentflowError as error:
        return {"reported": None, "measured": None, "error": str(error)}
    if previous.predicted.estimate is None or previous.achieved.estimate is None:
        return None
    return {"reported": previous.predicted.estimate, "measured": previous.achieved.estimate, "error": None}


def _corrected(fresh: Descents, made: dict[str, Any]) -> Descents:
    theta = {name: torch.tensor(values, dtype=torch.float64) for name, values in made["effects"].items()}
    correction = AddedEffects(EFFECTS, theta, made["mass_kg"], Cleaning(), made["seed"])
    return corrected_descents(fresh, find_aircraft(made["typecode"]), correction)


def _second_round(rows: Path, corrected: Descents, report: Path) -> Previous:
    from descentflow.diagnosis.diagnose import diagnose

    with TemporaryDirectory() as folder:
        path = Path(folder) / "corrected.parquet"
        write_descents(corrected, path)
        previous = diagnose(rows, path, previous=report / "gap.json", seed=0).previous
    assert previous is not None
    return previous
