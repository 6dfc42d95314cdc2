"""The corrected simulator of a diagnosis: its own flights with the causes in them, or its checkpoint and samples."""

from dataclasses import replace

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects, state_of_levels, with_effects
from descentflow.diagnosis.findings.correction_found import FLIGHTS, Corrections
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.measurements.level_channels import LevelGrid
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.physics.fuel import burn
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.descents.prepared_descents import Descents, top_levels, write_descents
from descentflow.surveillance.descents.store import SCHEMA_VERSION

FLIGHT_COLUMNS = ("flight_id", "icao24", "typecode", "callsign")
"""Columns that say which flight it is."""
KEPT_METADATA = ("schema_version", "descentflow", "settings", "typecodes", "inputs")
"""Parts of a description that hold for the corrected flights as well."""


def corrected_descents(flights: Descents, aircraft: PerformanceModel, added: AddedEffects) -> Descents:
    """Prepared descents of a simulator with effects in them, times integrated again.

    Positions are left out: at another rate a level is reached somewhere else. The fuel flow is that of the coefficients
    at the corrected speeds and rates, also where the flights report one. The description names the effects put in.

    Args:
        flights: Prepared descents of the simulator.
        aircraft: Whose coefficients give the signatures.
        added: What is put in.

    Raises:
        DataError: If no level is left.

    Example:
        >>> import torch
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.surveillance.cleaning.thresholds import Cleaning
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> own = read_descents("descents.parquet")
        >>> heavier = AddedEffects(EFFECTS, {"mass": torch.tensor([0.25])}, 60e3, Cleaning(), seed=0)
        >>> corrected = corrected_descents(own, aircraft("A320"), heavier)
        >>> bool(corrected.frame["vertical_rate"].mean() > own.frame["vertical_rate"].mean())  # slower descents
        True
        >>> corrected.metadata["corrected"]["effects"]
        {'mass': [0.25]}
    """
    frame = flights.frame
    low, high = (int(bound) for bound in frame.select(low=pl.min("level_fl"), high=pl.max("level_fl")).row(0))
    grid = LevelGrid.of_frame(frame, low, high, [c for c in CHANNELS if c in frame.columns])
    moved = grid and _with_fuel(with_effects(grid, aircraft, added), aircraft, added)
    if not (moved and bool(moved.mask.any())):
        raise DataError(
            "no level left of the simulator's flights with the causes in them",
            expected="descents that the causes leave descents",
            mend="look at the sizes of the causes: they stop the descent",
        )
    table = _table(moved, frame)
    described = {name: value for name, value in flights.metadata.items() if name in KEPT_METADATA}
    made = {
        "effects": {name: [round(float(x), 9) for x in theta] for name, theta in added.theta.items()},
        "seed": added.seed,
        "mass_kg": added.mass_kg,
        "typecode": aircraft.typecode,
    }
    defaults = {"schema_version": SCHEMA_VERSION, "inputs": []}
    return Descents(table, {**defaults, **described, "bottom_fl": low, "top_fl": top_levels(table), "corrected": made})


def _with_fuel(grid: LevelGrid, aircraft: PerformanceModel, added: AddedEffects) -> LevelGrid:
    """The flights with the fuel flow of the type's model at their speeds and rates."""
    state = state_of_levels(grid, aircraft, added)
    rate_mps = grid.values["vertical_rate"] * FPM_MPS
    asked = burn(aircraft, state.cas_mps, state.altitude_m, rate_mps, state.cas_slope_per_s, mass_kg=added.mass_kg)
    return replace(grid, values={**grid.values, "fuel_flow": asked.flow_kg_s})


def _table(grid: LevelGrid, frame: pl.DataFrame) -> pl.DataFrame:
    """One row a flight and level, from the highest level down, as prepared descents have them."""
    seen = grid.mask.numpy()[:, ::-1]
    n, n_levels = seen.shape
    levels = grid.levels_fl.numpy().astype(np.int64)[::-1]
    kind = frame.schema["level_fl"]
    columns = [
        pl.Series("flight_id", np.repeat(grid.flight_ids, seen.sum(1)).tolist(), pl.String),
        pl.Series("level_fl", np.broadcast_to(levels, (n, n_levels))[seen]).cast(kind),
        pl.Series("time_s", grid.time_s.numpy()[:, ::-1][seen]),
        *(pl.Series(name, value.numpy()[:, ::-1][seen]).fill_nan(None) for name, value in grid.values.items()),
    ]
    table = pl.DataFrame(columns)
    first = pl.col("timestamp").sort_by("level_fl").last()
    entry = pl.col("time_s").sort_by("level_fl").last()
    names = [pl.col(name).first() for name in FLIGHT_COLUMNS[1:] if name in frame.columns]
    flights = frame.group_by("flight_id").agg(*names, (first - pl.duration(milliseconds=entry * 1000)).alias("_zero"))
    joined = table.join(flights, on="flight_id", maintain_order="left")
    when = pl.col("_zero") + pl.duration(milliseconds=pl.col("time_s") * 1000)
    joined = joined.with_columns(timestamp=when.cast(frame.schema["timestamp"]))
    order = [name for name in frame.columns if name in joined.columns]
    absent = [name for name in ("Mach",) if name not in joined.columns]
    joined = joined.with_columns(pl.lit(None, pl.Float64).alias(name) for name in absent)
    return joined.select(*order, *absent, *({"fuel_flow"} - set(order)))


def correction_made(simulator: Simulator, frame: pl.DataFrame, added: AddedEffects) -> Corrections:
    """The simulator with the causes in it: its own flights, or its checkpoint and samples; or neither.

    Args:
        simulator: What was diagnosed.
        frame: Prepared real descents.
        added: The causes.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> import descentflow as df
        >>> warm = df.prepare(df.simulate("A320", 120, seed=1, plant={"temperature": {"deviation_k": 10.0}}))
        >>> only = {"temperature": EFFECTS["temperature"]}
        >>> report = diagnose(warm, "descents.parquet", catalogue=only, out="gap")
        >>> report.corrected_file, Path("gap", report.corrected_file).exists()
        ('corrected.parquet', True)
    """
    flights = simulator.flights
    if flights is not None:
        return {FLIGHTS: lambda path: write_descents(corrected_descents(flights, simulator.aircraft, added), path)}
    # Here and not above: a comparison of flights with flights must not pay for models.
    from descentflow.diagnosis.correction._corrected_simulator import corrected, samples_with

    checkpoint = corrected(simulator, added)
    samples: Corrections = {FLIGHTS: lambda path: write_descents(samples_with(simulator, frame, added), path)}
    return {**checkpoint, **samples} if checkpoint else {}
