"""The air of flights as their own reports have it, on levels and as a table."""

from dataclasses import dataclass

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.air_reports import tailwind_reports, temperature_reports
from descentflow.air.air_smoother import DEPARTURE_K, DEPARTURE_MPS, smoothed
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import DataError
from descentflow.core.units import KT_MPS
from descentflow.measurements.level_channels import LevelGrid

CHANNELS = ("IAS", "vertical_rate", "TAS", "Mach", "groundspeed", "track", "heading")
"""Reported quantities that measure the air, or that place it."""
MAX_ERROR_K = 10.0
"""Standard error beyond which a temperature is not known: 2.5 % of the rate of descent, as one report of it errs."""
MAX_GROWTH_ERROR_PER_S = 0.0017
"""The same of the wind's growth, 1 kt for each 1,000 ft: 2.5 to 4 % of the rate."""


@dataclass(frozen=True)
class FlightAirs:
    """The airs of those flights of which something is known.

    Attributes:
        flight_ids: (m,) identifiers.
        air: (m, L) on the levels asked for.
        known: (m, L) where it is known well enough to infer drag in it; elsewhere it is held.
        deviation_error_k: (m, L) standard error of the temperature.
        growth_error_per_s: (m, L) standard error of the wind's growth with height, m/s per m.
        tailwind_error_mps: (m, L) standard error of the wind itself.
        without: Flights of which nothing is known.
        wind: Whether the wind is known; still air if not.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> airs = measured_airs(frame, torch.arange(150, 341))
        >>> len(airs.flight_ids), airs.without, airs.air.deviation_k.shape
        (120, 0, torch.Size([120, 191]))
    """

    flight_ids: tuple[str, ...]
    air: LevelAir
    known: Tensor
    deviation_error_k: Tensor
    growth_error_per_s: Tensor
    tailwind_error_mps: Tensor
    without: int
    wind: bool = True


def measured_airs(frame: pl.DataFrame, levels_fl: Tensor, *, wind: bool | None = None) -> FlightAirs:
    """The air of each flight on levels, by its own reports; flights that do not report it are counted.

    Outside of the levels where it is known well enough, it is held.

    Args:
        frame: Prepared descents; how far their reports scatter is learnt from them.
        levels_fl: (L,) ascending whole flight levels.
        wind: Whether flights must report the wind; if absent, where any of them does. If not, the air is still.

    Raises:
        DataError: If no flight reports its air.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> silent = frame.with_columns(TAS=pl.when(pl.col("flight_id") != "A320-0-00003").then("TAS"))
        >>> measured_airs(silent, torch.arange(150, 341)).without
        1
    """
    grid = _grid(frame, float(levels_fl[0]), float(levels_fl[-1]))
    needed = {"TAS", "groundspeed"} if wind else {"TAS"}
    if grid is None or not needed <= grid.values.keys():
        raise DataError(
            f"descents without true airspeed (TAS){' and groundspeed' if wind else ''}",
            expected="reports of TAS, with a Mach number or IAS, and of groundspeed, for an air as it was measured",
            mend="prepare rows with Mode S reports, or fit with data.air=standard",
        )
    blows = wind is not False and "groundspeed" in grid.values
    warm = smoothed(temperature_reports(grid), DEPARTURE_K, grid.altitude_m)
    blown = smoothed(tailwind_reports(grid), DEPARTURE_MPS, grid.altitude_m) if blows else warm.still()
    both = warm.flights[torch.isin(warm.flights, blown.flights)]
    warm, blown = warm.of(both), blown.of(both)
    known = (warm.error <= MAX_ERROR_K) & (blown.slope_error_per_m <= MAX_GROWTH_ERROR_PER_S)
    names = tuple(grid.flight_ids[i] for i in both.tolist())
    air = LevelAir(held(warm.values, known), held(blown.values, known))
    without = len(grid.flight_ids) - len(both)
    return FlightAirs(names, air, known, warm.error, blown.slope_error_per_m, blown.error, without, blows)


def held(values: Tensor, known: Tensor) -> Tensor:
    """Values (n, L) with those that are not known replaced by the nearest that is; zero where none is."""
    number = torch.arange(values.shape[1]).expand(values.shape)
    below = torch.where(known, number, -1).cummax(1).values
    above = torch.where(known, number, values.shape[1]).flip(1).cummin(1).values.flip(1)
    nearest = torch.where((below < 0) | ((above - number < number - below) & (above < values.shape[1])), above, below)
    nearest_known = values.gather(1, nearest.clamp(0, values.shape[1] - 1))
    return torch.where(known.any(1, keepdim=True), nearest_known, 0.0)


def _grid(frame: pl.DataFrame, low_fl: float, high_fl: float) -> LevelGrid | None:
    """The flights' reports, numbers that are not finite left out."""
    names = [name for name in CHANNELS if name in frame.columns]
    frame = frame.with_columns(pl.col(name).cast(pl.Float64).replace(np.inf, None).fill_nan(None) for name in names)
    return LevelGrid.of_frame(frame, low_fl, high_fl, names)


STEP_FL = 10
"""Between rows of a flight: air is known in bands of 500 ft, and smooth."""
PLACES = ("latitude", "longitude", "track")


def air_table(frame: pl.DataFrame) -> pl.DataFrame:
    """Temperature and wind of flights by their own reports, where both are known well enough to fly in.

    Args:
        frame: Prepared descents with TAS, and groundspeed for the wind.

    Returns:
        A row for each flight and 1,000 ft: ``flight_id timestamp level_fl``, the place where rows have it,
        ``deviation_k`` (from the standard atmosphere) with ``deviation_error_k``, and ``tailwind`` (kt along the track)
        with ``tailwind_error``. Errors are standard errors; the wind is missing where no groundspeed is reported.

    Raises:
        DataError: If no flight reports its air.

    Example:
        >>> table = air_table(pl.read_parquet("descents.parquet"))
        >>> table["flight_id"].n_unique(), bool((table["deviation_error_k"] < 10).all())
        (120, True)
    """
    low, high = frame["level_fl"].to_numpy().min(), frame["level_fl"].to_numpy().max()
    levels = torch.arange(int(low), int(high) + 1)
    airs = measured_airs(frame, levels)
    shown = airs.known & (levels % STEP_FL == 0)
    row, level = torch.nonzero(shown, as_tuple=True)
    wind = {"tailwind": airs.air.tailwind_mps / KT_MPS, "tailwind_error": airs.tailwind_error_mps / KT_MPS}
    values = {"deviation_k": airs.air.deviation_k, "deviation_error_k": airs.deviation_error_k, **wind}
    table = pl.DataFrame(
        {
            "flight_id": [airs.flight_ids[i] for i in row.tolist()],
            "level_fl": pl.Series(levels[level].numpy()).cast(frame.schema["level_fl"]),
            **{name: value[row, level].numpy() for name, value in values.items()},
        }
    )
    if not airs.wind:
        table = table.with_columns(pl.lit(None, pl.Float64).alias(name) for name in wind)
    # Levels that a flight skipped have no time of their own.
    place = [name for name in PLACES if name in frame.columns]
    seen = frame.select("flight_id", "timestamp", "level_fl", *place)
    return seen.join(table, on=["flight_id", "level_fl"], maintain_order="left")
