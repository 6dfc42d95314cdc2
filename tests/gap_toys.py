"""Flights of the world for tests of the diagnosis, and simulators trained on them."""

from collections.abc import Callable
from pathlib import Path

import toys

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.effects._example_flights import example_flights
from descentflow.effects.flight_state import FlightState
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian

Change = Callable[[FlightParameters], FlightParameters]


def flights(folder: Path, n: int, seed: int, change: Change | None = None, config: WorldConfig | None = None) -> Path:
    """Prepared descents of a world; a seed has its own file."""
    world = simulate(open_aircraft("A320"), n, seed, config, inject=change)
    rows, path = folder / f"rows{seed}.parquet", folder / f"descents{seed}.parquet"
    world.rows.write_parquet(rows)
    write_descents(prepare(rows), path)
    return path


def simulator(folder: Path, descents: Path) -> Path:
    """Checkpoint of a Gaussian trained on prepared descents."""
    data = DescentDataModule(descents, aircraft="A320")
    model = toys.fit(Gaussian(), data, 1)
    path = folder / "simulator.ckpt"
    model.trainer.save_checkpoint(path)
    return path


def state(n: int = 6, affected: bool = True) -> FlightState:
    """Flights at Mach 0.78 and then at CAS between 270 and 310 kt, in bands from FL150 to FL370."""
    return example_flights(n, affected)
