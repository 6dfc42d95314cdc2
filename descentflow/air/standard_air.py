"""Flights as they would have been in standard, still air: at the same CAS and drag, without the weather."""

from typing import TYPE_CHECKING

import polars as pl
import torch
from torch import Tensor

from descentflow.air.energy_in_air import drag_in_air, in_air
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.measurements.along_track import drift_cosine, level_part_kt
from descentflow.measurements.level_channels import LevelGrid
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.physics.energy import descent_rate_mps, inferred_drag_n
from descentflow.physics.idle_state import idle_state
from descentflow.physics.performance_model import PerformanceModel

if TYPE_CHECKING:
    from descentflow.air.measured_air import FlightAirs

CHANGED = ("vertical_rate", "TAS", "groundspeed", "geoaltitude", "track", "heading")
"""Channels that the air enters, or that are needed to take it out."""
SLOWEST_MPS = 0.5
"""Rates are taken as this fast for the height that a gap took: slower is no descent."""


def in_standard_air(
    frame: pl.DataFrame, aircraft: PerformanceModel, airs: "FlightAirs", levels_fl: Tensor
) -> pl.DataFrame:
    """Prepared descents brought to standard air: rate, times, TAS, groundspeed and geometric altitude.

    Both sides of a comparison that are brought there by their own airs differ by everything but the weather.

    Args:
        frame: Prepared descents; flights whose air is not known, and other levels, are left out.
        aircraft: Coefficients of their type.
        airs: On these levels.
        levels_fl: (L,) ascending whole flight levels.

    Example:
        >>> from descentflow.air.measured_air import measured_airs
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> frame, levels_fl = pl.read_parquet("descents.parquet"), torch.arange(150, 341).double()
        >>> airs = measured_airs(frame, levels_fl)
        >>> still = in_standard_air(frame, aircraft("A320"), airs, levels_fl)
        >>> abs(round((still["vertical_rate"] / frame["vertical_rate"].mean()).mean(), 1))
        1.0
    """
    low, high = float(levels_fl[0]), float(levels_fl[-1])
    frame = frame.filter(pl.col("flight_id").is_in(list(airs.flight_ids)))
    frame = frame.filter(pl.col("level_fl").is_between(low, high)).drop_nulls(["IAS", "vertical_rate", "time_s"])
    names = [name for name in CHANGED if name in frame.columns]
    grid = LevelGrid.of_frame(frame, low, high, ["IAS", *names])
    if grid is None:
        return frame
    place = {flight: i for i, flight in enumerate(airs.flight_ids)}
    air = airs.air.rows([place[flight] for flight in grid.flight_ids])
    altitude_m, seen = grid.altitude_m, grid.values
    cas = torch.where(grid.mask, seen["IAS"], 250.0) * KT_MPS
    rate = torch.where(grid.mask, seen["vertical_rate"] * FPM_MPS, -10.0)
    state = idle_state(aircraft, cas, altitude_m)
    implied = inferred_drag_n(aircraft, rate, state.thrust_n, state.tas_mps, state.energy_share, altitude_m)
    drag = drag_in_air(aircraft, cas, rate, implied, altitude_m, air)
    still = descent_rate_mps(aircraft, drag, state.thrust_n, state.tas_mps, state.energy_share, altitude_m)
    channels = {"vertical_rate": still / FPM_MPS, "time_s": _times(grid, rate, still)}
    if "TAS" in seen:
        change = in_air(aircraft, cas, altitude_m, air)
        channels["TAS"] = seen["TAS"] * change.standard_tas_mps / change.tas_mps
        if "groundspeed" in seen:
            before, after = (level_part_kt(each) * drift_cosine(each) for each in (seen, {**seen, **channels}))
            channels["groundspeed"] = seen["groundspeed"] - air.tailwind_mps / KT_MPS - before + after
    if "geoaltitude" in seen:
        warm = air.deviation_k / isa_temperature_k(altitude_m)
        steps = (warm[:, 1:] + warm[:, :-1]) / 2 * 100.0
        channels["geoaltitude"] = seen["geoaltitude"] - torch.nn.functional.pad(steps.cumsum(1), (1, 0))
    return _written(frame, grid, channels)


def _times(grid: LevelGrid, rate_mps: Tensor, still_mps: Tensor) -> Tensor:
    """Times (n, L) at levels; a gap changes by what its height alone takes."""
    legs = grid.legs()
    ratio = legs.mean(rate_mps / still_mps)
    by_height = legs.steps.double() * FL_M / legs.mean(rate_mps).abs().clamp(min=SLOWEST_MPS)
    in_gap = legs.elapsed_s + by_height * (ratio - 1)
    still = torch.where(legs.steps == 1, legs.elapsed_s * ratio, in_gap)
    climbed = torch.where(legs.there, still, 0.0).cumsum(1)
    top = torch.where(grid.mask, grid.time_s, torch.inf).amin(1, keepdim=True)
    return top + climbed[:, -1:] - climbed


def _written(frame: pl.DataFrame, grid: LevelGrid, channels: dict[str, Tensor]) -> pl.DataFrame:
    """The table with its channels replaced."""
    order = pl.DataFrame({"flight_id": list(grid.flight_ids), "_row": range(len(grid.flight_ids))})
    placed = frame.join(order, on="flight_id", maintain_order="left")
    row, level = placed["_row"].to_torch().long(), (placed["level_fl"].to_torch() - grid.levels_fl[0]).long()
    columns = [pl.Series(name, values[row, level].numpy()) for name, values in channels.items()]
    return placed.drop("_row").with_columns(column.fill_nan(None) for column in columns)
