"""Flights of the world for tests of the diagnosis, and simulators trained on them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch
from lightning.pytorch import Trainer

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M, KT_MPS
from descentflow.effects.flight_state import FlightState
from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.simulation.parameters import FlightParameters
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import write_descents
from descentflow.surveillance.prepare import prepare
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian

Plant = Callable[[FlightParameters], FlightParameters]


def flights(folder: Path, n: int, seed: int, plant: Plant | None = None, config: WorldConfig | None = None) -> Path:
    """Prepared descents of a world; a seed has its own file."""
    world = simulate(open_aircraft("A320"), n, seed, config, plant=plant)
    rows, path = folder / f"rows{seed}.parquet", folder / f"descents{seed}.parquet"
    world.rows.write_parquet(rows)
    write_descents(prepare(rows), path)
    return path


def simulator(folder: Path, descents: Path) -> Path:
    """Checkpoint of a Gaussian trained on prepared descents."""
    data = DescentDataModule(descents, aircraft="A320")
    quiet = {"logger": False, "enable_checkpointing": False, "enable_progress_bar": False, "accelerator": "cpu"}
    trainer = Trainer(max_epochs=1, num_sanity_val_steps=0, enable_model_summary=False, **quiet)
    trainer.fit(Gaussian(), datamodule=data)
    path = folder / "simulator.ckpt"
    trainer.save_checkpoint(path)
    return path


def state(n: int = 6, affected: bool = True) -> FlightState:
    """Flights at Mach 0.78 and then at CAS between 270 and 310 kt, in bands from FL150 to FL370."""
    altitude = torch.linspace(160, 360, 11, dtype=torch.float64) * FL_M
    planned = torch.linspace(270, 310, n, dtype=torch.float64)[:, None] * KT_MPS
    by_mach = mach_to_cas_mps(0.78, altitude)
    cas = torch.minimum(planned + 0 * by_mach, by_mach)
    (slope,) = torch.gradient(by_mach, spacing=(altitude,))
    mask = torch.ones_like(cas, dtype=torch.bool)
    slopes = torch.where(cas < planned, slope, 0.0)
    depth = altitude[-1] - altitude + 0 * cas
    flown = FlightState(
        open_aircraft("A320"), 57e3, altitude, 20 * FL_M, cas, slopes, torch.zeros_like(cas), mask, depth, affected
    )
    return replace(flown, rate_slope_per_m=flown.schedule_slope_per_m)
