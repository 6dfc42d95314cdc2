"""Hold flights that are known by times and altitudes alone against a simulator."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch

from descentflow.core.errors import ConfigError, DataError
from descentflow.densities.checkpoint import as_density
from descentflow.diagnosis.level_times.leg_statistics import MIN_FLIGHTS, LegDifference, interval, p_values
from descentflow.diagnosis.level_times.times_found import TimesFound
from descentflow.diagnosis.open_simulator import open_simulator
from descentflow.diagnosis.simulator_kind import kind_of, name_of
from descentflow.evaluation.metrics.comparison import compare
from descentflow.generation.sample import sample
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.surveillance.open_descents import open_descents
from descentflow.surveillance.point_profiles.level_times import Legs, edges_between, legs_of_levels, legs_of_points
from descentflow.surveillance.point_profiles.read_points import read_points

SPLITS = 100
"""Random splits behind the noise floor, as `evaluate` has them."""
NOMINAL_FL = (150.0, 350.0)
"""Levels of a nominal descent, which has no grid of its own."""


def compare_times(
    real: str | Path,
    simulator: Any,
    *,
    n: int = 10_000,
    seed: int = 0,
    bada_dir: Path | None = None,
    alike: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> TimesFound:
    """Compare seconds between flight levels: points of so6 or ALL_FT+ against a simulator.

    Args:
        real: File of so6 segments or of ALL_FT+ flights.
        simulator: A checkpoint, a density or a model, which is sampled; rows or prepared descents of a simulator's
            flights; or a type, for its nominal descent.
        n: Samples.
        seed: Of samples, labellings and resamples.
        bada_dir: Folder of BADA files for a type.
        alike: Labels of effects that times do not tell apart, for the report.
        progress: Progress callback, called with each stage.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If the simulator is none of these, or needs a context.
        DataError: If the file cannot be read, has no flight of the type, or no leg has enough flights.

    Example:
        >>> compare_times("rows.parquet", "best.ckpt")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: rows.parquet: neither so6 nor ALL_FT+; ...
    """
    say = progress or (lambda _: None)
    say("reading points")
    profiles = read_points(real)
    say("flying the simulator")
    simulated, typecode = _simulated(simulator, n, seed, bada_dir)
    of_type = profiles.of_type(typecode)
    flights = legs_of_points(of_type.points, simulated.edges_fl)
    say("comparing times")
    usable = flights.mask.sum(0) >= MIN_FLIGHTS
    usable &= simulated.mask.sum(0) >= (1 if len(simulated.seconds) == 1 else MIN_FLIGHTS)
    if not usable.any():
        seen = ", ".join(f"{k} over {leg}" for k, leg in zip(flights.mask.sum(0), flights.labels, strict=True))
        raise DataError(
            f"too few flights that descend freely between levels: {seen or 'none'}",
            expected=f"{MIN_FLIGHTS} on each side over some leg of {simulated.labels}",
            mend="pass more flights",
        )
    left_out = [
        f"{leg}: not compared, {int(own)} flights and {int(other)} of the simulator descend freely over all of it"
        for leg, own, other, kept in zip(
            flights.labels, flights.mask.sum(0), simulated.mask.sum(0), usable, strict=True
        )
        if not kept
    ]
    legs = _differences(flights, simulated, np.flatnonzero(usable), seed)
    number = int(flights.mask[:, usable].any(1).sum())
    told = f"{number:,} flights of {typecode} ({Path(real).name}, {profiles.source})"
    notes = [f"{count:,} {what}" for what, count in profiles.report.notes.items() if count]
    return TimesFound(name_of(simulator), told, tuple(legs), (*left_out, *notes), tuple(alike), seed)


def _simulated(simulator: Any, n: int, seed: int, bada_dir: Path | None) -> tuple[Legs, str]:
    """Legs of the simulator, and its type."""
    kind = kind_of(simulator)
    if kind == "flights":
        frame = open_descents(simulator).frame
        types = frame["typecode"].unique().to_list()
        if len(types) != 1:
            raise ConfigError(
                f"a simulator's flights of {len(types)} types", expected="of one", mend="prepare them with --typecode"
            )
        edges = edges_between(float(frame["level_fl"].to_numpy().min()), float(frame["level_fl"].to_numpy().max()))
        return legs_of_levels(frame, edges), str(types[0])
    if kind == "nominal":
        aircraft = open_simulator(simulator, bada_dir).aircraft
        edges = edges_between(*NOMINAL_FL)
        flown = nominal_descent(aircraft, torch.arange(edges[0], edges[-1] + 1, dtype=torch.float64))
        time_s = dict(zip(flown.level_fl.tolist(), flown.time_s.reshape(-1).tolist(), strict=True))
        seconds = np.array([[time_s[float(low)] - time_s[float(high)] for low, high in pairwise(edges)]])
        return Legs(edges, seconds, ("nominal",)), aircraft.typecode
    density = as_density(simulator)
    if density.n_context:
        raise ConfigError(
            "a model that is given a context, against points that have none",
            expected="one without",
            mend="fit it without data.context",
        )
    levels = density.representation.decoder.levels_fl
    table = (
        sample(density, n, seed=seed).to_polars().select(pl.col("sample_id").alias("flight_id"), "level_fl", "time_s")
    )
    edges = edges_between(float(levels[0]), float(levels[-1]))
    return legs_of_levels(table, edges), density.representation.decoder.aircraft.typecode


def _differences(flights: Legs, simulated: Legs, usable: np.ndarray, seed: int) -> list[LegDifference]:
    real, other = flights.seconds[:, usable], simulated.seconds[:, usable]
    one = len(other) == 1
    adjusted = _against_one(real, other[0]) if one else p_values(real, other, seed)
    distances = None if one else _distances(real, other, seed)
    found = []
    for k, place in enumerate(usable):
        own, against = (side[np.isfinite(side[:, k]), k] for side in (real, other))
        low, high = interval(own, against, seed)
        apart, floor = (np.nan, np.nan) if distances is None else (distances[0][k], distances[1][k])
        found.append(
            LegDifference(
                flights.labels[place],
                len(own),
                len(against),
                float(own.mean()),
                float(against.mean()),
                float(own.mean() - against.mean()),
                low,
                high,
                float(apart),
                float(floor),
                float(adjusted[k]),
            )
        )
    return found


def _against_one(real: np.ndarray, nominal: np.ndarray) -> np.ndarray:
    """P-values of the flights' mean against one number a leg: Student's t, times the number of legs."""
    from scipy.stats import ttest_1samp

    found = ttest_1samp(real, nominal, nan_policy="omit").pvalue
    return np.asarray(np.minimum(np.asarray(found, dtype=float) * real.shape[1], 1.0))


def _distances(real: np.ndarray, simulated: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Wasserstein distance by leg of as many of each, and of flights against flights."""
    sides = [(torch.from_numpy(np.nan_to_num(side)), torch.from_numpy(np.isfinite(side))) for side in (simulated, real)]
    found = compare(sides[0], sides[1], seed, SPLITS)
    return found.same["wasserstein"].mean(0).numpy(), found.floor["wasserstein"].mean(0).numpy()
