"""Sets of a study whose key is open, as folders that other methods can be asked about too."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from descentflow.core.errors import DataError
from descentflow.surveillance.descents.prepared_descents import read_descents, write_descents
from descentflow.surveillance.prepare import prepare
from studies.blind_diagnosis.blind_flights import reference_type, simulator_path
from studies.blind_diagnosis.blind_plan import Plan, SetPlan
from studies.blind_diagnosis.seal import KEY, OPENED, read_json, write_json

KINDS = ("null", "single", "double", "outside")
"""Kinds of sets with one right answer."""


def write_known_sets(folder: Path, out: Path, most: int, progress: Callable[[str], None] = print) -> int:
    """Write ``real.parquet``, ``simulator.parquet`` and ``truth.json`` of blind sets, each in a folder of its own.

    The simulator is given by its flights. Both sides are prepared as the diagnosis of the study prepared them, and each
    set that is there already is left as it is.

    Args:
        folder: Of the study.
        out: Folder of folders.
        most: Sets at the most, drawn at random by the seed of the key.
        progress: Progress callback, called with a line of text.

    Returns:
        How many are there.

    Raises:
        DataError: If the key of the study is not open.

    Example:
        >>> write_known_sets(Path("."), Path("known"), 10)
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: the key of . is not open...
    """
    if not (folder / OPENED).is_file():
        raise DataError(
            f"the key of {folder} is not open",
            expected="a study that was scored",
            mend="run the step 'score' of it first: what is known of the sets would be no secret any more",
        )
    drawn = draw_sets(Plan.from_dict(read_json(folder / KEY)), most)
    for done, one in enumerate(drawn, 1):
        if not (out / one.name / "truth.json").is_file():
            _write(folder, one, out / one.name)
        progress(f"sets written: {done} of {len(drawn)}")
    return len(drawn)


def draw_sets(plan: Plan, most: int) -> list[SetPlan]:
    """Blind sets with one right answer, so many at the most, in random order.

    Example:
        >>> from studies.blind_diagnosis.blind_draw import draw_plan
        >>> drawn = draw_sets(draw_plan(40, seed=1), 10)
        >>> len(drawn), {one.part for one in drawn}
        (10, {'blind'})
    """
    found = [one for one in plan.sets if one.part == "blind" and one.kind in KINDS]
    order = np.random.default_rng(plan.seed).permutation(len(found))
    return [found[i] for i in order[:most]]


def _write(folder: Path, one: SetPlan, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    simulator = read_descents(simulator_path(folder / "simulators", one.simulator, "flights"))
    write_descents(simulator, out / "simulator.parquet")
    write_descents(prepare(folder / "sets" / f"{one.name}.parquet"), out / "real.parquet")
    truth = {
        "kind": one.kind,
        "typecode": reference_type(one.world, one.model),
        "effects": {name: dict(values) for name, values in one.causes.items()},
        "world": one.world,
        "channels": one.channels,
    }
    write_json(out / "truth.json", truth)
