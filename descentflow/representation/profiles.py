"""Descents as tensors on the flight-level grid, and the drag that BADA's equation needs to explain them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.errors import DataError
from descentflow.core.row_runs import numbered
from descentflow.core.tensors import Number
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.physics.energy import inferred_drag_n
from descentflow.physics.idle_state import idle_state
from descentflow.physics.performance_model import PerformanceModel

FLIGHTS_AT_ONCE = 4096
"""Flights whose drag is inferred at a time."""


@dataclass(frozen=True)
class Profiles:
    """CAS, rate and drag of n flights on L ascending levels; values where ``mask`` is false have no meaning.

    Shapes: ``levels_fl`` (L,), all else (n, L); float64. With ``air`` the drag was inferred in each flight's own air,
    without it in standard air.

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
    air: LevelAir | None = None
    fuel_flow_kg_s: Tensor | None = None
    """NaN where it is not known; None where no flight has any."""

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
            air=None if self.air is None else self.air.rows(chosen),
            fuel_flow_kg_s=None if self.fuel_flow_kg_s is None else self.fuel_flow_kg_s[chosen],
        )

    def between(self, bottom_fl: float, top_fl: float) -> "Profiles":
        """The same flights, on the levels from ``bottom_fl`` up to and including ``top_fl`` only."""
        low, high = int((self.levels_fl < bottom_fl).sum()), int((self.levels_fl <= top_fl).sum())
        return Profiles(
            self.flight_ids,
            self.levels_fl[low:high],
            self.time_s[:, low:high],
            self.cas_mps[:, low:high],
            self.rate_mps[:, low:high],
            self.drag_n[:, low:high],
            self.mask[:, low:high],
            None if self.air is None else self.air.levels(low, high),
            None if self.fuel_flow_kg_s is None else self.fuel_flow_kg_s[:, low:high],
        )


def drag_at_idle_n(
    aircraft: PerformanceModel,
    cas_mps: Tensor,
    rate_mps: Tensor,
    altitude_m: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
) -> Tensor:
    """Drag that makes BADA's rate equation give the observed rate at idle thrust (paper, equation 3).

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
        >>> drag_at_idle_n(aircraft("A320"), cas_mps, rate_mps, torch.tensor([6000.0, 6100.0])).round(decimals=-2)
        tensor([[37600., 37500.]])
    """
    state = idle_state(aircraft, cas_mps, altitude_m, deviation_k)
    return inferred_drag_n(
        aircraft, rate_mps, state.thrust_n, state.tas_mps, state.energy_share, altitude_m, deviation_k, mass_kg
    )


def profiles_from_frame(
    frame: pl.DataFrame,
    aircraft: PerformanceModel,
    bottom_fl: int,
    top_fl: int | None = None,
    mass_kg: Number | None = None,
) -> Profiles:
    """Tensors of a prepared table of descents (columns ``flight_id level_fl time_s IAS vertical_rate``).

    Args:
        frame: One row per flight and level, as ``descentflow prepare`` writes it; it may have ``fuel_flow``.
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
    burns = "fuel_flow" in frame.columns and not frame["fuel_flow"].is_null().all()
    frame = frame.select("flight_id", "level_fl", "time_s", "IAS", "vertical_rate", *(["fuel_flow"] if burns else []))
    on_grid = frame["level_fl"].is_between(bottom_fl, int(highest))
    if not on_grid.any():
        raise DataError(
            f"no descent between FL{bottom_fl} and FL{highest}",
            expected="at least one flight with levels on the grid",
            mend="choose another bottom level, or prepare other rows",
        )
    if not on_grid.all():
        frame = frame.filter(on_grid)
    flight_ids, row = numbered(frame["flight_id"])
    levels = torch.arange(bottom_fl, int(highest) + 1, dtype=torch.float64)
    index = (row, frame["level_fl"].to_numpy() - bottom_fl)
    mask = _scatter(np.ones(len(frame), dtype=bool), index, len(flight_ids), len(levels))
    time_s, cas_kt, rate_fpm = (
        _scatter(frame[name].to_numpy().astype(np.float64, copy=False), index, len(flight_ids), len(levels))
        for name in ("time_s", "IAS", "vertical_rate")
    )
    # A plausible speed keeps the arithmetic finite at missing levels; the mask hides the result.
    cas_mps = cas_kt.masked_fill_(~mask, 250.0).mul_(KT_MPS)
    rate_mps = rate_fpm.mul_(FPM_MPS)
    profiles = profiles_with_drag(aircraft, tuple(flight_ids), levels, time_s, cas_mps, rate_mps, mask, mass_kg)
    if not burns:
        return profiles
    flow = frame["fuel_flow"].cast(pl.Float64).fill_null(float("nan")).to_numpy()
    return replace(profiles, fuel_flow_kg_s=_scatter(flow, index, len(flight_ids), len(levels)))


def profiles_with_drag(
    aircraft: PerformanceModel,
    flight_ids: tuple[str, ...],
    levels_fl: Tensor,
    time_s: Tensor,
    cas_mps: Tensor,
    rate_mps: Tensor,
    mask: Tensor,
    mass_kg: Number | None = None,
) -> Profiles:
    """Profiles with the drag that what was observed implies.

    Args:
        aircraft: Coefficients.
        flight_ids: Of n flights.
        levels_fl: (L,).
        time_s: (n, L), and so are all that follow.
        cas_mps: Positive where masked, too.
        rate_mps: Negative in descent.
        mask: Observed.
        mass_kg: One for all flights; the reference mass if absent.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> levels_fl = torch.arange(250.0, 351.0).double()
        >>> cas, rate = torch.full((1, 101), 140.0).double(), torch.full((1, 101), -10.0).double()
        >>> seen = torch.ones_like(cas, dtype=torch.bool)
        >>> one = profiles_with_drag(aircraft("A320"), ("a",), levels_fl, 0 * cas, cas, rate, seen)
        >>> one.drag_n.shape
        torch.Size([1, 101])
    """
    altitude_m = levels_fl * FL_M
    # Flights are independent: in blocks, the steps of the equation need no memory for all flights at once.
    drag = []
    for start in range(0, len(mask), FLIGHTS_AT_ONCE):
        part = slice(start, start + FLIGHTS_AT_ONCE)
        found_n = drag_at_idle_n(aircraft, cas_mps[part], rate_mps[part], altitude_m, mass_kg)
        drag.append(torch.where(mask[part], found_n, 0.0))
    return Profiles(flight_ids, levels_fl, time_s, cas_mps, rate_mps, torch.cat(drag), mask)


def _scatter(values: np.ndarray, index: tuple[np.ndarray, np.ndarray], n: int, n_levels: int) -> Tensor:
    grid = np.zeros((n, n_levels), dtype=values.dtype)
    grid[index] = values
    return torch.from_numpy(grid)
