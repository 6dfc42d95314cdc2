"""Flights of a study and the simulators that they are compared with, flown, trained and kept in its folder."""

from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

from descentflow.core.tabular import write_table
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare
from studies.blind_diagnosis.blind_plan import Causes, Form, SetPlan, SimulatorPlan, World
from studies.blind_diagnosis.blind_worlds import foreign_scenario, own_scenario
from studies.jsbsim_world.airframes import AIRFRAMES
from studies.jsbsim_world.fly_models import fly

NEVER = ("latitude", "longitude")
"""Columns that no set has: the diagnosis does not look at places."""
BASIC = (*NEVER, "TAS", "groundspeed", "track", "heading", "geoaltitude")
"""Columns that a set with the basic channels lacks."""


def write_set(plan: SetPlan, path: Path) -> None:
    """Fly the flights of a set and write their rows.

    Args:
        plan: What to plant, and in whose flights.
        path: Parquet file of rows.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "null", {}, 0.0, "basic", 1, "simulator_000", 7, "own", "A320")
        >>> write_set(one, Path("blind_0000.parquet"))
        >>> [name for name in pl.read_parquet("blind_0000.parquet").columns if name in (*BASIC, "IAS", "Mach")]
        ['IAS', 'Mach']
    """
    rows = _rows("flights", plan.world, plan.model, plan.flights, plan.seed, plan.causes)
    write_table(rows.drop(BASIC if plan.channels == "basic" else NEVER), path)


def write_simulator(plan: SimulatorPlan, form: Form, path: Path) -> None:
    """Fly a simulator's flights in a form and write them, prepared; or train it on them and write its checkpoint.

    Args:
        plan: Seed, type and number of its flights.
        form: Whether it has weather, noise and spreads, and whether it is a checkpoint.
        path: File of prepared descents, or the checkpoint; a checkpoint is trained on the ``flights`` next to it.

    Raises:
        DescentflowError: If the flights cannot be prepared or the model cannot be fitted.

    Example:
        >>> write_simulator(SimulatorPlan("a", 8, "own", "ZZZZ", 100), "flights", Path("a_flights.parquet"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.UnknownTypeError: ...ZZZZ...
    """
    if form == "checkpoint":
        from descentflow.training.fit import fit

        flights = simulator_path(path.parent, plan.name, "flights")
        fit(flights, "gaussian", out=path, aircraft=reference_type(plan.world, plan.model), device="cpu")
        return
    with TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.parquet"
        _rows(form, plan.world, plan.model, plan.flights, plan.seed, {}).drop(NEVER).write_parquet(rows)
        write_descents(prepare(rows), path)


def simulator_path(folder: Path, name: str, form: Form) -> Path:
    """File of a simulator in a form.

    Example:
        >>> simulator_path(Path("simulators"), "simulator_000", "no_air").name
        'simulator_000_no_air.parquet'
    """
    return folder / (f"{name}.ckpt" if form == "checkpoint" else f"{name}_{form}.parquet")


def reference_type(world: World, model: str) -> str:
    """Type whose coefficients a user takes for a model: its own in our world, another's for an aircraft of JSBSim.

    Example:
        >>> reference_type("own", "A320"), reference_type("foreign", "B747")
        ('A320', 'A388')
    """
    return model if world == "own" else AIRFRAMES[model].reference


def _rows(form: Form, world: World, model: str, n: int, seed: int, causes: Causes) -> pl.DataFrame:
    if world == "own":
        return simulate(model, n, seed, own_scenario(form, model), plant=causes).rows
    return fly(model, n, seed, causes, config=foreign_scenario(form, model), typecode=AIRFRAMES[model].reference).rows
