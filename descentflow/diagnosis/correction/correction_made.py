"""The corrected simulator of a diagnosis: its own flights with the causes in them, or its checkpoint and samples."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import polars as pl
from torch import Tensor

from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.diagnosis.correction.corrected_descents import corrected_descents
from descentflow.diagnosis.correction.corrected_simulator import air_of_training, corrected
from descentflow.diagnosis.correction.effects_in_flights import Correction
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.simulator import Simulator
from descentflow.measurements.quantities import grid_of
from descentflow.representation.correction import Correction as DecoderCorrection
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.description import SCHEMA_VERSION
from descentflow.surveillance.descents.prepared_descents import Descents, top_levels, write_descents

CHECKPOINT, FLIGHTS = "corrected.ckpt", "corrected.parquet"
"""Names of the corrected simulator beside `gap.json`."""
SAMPLES = 400
"""Flights that are sampled of a corrected checkpoint: means of these are known to a twentieth of their spread."""
NEEDED = ("IAS", "vertical_rate")
"""Channels of a descent."""
BEGINNING = datetime(2000, 1, 1, tzinfo=UTC)
"""Start of all samples: they know no date."""


@dataclass(frozen=True)
class CorrectionMade:
    """Correction of a simulator by the causes of a diagnosis.

    Attributes:
        file_name: Of the corrected simulator; empty where there is none to write.
        write: Writes it to a path; None where there is none.
        write_flights: Of a checkpoint, writes sampled flights with the causes in them; None where there is none.

    Example:
        >>> CorrectionMade().write is None  # of a nominal descent
        True
    """

    file_name: str = ""
    write: Callable[[Path], None] | None = None
    write_flights: Callable[[Path], None] | None = None


def correction_made(
    simulator: Simulator, frame: pl.DataFrame, mass_kg: float, theta: Mapping[str, Tensor], asked: Settings
) -> CorrectionMade:
    """The simulator with the causes in it: its own flights, or its checkpoint with samples of it.

    Args:
        simulator: What was diagnosed.
        frame: Prepared real descents.
        mass_kg: Mass at which signatures are taken.
        theta: Parameters of the causes.
        asked: What is diagnosed, and how.

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
        correction = Correction(asked.catalogue, theta, mass_kg, simulator.cleaning or Cleaning(), asked.seed)

        def write(path: Path) -> None:
            write_descents(corrected_descents(flights, simulator.aircraft, correction, simulator.metadata), path)

        return CorrectionMade(FLIGHTS, write)
    write_checkpoint = corrected(simulator, mass_kg, asked.catalogue, theta)
    if write_checkpoint is None:
        return CorrectionMade()

    def write_flights(path: Path) -> None:
        write_descents(_samples(simulator, frame, mass_kg, theta, asked.seed), path)

    return CorrectionMade(CHECKPOINT, write_checkpoint, write_flights)


def _samples(
    simulator: Simulator, frame: pl.DataFrame, mass_kg: float, theta: Mapping[str, Tensor], seed: int
) -> Descents:
    """Samples with the causes in them, which begin where real flights do."""
    from descentflow.generation.rejection import sample_descents  # of models alone

    parts, sampler = simulator.representation, simulator.sampler
    assert parts is not None
    assert sampler is not None
    mask = grid_of(frame, *simulator.levels(frame), NEEDED).mask
    entry = mask.shape[1] - 1 - mask.flip(1).byte().argmax(1)
    flown = sample_descents(sampler, parts, SAMPLES, seed, entry=entry).trajectories
    sizes = {name: value.tolist() for name, value in theta.items()}
    correction = DecoderCorrection(
        sizes, mass_kg, cleaning=parts.cleaning or Cleaning(), of_training=air_of_training(parts)
    )
    settings = None if parts.cleaning is None else asdict(parts.cleaning)
    return sampled_descents(correction.apply(simulator.aircraft, flown), simulator.aircraft.typecode, settings)


def sampled_descents(flown: Trajectories, typecode: str, settings: dict[str, float | None] | None = None) -> Descents:
    """Prepared descents of samples: IAS, Mach, TAS in standard air and the rate, on every level below their entry.

    Args:
        flown: Sampled descents.
        typecode: Their type.
        settings: Cleaning settings of the flights that the model was trained on; None if not known.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> found = sampled_descents(sample("best.ckpt", 70, entry_fl=330).trajectories, "A320")
        >>> found.flights, found.frame["level_fl"].max(), found.frame["icao24"].n_unique()
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
    columns = {name: value.detach().double().cpu().numpy()[:, ::-1][seen] for name, value in channels.items()}
    table = pl.DataFrame({"row": row, "level_fl": levels, **columns}).with_columns(
        flight_id="sample-" + pl.col("row").cast(pl.String).str.zfill(6),
        icao24="sample-" + pl.col("row").cast(pl.String).str.zfill(6),
        typecode=pl.lit(typecode),
        timestamp=pl.lit(BEGINNING) + pl.duration(microseconds=(pl.col("time_s") * 1e6).round().cast(pl.Int64)),
    )
    ordered = table.select("flight_id", "icao24", "typecode", "level_fl", "timestamp", *channels)
    known = {} if settings is None else {"settings": settings}
    bottom = int(flown.levels_fl[0])
    about = {"schema_version": SCHEMA_VERSION, "bottom_fl": bottom, "top_fl": top_levels(ordered), "inputs": []}
    return Descents(ordered, {**about, **known})
