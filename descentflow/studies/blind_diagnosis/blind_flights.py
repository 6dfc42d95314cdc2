"""Flights of a study and the simulators that they are compared with, flown, trained and kept in its folder."""

from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.files import whole_file
from descentflow.simulation.causes import Injection
from descentflow.simulation.world import simulate
from descentflow.studies.blind_diagnosis.blind_plan import REFERENCE_FLIGHTS, SetPlan, SimulatorPlan
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare

TYPECODE = "A320"
NEVER = ("latitude", "longitude")
"""Columns that no set has: the diagnosis does not look at places."""
BASIC = (*NEVER, "TAS", "groundspeed", "track", "heading", "geoaltitude")
"""Columns that a set with the basic channels lacks."""


def write_set(one: SetPlan, path: Path, typecode: str = TYPECODE) -> None:
    """Fly the flights of a set and write their rows.

    Args:
        one: What to inject.
        path: Parquet file of rows.
        typecode: Type flown.

    Example:
        >>> one = SetPlan("blind_0000", "blind", "null", {}, 0.0, "basic", 1, "simulator_000", seed=7)
        >>> write_set(one, Path("blind_0000.parquet"))
        >>> [name for name in pl.read_parquet("blind_0000.parquet").columns if name in (*BASIC, "IAS", "Mach")]
        ['IAS', 'Mach']
    """
    aircraft = find_aircraft(typecode)
    rows = _rows(aircraft, one.flights, one.seed, one.causes)
    with whole_file(path) as temporary:
        rows.drop(BASIC if one.channels == "basic" else NEVER).write_parquet(temporary)


def write_simulator(one: SimulatorPlan, path: Path, typecode: str = TYPECODE, flights: int = REFERENCE_FLIGHTS) -> None:
    """Fly a simulator's flights, train it on them and write its checkpoint.

    Args:
        one: Seed, polar and causes of its flights.
        path: Checkpoint; the prepared descents are kept beside it.
        typecode: Type flown.
        flights: Flights flown; 72 % of them train.

    Raises:
        DescentflowError: If the flights cannot be prepared or the model cannot be fitted.

    Example:
        >>> write_simulator(SimulatorPlan("simulator_000", 8, 1.0, {}), Path("simulator_000.ckpt"), typecode="ZZZZ")
        Traceback (most recent call last):
            ...
        descentflow.core.errors.AircraftError: ...ZZZZ...
    """
    from descentflow.training.fit import fit

    descents = path.with_suffix(".parquet")
    if not descents.is_file():
        _write_descents(one, descents, typecode, flights)
    fit(descents, "gaussian", out=path, aircraft=typecode, device="cpu")


def _write_descents(one: SimulatorPlan, path: Path, typecode: str, flights: int) -> None:
    """Fly a simulator's flights and prepare them; they stay beside its checkpoint, so that it can be trained again."""
    causes = dict(one.causes)
    if one.cd0_factor != 1.0:
        causes["drag_polar"] = {"factor": one.cd0_factor * causes.get("drag_polar", {}).get("factor", 1.0)}
    with TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.parquet"
        _rows(find_aircraft(typecode), flights, one.seed, causes).drop(NEVER).write_parquet(rows)
        write_descents(prepare(rows), path)


def _rows(aircraft: Aircraft, n: int, seed: int, causes: dict[str, dict[str, float]]) -> pl.DataFrame:
    inject = Injection(aircraft, causes, seed) if causes else None
    return simulate(aircraft, n, seed, inject=inject).rows
