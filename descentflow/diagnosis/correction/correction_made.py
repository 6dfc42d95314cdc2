"""The corrected simulator of a diagnosis: the file that holds it, what writes it, and its scores before and after."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import polars as pl
import torch
from torch import Tensor

from descentflow.diagnosis.correction.corrected_descents import corrected_descents
from descentflow.diagnosis.correction.corrected_simulator import air_of_training, corrected
from descentflow.diagnosis.correction.correction_scores import MOST, NEEDED, Halves, Scoring, descents_of, scoring
from descentflow.diagnosis.correction.effects_in_flights import Correction, state_of_levels, with_effects
from descentflow.diagnosis.correction.sampled_descents import sampled_descents
from descentflow.diagnosis.diagnosis_settings import Settings
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.simulator import Simulator
from descentflow.effects import EFFECTS
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.generation.rejection import sample_descents
from descentflow.measurements.level_channels import LevelGrid
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.representation.correction import Correction as DecoderCorrection
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import write_descents

CHECKPOINT, FLIGHTS = "corrected.ckpt", "corrected.parquet"
"""Names of the corrected simulator beside `gap.json`."""
ThetaOfPart = Callable[[Tensor], Mapping[str, Tensor]]
"""Flights (n,) bool -> parameters of the causes by these alone."""


@dataclass(frozen=True)
class CorrectionMade:
    """Correction of a simulator by the causes of a diagnosis.

    Attributes:
        file_name: Of the corrected simulator; empty where there is none to write.
        write: Writes it to a path; None where there is none.
        scoring: Computes the scores before and after.
        write_flights: Of a checkpoint, writes sampled flights with the causes in them; None where there is none.

    Example:
        >>> CorrectionMade().write is None  # of a nominal descent
        True
    """

    file_name: str = ""
    write: Callable[[Path], None] | None = None
    scoring: Scoring = field(default_factory=Scoring)
    write_flights: Callable[[Path], None] | None = None


def correction_made(
    simulator: Simulator,
    frame: pl.DataFrame,
    compared: Compared,
    theta: Mapping[str, Tensor],
    of_part: ThetaOfPart,
    asked: Settings,
) -> CorrectionMade:
    """The simulator with the causes in it: its own flights or its checkpoint, and what that does to all scores.

    Args:
        simulator: What was diagnosed.
        frame: Prepared real descents.
        compared: Flights of both sides.
        theta: Parameters of the causes.
        of_part: Parameters of the same causes by some of the flights alone.
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
    mass_kg, catalogue, seed = compared.state.mass_kg, asked.catalogue, asked.seed
    if simulator.flights is not None:
        cleaning = simulator.cleaning or Cleaning()
        correction = Correction(catalogue, theta, mass_kg, cleaning, seed)
        return CorrectionMade(
            FLIGHTS,
            _writer(simulator, simulator.flights, correction),
            _scoring_of_flights(
                simulator, simulator.flights, frame, compared, of_part, correction, asked.transition_fl
            ),
        )
    write = corrected(simulator, mass_kg, catalogue, theta)
    parts = simulator.representation
    if simulator.sampler is None or parts is None or any(catalogue[name] is not EFFECTS.get(name) for name in theta):
        return CorrectionMade(CHECKPOINT if write is not None else "", write)
    flown, moved = _samples(simulator, frame, mass_kg, seed)
    made = _scoring_of_samples(simulator, frame, compared, of_part, flown, moved, asked.transition_fl, seed)
    settings = None if parts.cleaning is None else asdict(parts.cleaning)

    def write_flights(path: Path) -> None:
        write_descents(sampled_descents(moved(theta), simulator.aircraft.typecode, settings), path)

    return CorrectionMade(CHECKPOINT if write is not None else "", write, made, write_flights)


def _writer(simulator: Simulator, flights: pl.DataFrame, correction: Correction) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        write_descents(corrected_descents(flights, simulator.aircraft, correction, simulator.metadata), path)

    return write


def _scoring_of_flights(
    simulator: Simulator,
    flights: pl.DataFrame,
    frame: pl.DataFrame,
    compared: Compared,
    of_part: ThetaOfPart,
    correction: Correction,
    transition_fl: float,
) -> Scoring:
    """Computation of the scores; all that needs tables is done here, for no copy of this process can use these."""
    low, high = simulator.levels(frame)
    names = flights["flight_id"].unique().sort()
    some = names.sample(min(MOST, len(names)), seed=correction.seed) if len(names) > MOST else names
    own = LevelGrid.of_frame(
        flights.filter(pl.col("flight_id").is_in(some.implode())), low, high, [c for c in CHANNELS if c in flights]
    )
    halves = _halves(frame, low, high, compared, of_part, correction.seed)
    if own is None or halves is None:
        return Scoring()

    state = state_of_levels(own, simulator.aircraft, correction)

    def with_theta(theta: Mapping[str, Tensor]) -> DescentSet:
        return descents_of(with_effects(own, simulator.aircraft, replace(correction, theta=theta), state))

    return scoring(halves, descents_of(own), with_theta, transition_fl, correction.seed)


def _samples(
    simulator: Simulator, frame: pl.DataFrame, mass_kg: float, seed: int
) -> tuple[Trajectories, Callable[[Mapping[str, Tensor]], Trajectories]]:
    """Samples that begin where real flights do, and what puts causes into them."""
    parts, sampler = simulator.representation, simulator.sampler
    assert parts is not None
    assert sampler is not None
    low, high = simulator.levels(frame)
    grid = LevelGrid.of_frame(frame, low, high, NEEDED)
    mask = torch.ones(1, len(parts.decoder.levels_fl), dtype=torch.bool) if grid is None else grid.mask
    entry = mask.shape[1] - 1 - mask.flip(1).to(torch.int8).argmax(1)
    flown = sample_descents(sampler, parts, MOST, seed, entry=entry).trajectories

    def moved(theta: Mapping[str, Tensor]) -> Trajectories:
        sizes = {name: value.tolist() for name, value in theta.items()}
        cleaning, air = parts.cleaning or Cleaning(), air_of_training(parts)
        correction = DecoderCorrection(sizes, mass_kg, cleaning=cleaning, of_training=air)
        return correction.apply(simulator.aircraft, flown)

    return flown, moved


def _scoring_of_samples(
    simulator: Simulator,
    frame: pl.DataFrame,
    compared: Compared,
    of_part: ThetaOfPart,
    flown: Trajectories,
    moved: Callable[[Mapping[str, Tensor]], Trajectories],
    transition_fl: float,
    seed: int,
) -> Scoring:
    """The same of samples."""
    halves = _halves(frame, *simulator.levels(frame), compared, of_part, seed)
    if halves is None:
        return Scoring()
    before = DescentSet.of_trajectories(flown)

    def with_theta(theta: Mapping[str, Tensor]) -> DescentSet:
        return DescentSet.of_trajectories(moved(theta))

    return scoring(halves, before, with_theta, transition_fl, seed)


def _halves(
    frame: pl.DataFrame, low: float, high: float, compared: Compared, of_part: ThetaOfPart, seed: int
) -> Halves | None:
    """Real flights in two halves of whole aircraft, with the parameters that each gives."""
    grid = LevelGrid.of_frame(frame, low, high, NEEDED)
    if grid is None:
        return None
    # Aircraft of the real flights are numbered after those of the simulator's.
    first = int(compared.airframe[~compared.real].max()) + 1 if bool((~compared.real).any()) else 0
    count = int(grid.airframe.max()) + 1
    dealt = torch.randperm(count, generator=torch.Generator().manual_seed(seed)) % 2 == 0
    mine = dealt[(compared.airframe - first).clamp(min=0)]
    flights, theta = [], []
    for half in (False, True):
        chosen = torch.nonzero(dealt[grid.airframe] == half)[:, 0]
        chosen = chosen[torch.randperm(len(chosen), generator=torch.Generator().manual_seed(seed))[:MOST]]
        flights.append(descents_of(grid).subset(chosen))
        theta.append(of_part(~compared.real | (mine == half)))
    return Halves((flights[0], flights[1]), (theta[0], theta[1]))
