"""What is diagnosed: a sampler with its representation, or nominal BADA; and what flights it can be held against."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import polars as pl
import torch

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.errors import DataError
from descentflow.generation.rejection import Sampler
from descentflow.measurements.quantities import Quantities
from descentflow.representation.representation import Representation

MIN_FLIGHTS = 20
"""Fewer flights say nothing of any effect; hundreds are needed to tell effects apart."""


@dataclass(frozen=True)
class Simulator:
    """What is diagnosed: a sampler with its representation, or nominal BADA where there is none.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> Simulator(aircraft("A320")).name
        'nominal'
    """

    aircraft: Aircraft
    sampler: Sampler | None = None
    representation: Representation | None = None
    content: Callable[[], dict[str, Any]] | None = None
    """Reads the checkpoint again, to write a corrected one."""
    name: str = "nominal"

    def levels(self, frame: pl.DataFrame) -> tuple[float, float]:
        """Lowest and highest level of its grid."""
        if self.representation is not None:
            levels = self.representation.decoder.levels_fl
            return float(levels[0]), float(levels[-1])
        reached = frame.group_by("flight_id").agg(pl.col("level_fl").max())["level_fl"].to_numpy()
        lowest = frame["level_fl"].to_numpy().min(initial=10_000)
        top = sorted(reached.tolist(), reverse=True)[max(len(reached) // 4 - 1, 0)] if len(reached) else lowest
        return float(lowest), float(max(top, lowest + 20))


def check_type(frame: pl.DataFrame, simulator: Simulator) -> None:
    """Refuse flights of another type (DataError).

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> check_type(read_descents("descents.parquet").frame, Simulator(aircraft("A320")))  # no error: they are A320
    """
    types = {str(t) for t in frame["typecode"].drop_nulls().unique()} if "typecode" in frame.columns else set()
    known = {simulator.aircraft.typecode}
    if simulator.representation is not None:
        known |= set(simulator.representation.provenance.get("typecodes", []))
    if types and not types & known:
        raise DataError(
            f"descents of {', '.join(sorted(types))} for a simulator of {', '.join(sorted(known))}",
            expected="flights of the simulator's type",
            mend="choose the flights, or a simulator of their type",
        )


def check_count(real: Quantities, frame: pl.DataFrame, low: float, high: float) -> None:
    """Refuse too few flights on the grid (DataError).

    Example:
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> frame = pl.read_parquet("descents.parquet")
        >>> check_count(quantities_of(frame, 150, 340, CHANNELS).rows(torch.arange(5)), frame, 150, 340)
        Traceback (most recent call last):
        descentflow.core.errors.DataError: 5 flights with levels between FL150 and FL340 (of 120 given); ...
    """
    if len(real) < MIN_FLIGHTS:
        raise DataError(
            f"{len(real)} flights with levels between FL{low:.0f} and FL{high:.0f} "
            f"(of {frame['flight_id'].n_unique()} given)",
            expected=f"at least {MIN_FLIGHTS}, and hundreds to tell effects apart",
            mend="give more flights, or a simulator of their levels",
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
    return Quantities(reference.levels_fl, reference.band_fl, values, physics, reference.airframe)
