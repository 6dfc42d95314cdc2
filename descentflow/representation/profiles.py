"""Descents as tensors on the flight-level grid, and the drag that BADA's equation needs to explain them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.errors import DataError
from descentflow.core.tensors import Number
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.physics.energy import inferred_drag_n
from descentflow.physics.idle_state import idle_state

BLOCK = 4096
"""Flights whose drag is inferred at a time."""


@dataclass(frozen=True)
class Profiles:
    """CAS, rate and drag of n flights on L ascending levels; values where ``mask`` is false have no meaning.

    Shapes: ``levels_fl`` (L,), all else (n, L); float64.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> profiles = profiles_from_frame(pl.read_parquet("descents.parquet"), aircraft("A320"), bottom_fl=150)
        >>> profiles.cas_mps.shape, profiles.subset([0, 3]).cas_mps.shape
        (torch.Size([120, 234]), torch.Size([2, 234]))
    """

    flight_ids: tuple[str, ...]
    levels_fl: Tensor
    time_s: Tensor
    cas_mps: Tensor
    rate_mps: Tensor
    drag_n: Tensor
    mask: Tensor

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.flight_ids)

    @property
    def altitude_m(self) -> Tensor:
        """Pressure altitude of the levels (L,)."""
        return self.levels_fl * FL_M

    @property
    def entry_level(self) -> Tensor:
        """Index of each flight's highest observed level (n,)."""
        n_levels = self.mask.shape[1]
        return n_levels - 1 - self.mask.flip(1).to(torch.int8).argmax(1)

    def subset(self, index: Sequence[int] | Tensor) -> "Profiles":
        """The flights at these positions."""
        chosen = torch.as_tensor(index, dtype=torch.long)
        return Profiles(
            tuple(self.flight_ids[i] for i in chosen.tolist()),
            self.levels_fl,
            self.time_s[chosen],
            self.cas_mps[chosen],
            self.rate_mps[chosen],
            self.drag_n[chosen],
            self.mask[chosen],
        )

    def up_to(self, top_fl: int) -> "Profiles":
        """The same flights, on the levels up to and including ``top_fl`` only."""
        n = int((self.levels_fl <= top_fl).sum())
        return Profiles(
            self.flight_ids,
            self.levels_fl[:n],
            *(values[:, :n] for values in (self.time_s, self.cas_mps, self.rate_mps, self.drag_n, self.mask)),
        )


def infer_drag_n(
    aircraft: Aircraft,
    cas_mps: Tensor,
    rate_mps: Tensor,
    altitude_m: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
) -> Tensor:
    """Drag that makes BADA's rate equation give the observed rate (paper, equation 3).

    Args:
        aircraft: Coefficients.
        cas_mps: (n, L) calibrated airspeed, from IAS (paper, section 2.2: instrument error neglected).
        rate_mps: (n, L) rate of pressure altitude, negative in descent.
        altitude_m: (L,) pressure altitude.
        mass_kg: Mass; the type's reference mass if absent, as in the paper.
        deviation_k: ISA temperature deviation; 0 in the paper.

    Returns:
        (n, L) drag.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> cas_mps, rate_mps = torch.full((1, 2), 150.0), torch.full((1, 2), -10.0)
        >>> infer_drag_n(aircraft("A320"), cas_mps, rate_mps, torch.tensor([6000.0, 6100.0])).round(decimals=-2)
        tensor([[37600., 37500.]])
    """
    state = idle_state(aircraft, cas_mps, altitude_m, deviation_k)
    return inferred_drag_n(
        aircraft, rate_mps, state.thrust_n, state.tas_mps, state.energy_share, altitude_m, deviation_k, mass_kg
    )


def profiles_from_frame(
    frame: pl.DataFrame,
    aircraft: Aircraft,
    bottom_fl: int,
    top_fl: int | None = None,
    mass_kg: Number | None = None,
) -> Profiles:
    """Tensors of a prepared table of descents (columns ``flight_id level_fl time_s IAS vertical_rate``).

    Args:
        frame: One row per flight and level, as ``descentflow prepare`` writes it.
        aircraft: Coefficients for the drag.
        bottom_fl: Lowest level of the grid.
        top_fl: Highest level of the grid; the highest in the table if absent. Flights without a level on the
            grid are not among the profiles.
        mass_kg: Mass for the drag, one for all flights; the reference mass if absent.

    Raises:
        DataError: If no flight has a level on the grid.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> frame = pl.read_parquet("descents.parquet")
        >>> profiles = profiles_from_frame(frame, aircraft("A320"), bottom_fl=150, top_fl=350)
        >>> len(profiles), int(profiles.levels_fl[-1])
        (120, 350)
    """
    highest = frame["level_fl"].to_numpy().max(initial=bottom_fl) if top_fl is None else top_fl
    # Only what is read: the join below copies every row, of which there are millions.
    frame = frame.select("flight_id", "level_fl", "time_s", "IAS", "vertical_rate")
    frame = frame.filter(pl.col("level_fl").is_between(bottom_fl, int(highest)))
    if frame.is_empty():
        raise DataError(
            f"no descent between FL{bottom_fl} and FL{highest}",
            expected="at least one flight with levels on the grid",
            mend="choose another bottom level, or prepare other rows",
        )
    flight_ids = frame["flight_id"].unique().sort()
    position = pl.DataFrame({"flight_id": flight_ids, "row": np.arange(len(flight_ids))})
    placed = frame.join(position, on="flight_id")
    levels = torch.arange(bottom_fl, int(highest) + 1, dtype=torch.float64)
    index = (placed["row"].to_numpy(), placed["level_fl"].to_numpy() - bottom_fl)
    mask = _scatter(np.ones(len(placed), dtype=bool), index, len(flight_ids), len(levels))
    time_s, cas_kt, rate_fpm = (
        _scatter(placed[name].to_numpy().astype(np.float64), index, len(flight_ids), len(levels))
        for name in ("time_s", "IAS", "vertical_rate")
    )
    # A plausible speed keeps the arithmetic finite at missing levels; the mask hides the result.
    cas_mps = torch.where(mask, cas_kt, 250.0) * KT_MPS
    rate_mps = rate_fpm * FPM_MPS
    # Flights are independent: in blocks, the steps of the equation need no memory for all flights at once.
    blocks = zip(torch.split(cas_mps, BLOCK), torch.split(rate_mps, BLOCK), strict=True)
    drag_n = torch.cat([infer_drag_n(aircraft, cas, rate, levels * FL_M, mass_kg) for cas, rate in blocks])
    return Profiles(tuple(flight_ids), levels, time_s, cas_mps, rate_mps, torch.where(mask, drag_n, 0.0), mask)


def _scatter(values: np.ndarray, index: tuple[np.ndarray, np.ndarray], n: int, n_levels: int) -> Tensor:
    grid = np.zeros((n, n_levels), dtype=values.dtype)
    grid[index] = values
    return torch.from_numpy(grid)
