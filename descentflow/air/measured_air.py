"""The air of flights as their own reports have it."""

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.air_reports import AirReports, tailwind_reports, temperature_reports
from descentflow.air.air_smoother import AirSmoother
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import DataError
from descentflow.measurements.level_channels import LevelGrid

CHANNELS = ("IAS", "vertical_rate", "TAS", "Mach", "groundspeed", "track", "heading")
"""What of the reports says something of the air, or is needed to place it."""


@dataclass(frozen=True)
class FlightAirs:
    """The airs of those flights of which something is known.

    Attributes:
        flight_ids: (m,) identifiers.
        air: (m, L) on the levels asked for.
        deviation_error_k: (m, L) standard error of the temperature.
        growth_error_per_s: (m, L) standard error of the wind's growth with height, m/s per m.
        without: Flights of which nothing is known.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> airs = measured_airs(frame, torch.arange(150, 341), learnt_air(frame, 150, 340))
        >>> len(airs.flight_ids), airs.without, airs.air.deviation_k.shape
        (120, 0, torch.Size([120, 191]))
    """

    flight_ids: tuple[str, ...]
    air: LevelAir
    deviation_error_k: Tensor
    growth_error_per_s: Tensor
    without: int


@dataclass(frozen=True)
class MeasuredAir:
    """How reports become profiles of the air: spreads learnt from training flights.

    Attributes:
        temperature: Of the temperature deviation, K.
        wind: Of the wind along the track, m/s; None where no flight reported its groundspeed: still air.

    Example:
        >>> found = learnt_air(pl.read_parquet("descents.parquet"), 150, 340)
        >>> MeasuredAir.from_state(found.to_state()) == found
        True
    """

    temperature: AirSmoother
    wind: AirSmoother | None

    def to_state(self) -> dict[str, dict[str, float]]:
        """Numbers for a checkpoint."""
        state = {"temperature": asdict(self.temperature)}
        return state if self.wind is None else {**state, "wind": asdict(self.wind)}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "MeasuredAir":
        """Rebuild from :meth:`to_state`; KeyError if a number is not there."""
        names = [field.name for field in fields(AirSmoother)]
        wind = state.get("wind")
        parts = [None if one is None else AirSmoother(*(float(one[n]) for n in names))
                 for one in (state["temperature"], wind)]  # fmt: skip
        assert parts[0] is not None
        return cls(parts[0], parts[1])


def learnt_air(frame: pl.DataFrame, low_fl: float, high_fl: float) -> MeasuredAir:
    """Learn how the air changes along flights, from their reports.

    Args:
        frame: Prepared descents, the training flights alone.
        low_fl: Lowest level.
        high_fl: Highest.

    Raises:
        DataError: If no flight reports true airspeed.

    Example:
        >>> learnt_air(pl.read_parquet("descents.parquet"), 150, 340).temperature.noise < 3.0  # K, of 500 ft
        True
    """
    grid = _grid(frame, low_fl, high_fl)
    temperature, wind = (None, None) if grid is None else (temperature_reports(grid), tailwind_reports(grid))
    if temperature is None:
        raise DataError(
            "descents without true airspeed (TAS)",
            expected="reports of TAS, with a Mach number or IAS, for an air as it was measured",
            mend="prepare rows with Mode S reports, name a weather file, or use data.air=standard",
        )
    return MeasuredAir(AirSmoother.learnt(temperature), None if wind is None else AirSmoother.learnt(wind))


def measured_airs(frame: pl.DataFrame, levels_fl: Tensor, known: MeasuredAir) -> FlightAirs:
    """The air of each flight on levels, by its own reports; flights that do not report it are counted.

    Args:
        frame: Prepared descents.
        levels_fl: (L,) ascending whole flight levels.
        known: How the air changes along flights.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> known = learnt_air(frame, 150, 340)
        >>> silent = frame.with_columns(TAS=pl.when(pl.col("flight_id") != "A320-0-00003").then("TAS"))
        >>> measured_airs(silent, torch.arange(150, 341), known).without
        1
    """
    grid = _grid(frame, float(levels_fl[0]), float(levels_fl[-1]))
    none = torch.zeros(0, len(levels_fl), dtype=torch.float64)
    if grid is None:
        return FlightAirs((), LevelAir(none, none), none, none, 0)
    altitude_m, n = grid.altitude_m, len(grid.flight_ids)
    parts: list[tuple[AirSmoother, AirReports | None]] = [(known.temperature, temperature_reports(grid))]
    if known.wind is not None:
        parts.append((known.wind, tailwind_reports(grid)))
    if any(reports is None for _, reports in parts):
        return FlightAirs((), LevelAir(none, none), none, none, n)
    found = [smoother.smooth(reports, altitude_m) for smoother, reports in parts if reports is not None]
    told = found[0].flights
    for one in found[1:]:
        told = told[torch.isin(told, one.flights)]
    temperature, *wind = [(one, torch.isin(one.flights, told)) for one in found]
    still = torch.zeros(len(told), len(levels_fl), dtype=torch.float64)
    tailwind = wind[0][0].values[wind[0][1]] if wind else still
    growth_error = wind[0][0].slope_error_per_m[wind[0][1]] if wind else still
    names = tuple(grid.flight_ids[i] for i in told.tolist())
    deviation, chosen = temperature
    air = LevelAir(deviation.values[chosen], tailwind)
    return FlightAirs(names, air, deviation.error[chosen], growth_error, n - len(told))


def _grid(frame: pl.DataFrame, low_fl: float, high_fl: float) -> LevelGrid | None:
    """The flights' reports, numbers that are not finite left out."""
    names = [name for name in CHANNELS if name in frame.columns]
    frame = frame.with_columns(pl.col(name).cast(pl.Float64).replace(np.inf, None).fill_nan(None) for name in names)
    return LevelGrid.of_frame(frame, low_fl, high_fl, names)
