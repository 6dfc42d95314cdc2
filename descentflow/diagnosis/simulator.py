"""Simulators to diagnose: a sampler, flights of any simulator, or nominal BADA; and the flights that suit each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import polars as pl
import torch

from descentflow.core.errors import DataError
from descentflow.diagnosis.findings.inputs_found import CoefficientsUsed
from descentflow.measurements.quantities import Quantities
from descentflow.physics.performance_model import PerformanceModel
from descentflow.surveillance.cleaning.thresholds import Cleaning

if TYPE_CHECKING:
    from descentflow.generation.rejection import Sampler
    from descentflow.representation.representation import Representation

MIN_FLIGHTS = 20
"""Of either side: fewer say nothing of any effect; hundreds tell effects apart."""
MIN_LEVELS_FL = 30.0
"""Height of the levels that both sides show: six bands of 500 ft, the least that has a shape in altitude."""


@dataclass(frozen=True)
class Simulator:
    """Simulator to diagnose: a sampler with its representation, flights of any simulator, or nominal BADA.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> Simulator(aircraft("A320")).name
        'nominal'
    """

    aircraft: PerformanceModel
    sampler: "Sampler | None" = None
    representation: "Representation | None" = None
    content: Callable[[], dict[str, Any]] | None = None
    """Reads the checkpoint again, to write a corrected one."""
    name: str = "nominal"
    flights: pl.DataFrame | None = None
    """Prepared descents of the simulator, where it is given by its flights."""
    coefficients: CoefficientsUsed | None = None
    """Source of the coefficients, where it is given by its flights or any type of flights is taken."""
    cleaning: Cleaning | None = None
    """Settings by which its flights were cleaned, where it is given by them and they are known."""
    metadata: Mapping[str, Any] = field(default_factory=dict)
    """Description of its flights."""

    def levels(self, frame: pl.DataFrame) -> tuple[float, float]:
        """Lowest and highest level of its grid.

        Args:
            frame: Prepared real descents.

        Raises:
            DataError: If flights of the simulator and real ones have too few levels in common.
        """
        if self.representation is not None:
            levels = self.representation.decoder.levels_fl
            return float(levels[0]), float(levels[-1])
        if self.flights is None:
            return _levels_of(frame)
        low, high = _levels_of(self.flights)
        lowest, highest = (
            float(bound) for bound in frame.select(low=pl.min("level_fl"), high=pl.max("level_fl")).row(0)
        )
        common = max(low, lowest), min(high, highest)
        if common[1] - common[0] < MIN_LEVELS_FL:
            raise DataError(
                f"real flights between FL{lowest:.0f} and FL{highest:.0f}, and a simulator's between FL{low:.0f} and "
                f"FL{high:.0f}",
                expected=f"levels that both have, over {100 * MIN_LEVELS_FL:,.0f} ft at least",
                mend="prepare both with one --bottom-fl, and let the simulator fly the levels of the real flights",
            )
        return common


def _levels_of(frame: pl.DataFrame) -> tuple[float, float]:
    """Lowest level, and the highest that a quarter of the flights reach."""
    reached = frame.group_by("flight_id").agg(pl.col("level_fl").max())["level_fl"].to_numpy()
    lowest = frame["level_fl"].to_numpy().min(initial=10_000)
    top = sorted(reached.tolist(), reverse=True)[max(len(reached) // 4 - 1, 0)] if len(reached) else lowest
    return float(lowest), float(max(top, lowest + 20))


def of_its_type(frame: pl.DataFrame, simulator: Simulator) -> tuple[pl.DataFrame, dict[str, int]]:
    """Real flights of a checkpoint's or a nominal descent's type, and how many there were of each other type.

    Args:
        frame: Prepared descents; all are kept if they name no type.
        simulator: Types of a simulator's flights were chosen with the real ones: all are kept.

    Returns:
        The flights, and counts by reason.

    Raises:
        DataError: If none is of its type.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> frame = pl.read_parquet("descents.parquet")
        >>> own = pl.format("other {}", "flight_id")
        >>> other = frame.with_columns(typecode=pl.lit("B738"), flight_id=own)
        >>> kept, dropped = of_its_type(pl.concat([frame, other]), Simulator(aircraft("A320")))
        >>> len(kept) == len(frame), dropped
        (True, {'flights_of_B738': 120})
    """
    if simulator.flights is not None or "typecode" not in frame.columns:
        return frame, {}
    known = {simulator.aircraft.typecode}
    if simulator.representation is not None:
        known |= set(simulator.representation.provenance.get("typecodes", []))
    flights = frame.group_by("typecode").agg(pl.col("flight_id").n_unique()).drop_nulls().sort("typecode")
    given = {str(name): int(number) for name, number in flights.iter_rows()}
    if given and not given.keys() & known:
        raise DataError(
            f"descents of {', '.join(given)} for a simulator of {', '.join(sorted(known))}",
            expected="flights of the simulator's type",
            mend="choose the flights, or a simulator of their type; --any-type takes them all the same",
        )
    kept = frame.filter(pl.col("typecode").is_in(known) | pl.col("typecode").is_null())
    return kept, {f"flights_of_{name}": number for name, number in given.items() if name not in known}


def check_count(
    found: Quantities,
    given: int,
    low: float,
    high: float,
    whose: str = "real flights",
) -> None:
    """Refuse too few flights of one side on the grid (DataError).

    Args:
        found: The flights that show a band.
        given: How many there were.
        low: Lowest level of the grid.
        high: Highest.
        whose: What they are called.

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> frame = pl.read_parquet("descents.parquet")
        >>> check_count(quantities_of(frame, 150, 340, CHANNELS).rows(torch.arange(5)), 120, 150, 340)
        Traceback (most recent call last):
        descentflow.core.errors.DataError: 5 real flights with levels between FL150 and FL340 (of 120 given); ...
    """
    if len(found) < MIN_FLIGHTS:
        raise DataError(
            f"{len(found)} {whose} with levels between FL{low:.0f} and FL{high:.0f} (of {given} given)",
            expected=f"at least {MIN_FLIGHTS} flights a side, and hundreds to tell effects apart",
            mend=f"give more {whose}, or both sides the same levels",
        )


def kept_channels(reference: Quantities, real: Quantities) -> Quantities:
    """The simulator's flights with the quantities that the real ones show: a channel left out is left out of both.

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> frame = pl.read_parquet("descents.parquet")
        >>> every, few = (quantities_of(frame, 150, 340, names) for names in (CHANNELS, ["IAS", "vertical_rate"]))
        >>> set(kept_channels(every, few).values) == set(few.values) < set(every.values)
        True
    """
    names = set(real.values)
    values = {name: value for name, value in reference.values.items() if name in names}
    physics = dict(reference.physics)
    if "wind" not in names:
        physics["tailwind_mps"] = torch.zeros_like(physics["tailwind_mps"])
    return replace(reference, values=values, physics=physics)
