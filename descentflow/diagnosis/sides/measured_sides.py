"""Measurements of both sides: a simulator's flights (its own, or those of its checkpoint) and real ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import polars as pl
import torch

from descentflow.core.errors import DataError
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import FEWEST_FOR_CAUSES
from descentflow.measurements.quantities import Quantities, grid_of, measured, of_some_aircraft
from descentflow.measurements.quantity_registry import SHOWN_BY

OWN_FLIGHTS = "training flights"
"""Source that holds a model's own flights, whose causes its inferred drag holds as well; flights of any simulator are
what it flies, and what both sides have alike is no gap."""
MIN_FLIGHTS_A_SIDE = 5
"""Least flights of either side: of so few only what is measured without coefficients may be named."""
MIN_SHARE_REPORTING = 0.1
"""A channel that this share of the flights report, or fewer, is one that they lack."""
LEAST_AIRCRAFT = 5
"""Least aircraft of either side: each fold of the cross-validation holds out whole aircraft."""
NEEDED_CHANNELS = ("IAS", "vertical_rate")
"""Channels without which there is no descent to compare."""
REAL, SIMULATED = "real", "simulator"
"""Names of the sides where one lacks a channel."""
AIR_NOISE = ("noise_tas", "noise_groundspeed")
"""Noise of channels that a flight brought to standard air does not have as it would have been reported there."""


@dataclass(frozen=True)
class MeasuredSides:
    """Measurements of both sides' flights, by the same instrument.

    Attributes:
        simulated: The simulator's flights; None for a nominal descent.
        real: Real flights, in the same quantities.
        source: Where the former come from: ``training flights``, ``simulator flights`` or ``physics``.
        lacked: Channel -> the side that lacks it, where one side alone does; it is left out on both.

    Example:
        >>> from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
        >>> from descentflow.measurements.quantity_registry import CHANNELS
        >>> opened = Inputs("descents.parquet", "best.ckpt").open()
        >>> sides = both_sides(opened.simulator, opened.frame, CHANNELS)
        >>> sides.source, len(sides.simulated), len(sides.real), sides.lacked
        ('training flights', 96, 120, {})
    """

    simulated: Quantities | None
    real: Quantities
    source: str
    lacked: Mapping[str, str] = field(default_factory=dict)


def both_sides(
    simulator: Simulator, frame: pl.DataFrame, channels: Sequence[str], band_fl: float | None = None
) -> MeasuredSides:
    """Measure both sides on the simulator's grid.

    Args:
        simulator: What is diagnosed.
        frame: Prepared real descents.
        channels: Channels to use.
        band_fl: Height of a band; about a fifteenth of the grid's if absent, and a model's training flights have it.

    Raises:
        DataError: If either side has too few flights on the grid, they have no level or no needed channel in common, or
            a checkpoint keeps no flights, or they were measured in another way.
    """
    low, high = simulator.levels(frame)
    if simulator.flights is not None:
        return _of_flights(simulator.flights.frame, frame, channels, (low, high), band_fl)
    grid = grid_of(frame, low, high, channels)
    real = measured(grid, band_fl)
    check_count(real, frame["flight_id"].n_unique(), low, high)
    representation = simulator.representation
    if representation is None:
        return MeasuredSides(None, real, "physics")
    if representation.air is not None:
        # Reports are rounded in the air as it was: what it does to them does not go with the wind.
        real = replace(real, values={name: value for name, value in real.values.items() if name not in AIR_NOISE})
    if representation.reference is None:
        raise DataError(
            "a model that keeps no flights",
            expected="one that keeps its training flights, as `fit` writes it",
            mend="fit it again, or sample it (descentflow sample) and pass the samples as --simulator",
        )
    try:
        own = Quantities.from_state(representation.reference)
    except KeyError as error:
        raise DataError(
            f"a checkpoint with {error.args[0]}", expected="one of this version of descentflow", mend="fit it again"
        ) from error
    check_count(own, len(own), low, high, whose="training flights of the checkpoint")
    shown = {c: SHOWN_BY[c] for c in channels if c in SHOWN_BY}
    lacked = {c: REAL for c, q in shown.items() if q in own.values and q not in real.values}
    return MeasuredSides(kept_channels(own, real), real, OWN_FLIGHTS, lacked)


def _of_flights(
    flights: pl.DataFrame,
    frame: pl.DataFrame,
    channels: Sequence[str],
    levels: tuple[float, float],
    band_fl: float | None,
) -> MeasuredSides:
    """Both sides measured in the channels that both have."""
    low, high = levels
    given = flights["flight_id"].n_unique()
    flights = of_some_aircraft(flights)
    shown = [_channels_shown(side, low, high, channels) for side in (frame, flights)]
    common = [c for c in channels if c in shown[0] and c in shown[1]]
    absent = [c for c in NEEDED_CHANNELS if c not in common]
    if absent:
        raise DataError(
            f"real flights with {', '.join(shown[0]) or 'no channel'} and a simulator's with "
            f"{', '.join(shown[1]) or 'no channel'} between FL{low:.0f} and FL{high:.0f}",
            expected=f"{' and '.join(NEEDED_CHANNELS)} on both sides",
            mend="prepare rows that have them (a rate is differenced from the altitude where rows have none)",
        )
    real, own = (measured(grid_of(side, low, high, common), band_fl) for side in (frame, flights))
    check_count(real, frame["flight_id"].n_unique(), low, high)
    check_count(own, given, low, high, whose="simulated flights")
    for side, whose in ((real, "real flights"), (own, "simulated flights")):
        count = len(torch.unique(side.airframe))
        if count < LEAST_AIRCRAFT:
            raise DataError(
                f"{whose} of {count} aircraft (icao24)",
                expected=f"flights of at least {LEAST_AIRCRAFT}, for those of one aircraft are alike and stay together",
                mend="give flights of more aircraft; where a simulator makes its flights independently of each other, "
                "give each an icao24 of its own",
            )
    lacked = {c: REAL if c not in shown[0] else SIMULATED for c in channels if (c in shown[0]) != (c in shown[1])}
    return MeasuredSides(kept_channels(own, real), kept_channels(real, own), "simulator flights", lacked)


def _channels_shown(frame: pl.DataFrame, low: float, high: float, channels: Sequence[str]) -> list[str]:
    """Channels that enough flights report on the grid."""
    names = [c for c in channels if c in frame.columns]
    inside = frame.filter(pl.col("level_fl").is_between(low, high))
    by_flight = inside.group_by("flight_id").agg(pl.col(names).is_not_null().any())
    least = MIN_SHARE_REPORTING * len(by_flight)
    return [c for c in names if int(by_flight[c].sum()) > least]


def check_count(quantities: Quantities, given: int, low: float, high: float, whose: str = "real flights") -> None:
    """Refuse too few flights of one side on the grid (DataError).

    Args:
        quantities: The flights that show a band.
        given: How many there were.
        low: Lowest level of the grid.
        high: Highest.
        whose: What they are called.

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> frame = pl.read_parquet("descents.parquet")
        >>> check_count(quantities_of(frame, 150, 340, CHANNELS).rows(torch.arange(4)), 120, 150, 340)
        Traceback (most recent call last):
        descentflow.core.errors.DataError: 4 real flights with levels between FL150 and FL340 (of 120 given); ...
    """
    if len(quantities) < MIN_FLIGHTS_A_SIDE:
        raise DataError(
            f"{len(quantities)} {whose} with levels between FL{low:.0f} and FL{high:.0f} (of {given} given)",
            expected=f"at least {MIN_FLIGHTS_A_SIDE} flights a side, {FEWEST_FOR_CAUSES} to seek all causes, "
            "and hundreds to tell effects apart",
            mend=f"give more {whose}, or both sides the same levels",
        )


def kept_channels(simulated: Quantities, real: Quantities) -> Quantities:
    """The simulator's flights with the quantities that the real ones show: a channel left out is left out of both.

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> frame = pl.read_parquet("descents.parquet")
        >>> every, few = (quantities_of(frame, 150, 340, names) for names in (CHANNELS, ["IAS", "vertical_rate"]))
        >>> set(kept_channels(every, few).values) == set(few.values) < set(every.values)
        True
    """
    names = set(real.values)
    values = {name: value for name, value in simulated.values.items() if name in names}
    physics = dict(simulated.physics)
    if "wind" not in names:
        physics["tailwind_mps"] = torch.zeros_like(physics["tailwind_mps"])
    return replace(simulated, values=values, physics=physics)
