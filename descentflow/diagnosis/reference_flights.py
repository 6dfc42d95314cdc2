"""Measurements of both sides: a simulator's flights (its own, those of its checkpoint, or samples) and real ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.diagnosis.simulator import Simulator, check_count, kept_channels
from descentflow.generation.rejection import sample_descents
from descentflow.measurements.level_channels import LevelGrid
from descentflow.measurements.quantities import Quantities, checked, grid_of, measured, of_some_aircraft
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.profiles import observed_profiles

SAMPLES = 1000
"""Drawn where a checkpoint keeps no flights: means to a thirtieth of the spread between flights."""
MIN_SHARE = 0.1
"""A channel that this share of the flights report, or fewer, is one that they lack."""
MIN_AIRCRAFT = 5
"""Of either side: each fold of the cross-validation holds out whole aircraft."""
NEEDED = ("IAS", "vertical_rate")
"""Channels without which there is no descent to compare."""
SHOWS = {"Mach": "mismatch", "TAS": "tas", "groundspeed": "wind", "geoaltitude": "height"}
"""Channel -> a quantity that cannot be measured without it."""
REAL, SIMULATED = "real", "simulator"
"""Names of the sides where one lacks a channel."""
AIR_NOISE = ("noise_tas", "noise_groundspeed")
"""Noise of channels that a flight brought to standard air does not have as it would have been reported there."""
SAMPLED = ("cas",)
"""Quantities besides the rate that samples say something about; the rest is what physics claims."""


@dataclass(frozen=True)
class BothSides:
    """Measurements of both sides' flights, by the same instrument.

    Attributes:
        reference: The simulator's flights; None for a nominal descent.
        real: Real flights, in the same quantities.
        source: Where the former come from: ``training flights``, ``samples``, ``simulator flights`` or ``physics``.
        given: Flights of the simulator before any was left out; zero for a nominal descent.
        lacked: Channel -> the side that lacks it, where one side alone does; it is left out on both.

    Example:
        >>> from descentflow.diagnosis.open_simulator import open_simulator
        >>> from descentflow.measurements.quantity_registry import CHANNELS
        >>> frame = pl.read_parquet("descents.parquet")
        >>> sides = both_sides(open_simulator("best.ckpt"), frame, CHANNELS, seed=0)
        >>> sides.source, len(sides.reference), len(sides.real), sides.lacked
        ('training flights', 96, 120, {})
    """

    reference: Quantities | None
    real: Quantities
    source: str
    given: int = 0
    lacked: Mapping[str, str] = field(default_factory=dict)


def both_sides(simulator: Simulator, frame: pl.DataFrame, channels: Sequence[str], seed: int) -> BothSides:
    """Measure both sides on the simulator's grid.

    Samples are made of a few components, which real flights are not: then the real flights' speeds and rates are taken
    through the same components before they are measured.

    Args:
        simulator: What is diagnosed.
        frame: Prepared real descents.
        channels: Channels to use.
        seed: Of the samples.

    Raises:
        DataError: If either side has too few flights on the grid, they have no level or no needed channel in common, or
            a checkpoint's own flights were measured in another way.

    Example:
        >>> from descentflow.diagnosis.simulator_flights import SignatureSource, simulator_of_flights
        >>> frame = pl.read_parquet("descents.parquet")
        >>> simulator = simulator_of_flights(frame.drop("TAS"), ["A320"], SignatureSource(), "mine")
        >>> sides = both_sides(simulator, frame, ["IAS", "Mach", "vertical_rate", "TAS"], seed=0)
        >>> sides.source, sides.lacked
        ('simulator flights', {'TAS': 'simulator'})
    """
    low, high = simulator.levels(frame)
    if simulator.flights is not None:
        return _of_flights(simulator.flights, frame, channels, low, high)
    grid = grid_of(frame, low, high, channels)
    real = checked(measured(grid))
    check_count(real, frame["flight_id"].n_unique(), low, high)
    parts = simulator.representation
    if parts is None or simulator.sampler is None:
        return BothSides(None, real, "physics")
    if parts.air is not None:
        # Reports are rounded in the air as it was: what it does to them does not go with the wind.
        real = replace(real, values={name: value for name, value in real.values.items() if name not in AIR_NOISE})
    if parts.reference is None:
        samples = _samples(simulator, grid, seed)
        real = _by_components(parts.decoder, grid, real)
        return BothSides(kept_channels(samples, real), real, "samples", len(samples))
    try:
        own = Quantities.from_state(parts.reference)
    except KeyError as error:
        raise DataError(
            f"a checkpoint with {error.args[0]}", expected="one of this version of descentflow", mend="fit it again"
        ) from error
    check_count(own, len(own), low, high, whose="training flights of the checkpoint")
    lacked = {c: REAL for c, q in SHOWS.items() if c in channels and q in own.values and q not in real.values}
    return BothSides(kept_channels(own, real), real, "training flights", len(own), lacked)


def _of_flights(
    flights: pl.DataFrame, frame: pl.DataFrame, channels: Sequence[str], low: float, high: float
) -> BothSides:
    """Both sides measured in the channels that both have."""
    given = flights["flight_id"].n_unique()
    flights = of_some_aircraft(flights)
    shown = [_channels_shown(side, low, high, channels) for side in (frame, flights)]
    common = [c for c in channels if c in shown[0] and c in shown[1]]
    absent = [c for c in NEEDED if c not in common]
    if absent:
        raise DataError(
            f"real flights with {', '.join(shown[0]) or 'no channel'} and a simulator's with "
            f"{', '.join(shown[1]) or 'no channel'} between FL{low:.0f} and FL{high:.0f}",
            expected=f"{' and '.join(NEEDED)} on both sides",
            mend="prepare rows that have them (a rate is differenced from the altitude where rows have none)",
        )
    real, own = (measured(grid_of(side, low, high, common)) for side in (frame, flights))
    check_count(real, frame["flight_id"].n_unique(), low, high)
    check_count(own, given, low, high, whose="simulated flights")
    for side, whose in ((real, "real flights"), (own, "simulated flights")):
        _check_aircraft(side, whose)
    lacked = {c: REAL if c not in shown[0] else SIMULATED for c in channels if (c in shown[0]) != (c in shown[1])}
    return BothSides(kept_channels(own, real), kept_channels(real, own), "simulator flights", given, lacked)


def _channels_shown(frame: pl.DataFrame, low: float, high: float, channels: Sequence[str]) -> list[str]:
    """Channels that enough flights report on the grid."""
    names = [c for c in channels if c in frame.columns]
    inside = frame.filter(pl.col("level_fl").is_between(low, high))
    by_flight = inside.group_by("flight_id").agg(pl.col(names).is_not_null().any())
    least = MIN_SHARE * len(by_flight)
    return [c for c in names if int(by_flight[c].sum()) > least]


def _check_aircraft(found: Quantities, whose: str) -> None:
    """Refuse flights of so few aircraft that whole aircraft cannot be held out (DataError)."""
    count = len(torch.unique(found.airframe))
    if count < MIN_AIRCRAFT:
        raise DataError(
            f"{whose} of {count} aircraft (icao24)",
            expected=f"flights of at least {MIN_AIRCRAFT}, for those of one aircraft are alike and stay together",
            mend="give flights of more aircraft; where a simulator makes its flights independently of each other, "
            "give each an icao24 of its own",
        )


def _by_components(decoder: DescentDecoder, grid: LevelGrid, real: Quantities) -> Quantities:
    """Real flights with the speeds and rates of their own components; all else as measured."""
    seen = grid.mask
    cas = torch.where(seen, grid.values["IAS"], 250.0) * KT_MPS
    rate = torch.where(seen, grid.values["vertical_rate"], -1500.0) * FPM_MPS
    profiles = observed_profiles(
        decoder.aircraft, grid.flight_ids, grid.levels_fl, torch.zeros_like(cas), cas, rate, seen
    )
    with torch.no_grad():
        flown = decoder(decoder.encode(profiles), profiles.entry_level)
    smooth = measured(_shown(grid, flown, seen, grid.airframe, grid.flight_ids))
    if len(smooth) != len(real):
        raise DataError(
            "flights that lose their bands in the simulator's components",
            expected="descents that the simulator can represent",
            mend="use a checkpoint of this version, which keeps its own flights",
        )
    values = {**real.values, **{name: smooth.values[name] for name in SAMPLED}}
    physics = {**smooth.physics, "tailwind_mps": real.physics["tailwind_mps"]}
    return replace(real, values=values, physics=physics)


def _shown(like: LevelGrid, flown: Trajectories, seen: Tensor, airframe: Tensor, names: tuple[str, ...]) -> LevelGrid:
    """Decoded descents where they are seen."""

    def shown(values: Tensor) -> Tensor:
        return torch.where(seen, values.detach().double().cpu(), torch.nan)

    channels = {"IAS": shown(flown.cas_mps / KT_MPS), "vertical_rate": shown(flown.rate_mps / FPM_MPS)}
    return LevelGrid(like.levels_fl, shown(flown.time_s), channels, airframe, names)


def _samples(simulator: Simulator, real: LevelGrid, seed: int) -> Quantities:
    """Samples seen through the gaps of real flights, each flight an aircraft of its own."""
    parts = simulator.representation
    assert parts is not None
    assert simulator.sampler is not None
    generator = np.random.default_rng(seed)
    mask = real.mask
    chosen = torch.from_numpy(generator.integers(0, len(mask), SAMPLES))
    top = mask.shape[1] - 1 - mask.flip(1).to(torch.int8).argmax(1)
    flown = sample_descents(simulator.sampler, parts, SAMPLES, seed, entry=top).trajectories
    # Each sample takes the gaps of a real flight; levels above its own entry have no meaning.
    seen = mask[chosen] & flown.mask.cpu()
    names = tuple(f"sample-{i}" for i in range(SAMPLES))
    found = measured(_shown(real, flown, seen, torch.arange(SAMPLES), names))
    return Quantities(
        found.levels_fl,
        found.band_fl,
        {name: value for name, value in found.values.items() if name in SAMPLED},
        found.physics,
        found.airframe,
    )
