"""A model with its causes added: a checkpoint that adds them to descents after they are decoded, and samples of it."""

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.diagnosis.correction.effects_in_flights import AddedEffects
from descentflow.diagnosis.findings.correction_found import CHECKPOINT, Corrections
from descentflow.diagnosis.sides.compared_state import state_of
from descentflow.diagnosis.sides.measured_sides import NEEDED_CHANNELS
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.effects import EFFECTS
from descentflow.effects.effect import NONE
from descentflow.generation.rejection import sample_descents
from descentflow.measurements.quantities import Quantities, grid_of
from descentflow.representation.correction import Correction
from descentflow.representation.decoder.trajectories import Trajectories, burn_of
from descentflow.representation.plausibility import Plausibility
from descentflow.representation.read_checkpoint import HELD_OUT, SECTION
from descentflow.representation.representation import Representation
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, top_levels
from descentflow.surveillance.descents.store import SCHEMA_VERSION

SAMPLED_FLIGHTS = 400
"""Flights that are sampled: means of these are known to a twentieth of their spread."""
SAMPLES_BEGIN = datetime(2000, 1, 1, tzinfo=UTC)
"""Start of all samples: they know no date."""


def corrected(simulator: Simulator, added: AddedEffects, *, inherited: bool = False) -> Corrections:
    """Writer of the corrected checkpoint; empty where there is no checkpoint to correct, or none could hold it.

    Effects of the user's own cannot be written: a checkpoint that names code outside the package would not load.

    Args:
        simulator: What was diagnosed.
        added: The causes.
        inherited: Whether the simulator's own flights had the effects.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
        >>> warm = AddedEffects(EFFECTS, {"temperature": torch.tensor([10.0])}, 64_000.0, Cleaning(), seed=0)
        >>> made = corrected(Inputs("descents.parquet", "best.ckpt").open().simulator, warm)
        >>> made["corrected.ckpt"](Path("warm.ckpt"))
        >>> load_model("warm.ckpt").representation.correction.effects
        {'temperature': [10.0]}
    """
    foreign = any(added.catalogue[name] is not EFFECTS.get(name) for name in added.theta)
    parts = simulator.representation
    if parts is None or foreign:
        return {}

    def write(path: Path) -> None:
        content = simulator.content()
        # The correction is of the fit that samples are drawn from.
        content.pop(HELD_OUT, None)
        correction = _correction(parts, added, inherited=inherited)
        state: dict[str, Any] = content[SECTION]["representation"]
        state["decoder"]["correction"] = correction.to_state()
        state["plausibility"] = _widened(
            parts.plausibility, parts.decoder.levels_fl, correction, parts.decoder.aircraft
        )
        torch.save(content, path)

    return {CHECKPOINT: write}


def _correction(parts: Representation, added: AddedEffects, *, inherited: bool = False) -> Correction:
    """The causes as a checkpoint adds them to what it flies."""
    sizes = {name: value.tolist() for name, value in added.theta.items()}
    air = {} if inherited else air_of_training(parts)
    return Correction(sizes, added.mass_kg, inherited, parts.cleaning or Cleaning(), of_training=air)


def air_of_training(parts: Representation) -> dict[str, list[float]]:
    """Air that the training flights of a model flew in, as parameters of its effect; empty for standard air.

    Also empty where it is unknown: the flights reported no TAS or no Mach number, or the model knows the air of each.

    Example:
        >>> from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
        >>> air_of_training(Inputs("descents.parquet", "best.ckpt").open().simulator.representation)  # in standard air
        {}
    """
    if parts.reference is None or parts.air is not None:
        return {}
    flights, effect = (
        Quantities.from_state(parts.reference),
        next(effect for effect in EFFECTS.values() if effect.is_temperature),
    )
    state = state_of(flights, parts.decoder.aircraft, float(parts.decoder.aircraft.mass_reference_kg))
    measured = effect.measured(state, flights.values)
    if measured is None or abs(float(measured[0])) < NONE * effect.parameters[0].scale:
        return {}
    return {effect.name: [float(measured[0])]}


def _widened(bounds: Plausibility, levels_fl: Tensor, correction: Correction, aircraft: Any) -> dict[str, Any]:
    """Bounds moved along with the speeds and rates that the correction makes, so that it is not rejected for them."""
    state = bounds.to_state()
    edges = torch.stack([state["cas_low"], state["cas_high"]]).double()
    speed, rate = correction.reach(aircraft, levels_fl.double().cpu(), edges)
    state["cas_low"] = torch.minimum(state["cas_low"], (edges[0] + speed.clamp(max=0.0).amin(0)).to(state["cas_low"]))
    state["cas_high"] = torch.maximum(
        state["cas_high"], (edges[1] + speed.clamp(min=0.0).amax(0)).to(state["cas_high"])
    )
    state["slowest_rate_mps"] = state["slowest_rate_mps"] * min(float(rate.amin()), 1.0)
    # Effects begin and end at a level, brakes for instance: what changes there is no fault of the sample.
    for name in ("fastest_change_mps2", "fastest_rate_change_mps2"):
        state[name] = torch.full_like(state[name], torch.inf)
    return state


def samples_with(simulator: Simulator, frame: pl.DataFrame, added: AddedEffects) -> Descents:
    """Samples of a model with causes in them, which begin where real flights do.

    Args:
        simulator: A model.
        frame: Prepared real descents.
        added: The causes, and the seed of the samples.

    Example:
        >>> import polars as pl
        >>> from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
        >>> real, theta = pl.read_parquet("descents.parquet"), {"temperature": torch.tensor([10.0])}
        >>> warm = AddedEffects(EFFECTS, theta, 64_000.0, Cleaning(), seed=0)
        >>> simulator = Inputs("descents.parquet", "best.ckpt").open().simulator
        >>> samples_with(simulator, real, warm).flights
        {'A320': 400}
    """
    assert simulator.model is not None
    parts = simulator.model.representation
    mask = grid_of(frame, *simulator.levels(frame), NEEDED_CHANNELS).mask
    entry = mask.shape[1] - 1 - mask.flip(1).byte().argmax(1)
    flown = sample_descents(simulator.model, parts, SAMPLED_FLIGHTS, added.seed, entry=entry).trajectories
    settings = None if parts.cleaning is None else asdict(parts.cleaning)
    flown = _correction(parts, added).apply(simulator.aircraft, flown)
    return sampled_descents(flown, simulator.aircraft.typecode, settings)


def sampled_descents(flown: Trajectories, typecode: str, settings: dict[str, float | None] | None = None) -> Descents:
    """Prepared descents of samples: IAS, Mach, TAS in standard air, rate and fuel flow, on levels below their entry.

    Args:
        flown: Sampled descents.
        typecode: Their type.
        settings: Cleaning settings of the flights that the model was trained on; None if not known.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> descents = sampled_descents(sample("best.ckpt", 70, entry_fl=330).trajectories, "A320")
        >>> descents.flights, descents.frame["level_fl"].max(), descents.frame["icao24"].n_unique()
        ({'A320': 70}, 330, 70)
    """
    seen = flown.mask.cpu().numpy()[:, ::-1]
    n, n_levels = seen.shape
    row = np.broadcast_to(np.arange(n)[:, None], (n, n_levels))[seen]
    levels = np.broadcast_to(flown.levels_fl.cpu().numpy().astype(np.int32)[::-1], (n, n_levels))[seen]
    channels = {
        "time_s": flown.time_s,
        "vertical_rate": flown.rate_mps / FPM_MPS,
        "IAS": flown.cas_mps / KT_MPS,
        "Mach": flown.mach,
        "TAS": flown.tas_mps / KT_MPS,
    }
    burnt = burn_of(flown)
    if burnt is not None:
        channels["fuel_flow"] = burnt.flow_kg_s
    columns = {name: value.detach().double().cpu().numpy()[:, ::-1][seen] for name, value in channels.items()}
    table = pl.DataFrame({"row": row, "level_fl": levels, **columns}).with_columns(
        flight_id="sample-" + pl.col("row").cast(pl.String).str.zfill(6),
        icao24="sample-" + pl.col("row").cast(pl.String).str.zfill(6),
        typecode=pl.lit(typecode),
        timestamp=pl.lit(SAMPLES_BEGIN) + pl.duration(microseconds=(pl.col("time_s") * 1e6).round().cast(pl.Int64)),
    )
    ordered = table.select("flight_id", "icao24", "typecode", "level_fl", "timestamp", *channels)
    known = {} if settings is None else {"settings": settings}
    bottom = int(flown.levels_fl[0])
    about = {"schema_version": SCHEMA_VERSION, "bottom_fl": bottom, "top_fl": top_levels(ordered), "inputs": []}
    return Descents(ordered, {**about, **known})
