"""Flights of a study and the simulators that they are compared with, flown, trained and kept in its folder."""

from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

from descentflow.core.files import whole_file
from descentflow.simulation.world import simulate
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare
from studies.blind_diagnosis.blind_plan import Causes, SetPlan, SimulatorPlan, World
from studies.jsbsim_world.airframes import AIRFRAMES
from studies.jsbsim_world.flight_plans import JsbsimConfig
from studies.jsbsim_world.fly_models import fly

NEVER = ("latitude", "longitude")
"""Columns that no set has: the diagnosis does not look at places."""
BASIC = (*NEVER, "TAS", "groundspeed", "track", "heading", "geoaltitude")
"""Columns that a set with the basic channels lacks."""


def write_set(one: SetPlan, path: Path) -> None:
    """Fly the flights of a set and write their rows.

    Args:
        one: What to plant, and in whose flights.
        path: Parquet file of rows.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "null", {}, 0.0, "basic", 1, "simulator_000", seed=7)
        >>> write_set(one, Path("blind_0000.parquet"))
        >>> [name for name in pl.read_parquet("blind_0000.parquet").columns if name in (*BASIC, "IAS", "Mach")]
        ['IAS', 'Mach']
    """
    rows = _rows(one.world, one.model, one.flights, one.seed, one.causes)
    with whole_file(path) as temporary:
        rows.drop(BASIC if one.channels == "basic" else NEVER).write_parquet(temporary)


def write_simulator(one: SimulatorPlan, path: Path) -> None:
    """Fly a simulator's flights, train it on them and write its checkpoint.

    Args:
        one: Seed, polar and causes of its flights, and whether it is trained at all.
        path: Checkpoint; the prepared descents are kept beside it.

    Raises:
        DescentflowError: If the flights cannot be prepared or the model cannot be fitted.

    Example:
        >>> write_simulator(SimulatorPlan("simulator_000", 8, model="ZZZZ"), Path("simulator_000.ckpt"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.UnknownTypeError: ...ZZZZ...
    """
    descents = path.with_suffix(".parquet")
    if not descents.is_file():
        _write_descents(one, descents)
    if one.trained:
        from descentflow.training.fit import fit

        fit(descents, "gaussian", out=path, aircraft=reference_type(one.world, one.model), device="cpu")


def reference_type(world: World, model: str) -> str:
    """Type whose coefficients a user takes for a model: its own in our world, another's for an aircraft of JSBSim.

    Example:
        >>> reference_type("own", "A320"), reference_type("foreign", "B747")
        ('A320', 'A388')
    """
    return model if world == "own" else AIRFRAMES[model].reference


def _write_descents(one: SimulatorPlan, path: Path) -> None:
    """Fly a simulator's flights and prepare them; they stay beside its checkpoint, to be diagnosed as flights too."""
    with TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.parquet"
        _rows(one.world, one.model, one.flights, one.seed, one.polar | one.causes).drop(NEVER).write_parquet(rows)
        write_descents(prepare(rows), path)


def _rows(world: World, model: str, n: int, seed: int, causes: Causes) -> pl.DataFrame:
    if world == "own":
        return simulate(model, n, seed, plant=causes).rows
    airframe = AIRFRAMES[model]
    return fly(model, n, seed, causes, config=JsbsimConfig(step_s=airframe.step_s), typecode=airframe.reference).rows
