"""From prepared descents to what is compared: quantities of each flight in bands of altitude.

Simulator and flights go through the same code here, so smoothing, quantisation and gaps act on both alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.row_runs import first_rows
from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.measurements.along_track import FOR_AIR, drift_cosine, induced_by_turns, level_part_kt, speed_by_air_kt
from descentflow.measurements.level_channels import EDGE_LEVELS, LevelGrid, gaps_of, short_scale_noise
from descentflow.measurements.quantity_registry import CHANNELS, QUANTITIES
from descentflow.physics.airspeed import mach_to_cas_mps, mach_to_tas_mps

VERSION = 6
"""Of the state that checkpoints carry."""
EARLIER = (2, 3, 4, 5)
"""Versions that did not measure what the air adds to speed, or turns, and measured all else but noise alike."""
OTHER_NOISE = (2, 3)
"""Versions that measured noise otherwise."""
N_BANDS = 15
"""About this many bands cover the grid; each is a multiple of 500 ft high."""
MAX_REFERENCE = 2000
"""Flights of a reference that a checkpoint carries at most."""


@dataclass(frozen=True)
class Quantities:
    """n flights: ``values`` by quantity, (n, K) or (n,), NaN where not seen; what physics needs besides them.

    ``log_rate`` is the logarithm of the reported rate (m/s), of which `rate` will be what the polar does not explain;
    ``cas_mps``, ``cas_slope_per_s``, ``tailwind_mps`` (n, K); ``rate_slope_per_m`` (n, K) d ln(reported rate)/dHp
    between the edges of a band, NaN where they are not seen; ``depth_m`` (n, K) below the flight's own highest level;
    ``turning`` (n, K), where headings or tracks are reported, the share by which turns raise induced drag;
    ``air_slope_per_s`` (n, K), where groundspeed, track and heading are, the growth of
    :func:`~descentflow.measurements.along_track.speed_by_air_kt` with altitude, NaN where it is not seen;
    ``airframe`` (n,) number of the aircraft.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> len(flights), flights.band_fl, flights.values["cas"].shape
        (120, 15.0, torch.Size([120, 13]))
        >>> len(flights.rows(flights.airframe == 0))  # of one aircraft
        5
    """

    levels_fl: tuple[float, float]
    """Lowest and highest level of the grid."""
    band_fl: float
    """Height of a band."""
    values: dict[str, Tensor]
    physics: dict[str, Tensor]
    airframe: Tensor
    names: tuple[str, ...] = ()
    """Identifiers of the flights; empty where none is kept, as in a checkpoint."""
    day: Tensor | None = None
    """(n,) number of the day on which each began; unknown where absent."""

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.airframe)

    @property
    def known_day(self) -> Tensor:
        """(n,) ``day``; where days are not known, an aircraft's flights count as of one day of their own."""
        return self.airframe if self.day is None else self.day

    @property
    def altitude_m(self) -> Tensor:
        """(K,) middles of the bands."""
        low, high = self.levels_fl
        count = max(round((high - low) / self.band_fl), 1)
        return (low + self.band_fl * (torch.arange(count, dtype=torch.float64) + 0.5)) * FL_M

    def rows(self, index: Tensor) -> "Quantities":
        """The flights at these positions, or where a mask is true."""
        return replace(
            self,
            values={name: value[index] for name, value in self.values.items()},
            physics={name: value[index] for name, value in self.physics.items()},
            airframe=self.airframe[index],
            day=None if self.day is None else self.day[index],
            names=tuple(self.names[i] for i in torch.arange(len(self))[index].tolist()) if self.names else (),
        )

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives for a checkpoint, single precision; no flight is named."""
        return {
            "version": VERSION,
            "levels_fl": list(self.levels_fl),
            "band_fl": self.band_fl,
            "values": {name: value.float() for name, value in self.values.items()},
            "physics": {name: value.float() for name, value in self.physics.items()},
            "cluster": self.airframe.int(),
            **({} if self.day is None else {"day": self.day.int()}),
        }

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "Quantities":
        """Rebuild from :meth:`to_state`; without what another version did not measure, or measured otherwise.

        Noise is then not compared, and how the flights turned, or what their air added to speed, is not known.

        Raises:
            KeyError: If the state is of another version.
        """
        if state["version"] not in (*EARLIER, VERSION):
            raise KeyError(f"reference of version {state['version']}")
        if state["version"] in OTHER_NOISE:
            kept = {name: value for name, value in state["values"].items() if not QUANTITIES[name].is_noise}
            state = {**state, "values": kept}
        return cls(
            (float(state["levels_fl"][0]), float(state["levels_fl"][1])),
            float(state["band_fl"]),
            {name: value.double() for name, value in state["values"].items()},
            {name: value.double() for name, value in state["physics"].items()},
            state["cluster"].long(),
            day=state["day"].long() if "day" in state else None,
        )


def band_height_fl(low_fl: float, high_fl: float) -> float:
    """Height of the bands of a grid, in flight levels, a multiple of 5.

    Example:
        >>> band_height_fl(150, 370)
        15.0
    """
    return max(5.0, 5.0 * round((high_fl - low_fl) / N_BANDS / 5.0))


def quantities_of(frame: pl.DataFrame, low_fl: float, high_fl: float, channels: Sequence[str]) -> Quantities:
    """Measure every flight of a prepared table, see :func:`grid_of`.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS).values["tas"].shape
        torch.Size([120, 13])
    """
    return checked(measured(grid_of(frame, low_fl, high_fl, channels)))


def grid_of(frame: pl.DataFrame, low_fl: float, high_fl: float, channels: Sequence[str]) -> LevelGrid:
    """Flights of a prepared table on the levels of a simulator.

    Args:
        frame: One row a flight and level, as ``descentflow prepare`` writes it.
        low_fl: Lowest level of the simulator's grid.
        high_fl: Highest level of it.
        channels: Channels to use; those that the table lacks are left out.

    Raises:
        DataError: If no flight has a level on the grid.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> grid.mask.shape, len(grid.flight_ids)
        (torch.Size([120, 191]), 120)
    """
    grid = LevelGrid.of_frame(frame, low_fl, high_fl, [c for c in channels if c in frame.columns])
    if grid is None:
        raise DataError(
            f"no descent between FL{low_fl:g} and FL{high_fl:g}",
            expected="flights with levels on the simulator's grid",
            mend="prepare with another --bottom-fl, or use a simulator of this grid",
        )
    return grid


def checked(quantities: Quantities) -> Quantities:
    """The same, unless no flight is left.

    Raises:
        DataError: If none is.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> len(checked(quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)))
        120
    """
    if not len(quantities):
        raise DataError(
            f"no flight with enough levels in a band of {100 * quantities.band_fl:g} ft",
            expected="flights with levels on the simulator's grid",
            mend="prepare with another --bottom-fl, or use a simulator of this grid",
        )
    return quantities


def measured(grid: LevelGrid, band_fl: float | None = None) -> Quantities:
    """Quantities of flights on levels; those without a band are left out.

    Args:
        grid: The flights.
        band_fl: Height of a band; about a fifteenth of the grid's if absent.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = grid_of(read_descents("descents.parquet").frame, 150, 340, ["IAS", "vertical_rate"])
        >>> "tas" in measured(grid).values  # needs true airspeed and Mach number
        False
    """
    low_fl, high_fl = float(grid.levels_fl[0]), float(grid.levels_fl[-1])
    band = band_height_fl(low_fl, high_fl) if band_fl is None else band_fl
    bands = grid.bands(band)
    cas_kt = grid.values["IAS"]
    # The mean of the rate and not of its logarithm: noise would pull that down.
    fall_mps = -grid.values["vertical_rate"] * FPM_MPS
    reported, crossed = bands.rates_mps(fall_mps)
    log_rate = reported.log()
    cas = torch.where(log_rate.isfinite(), bands.mean(cas_kt), torch.nan)
    changed = bands.change(cas_kt, fewest=2 * EDGE_LEVELS + 1) / (band * FL_M)
    physics = {
        "log_rate": log_rate,
        "cas_mps": cas * KT_MPS,
        # By the change over the band: a line through more is off by a tenth of the rate at the crossover.
        "cas_slope_per_s": torch.where(changed.isfinite(), changed, bands.slope(cas_kt)) * KT_MPS,
        "rate_slope_per_m": bands.change(fall_mps) / (reported * band * FL_M),
        "depth_m": bands.depth_m(),
    }
    values = {"lag": log_rate - crossed.log(), "cas": cas}
    seen = grid.values
    if "Mach" in seen:
        values["mismatch"] = bands.mean(cas_kt - mach_to_cas_mps(seen["Mach"], grid.altitude_m) / KT_MPS)
    tailwind = torch.zeros_like(cas)
    if "TAS" in seen and "Mach" in seen:
        standard = mach_to_tas_mps(seen["Mach"], grid.altitude_m) / KT_MPS
        values["tas"] = bands.mean((seen["TAS"] / standard).log())
    if "TAS" in seen and "groundspeed" in seen:
        tailwind = bands.mean(seen["groundspeed"] - level_part_kt(seen) * drift_cosine(seen)) * KT_MPS
        values["wind"] = _centred(tailwind)
    if "geoaltitude" in seen:
        values["height"] = _centred(bands.mean(seen["geoaltitude"] * FT_M - grid.altitude_m))
    physics["tailwind_mps"] = tailwind.nan_to_num(0.0)
    if all(channel in seen for channel in FOR_AIR):
        by_air = speed_by_air_kt(seen, grid.altitude_m)
        steep, around = bands.change(by_air) / (band * FL_M), bands.slope(by_air)
        steep = torch.where(steep.isfinite() | (around == 0.0), steep, around)
        physics["air_slope_per_s"] = torch.where(log_rate.isfinite(), steep, torch.nan) * KT_MPS
    turning = induced_by_turns(grid)
    if turning is not None:
        physics["turning"] = bands.mean(turning)
    values |= short_scale_noise(grid) | gaps_of(grid)
    good = log_rate.isfinite().any(1)
    return Quantities((low_fl, high_fl), band, values, physics, grid.airframe, grid.flight_ids, grid.day).rows(good)


def reference_state(
    frame: pl.DataFrame, low_fl: float, high_fl: float, flights: Sequence[str]
) -> dict[str, Any] | None:
    """State of the flights that a simulator was trained on, for its checkpoint; None if they show no band.

    Flights beyond :data:`MAX_REFERENCE` are left out before anything is measured, by whole aircraft, by a draw that
    depends on nothing but which aircraft there are.

    Args:
        frame: Prepared descents.
        low_fl: Lowest level of the simulator's grid.
        high_fl: Highest level of it.
        flights: Those of the table that it was trained on.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> frame = read_descents("descents.parquet").frame
        >>> state = reference_state(frame, 150, 340, frame["flight_id"].unique().to_list())
        >>> len(Quantities.from_state(state))
        120
    """
    try:
        return quantities_of(of_some_aircraft(frame, flights), low_fl, high_fl, CHANNELS).to_state()
    except DataError:
        return None


def of_some_aircraft(frame: pl.DataFrame, among: Sequence[str] | None = None, most: int | None = None) -> pl.DataFrame:
    """Flights of aircraft drawn until there are so many; all of them if they are no more.

    Args:
        frame: Prepared descents.
        among: Flights of it to draw from; all if absent.
        most: Flights; :data:`MAX_REFERENCE` if absent.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> of_some_aircraft(frame, most=12)["icao24"].n_unique()  # whole aircraft of five flights, the last one cut
        3
    """
    flights = first_rows(frame.select("flight_id", "icao24"), "flight_id")
    flights = flights.with_columns(pl.col("icao24").fill_null("")).sort("icao24", "flight_id")
    if among is not None:
        flights = flights.filter(pl.col("flight_id").is_in(list(among)))
    most = MAX_REFERENCE if most is None else most
    if len(flights) <= most:
        return frame.filter(pl.col("flight_id").is_in(flights["flight_id"].implode()))
    aircraft = flights["icao24"].unique().sort()
    place = pl.Series(np.random.default_rng(0).permutation(len(aircraft)))
    drawn = flights.join(pl.DataFrame({"icao24": aircraft, "place": place}), on="icao24").sort("place", "flight_id")
    return frame.filter(pl.col("flight_id").is_in(drawn["flight_id"].head(most).implode()))


def _centred(values: Tensor) -> Tensor:
    """Values (n, K) minus each flight's mean over what is seen."""
    return values - values.nanmean(1, keepdim=True)
