r"""Temperature and wind along the track, from an aircraft's reports, with their errors.

True airspeed and Mach number give the temperature, :math:`T = (V / M)^2 / (\kappa R)`; where no Mach number is
reported, it is that of the calibrated airspeed. Groundspeed, true airspeed, track and heading give the wind along the
track, :math:`w = V_g - \sqrt{V^2 - \dot h^2} \cos(\psi - \chi)`.

Reports are rounded, and the rounding of a value that hardly changes is an error that stays: a Mach number of 0.78 in
steps of 0.004 may be wrong by 0.002 for ten minutes, which is 1.1 K. So the error of a run of equal reports is one
error of :math:`s^2 / 12` for the whole run (s: the step), shared by its levels. Where the value passes through the step
from one side to the other, its n reports spread over the step evenly, and their mean is wrong by :math:`s / n` at most:
:math:`s^2 / (12 n^2)`.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.mode_s_steps import STEPS
from descentflow.core.units import KT_MPS
from descentflow.measurements.along_track import drift_cosine, level_part_kt
from descentflow.measurements.level_channels import LevelGrid
from descentflow.physics.airspeed import cas_to_mach
from descentflow.physics.atmosphere import isa_temperature_k

BAND_LEVELS = 5
"""Levels whose reports are averaged to one observation: 500 ft, less than air changes in and more than one report."""
MIN_IN_BAND = 2
"""Levels that must be reported there."""
MAX_DEVIATION_K, MAX_WIND_MPS = 40.0, 130.0
"""Temperature deviation and wind beyond which a report is wrong: air on earth has neither."""
WINDOW = 3
"""Bands on either side, with whose median a band is compared."""
OUTLIER = 4.0
"""Robust standard deviations that it may be away: one of 16,000 normal ones (Hampel's identifier)."""
ReportedChannel = tuple[Tensor, float, Tensor]
"""Values (n, L) of a channel, the step of its reports, and the weight (n, L) of its error in what is observed."""


@dataclass(frozen=True)
class AirReports:
    """Observations (n, B) of one quantity in bands of levels.

    Attributes:
        altitude_m: (B,) middles of the bands.
        values: (n, B), zero where not seen.
        seen: (n, B).
        rounding: (n, B, B) covariance of the errors that rounding leaves in them.
        scatter: Robust standard deviation of a band about the median of the six around, which errs too: some 12 % more
            than of a band itself.
    """

    altitude_m: Tensor
    values: Tensor
    seen: Tensor
    rounding: Tensor
    scatter: float


def temperature_reports(grid: LevelGrid) -> AirReports:
    """Temperature deviation (K) by true airspeed and Mach number, or calibrated airspeed.

    Example:
        >>> levels_fl = torch.arange(150.0, 200.0).double()
        >>> values = {"IAS": torch.full((1, 50), 280.0).double(), "TAS": torch.full((1, 50), 380.0).double()}
        >>> grid = LevelGrid(levels_fl, -levels_fl[None], values, torch.zeros(1), ("one",))
        >>> temperature_reports(grid).values.shape
        torch.Size([1, 10])
    """
    tas, cas = grid.values["TAS"], grid.values["IAS"]
    by_cas = cas_to_mach(cas * KT_MPS, grid.altitude_m)
    reported = grid.values.get("Mach", torch.full_like(tas, torch.nan))
    # One or the other for a whole flight: its reports of the Mach number are better than what its IAS says.
    has_mach = reported.isfinite().any(1, keepdim=True)
    mach = torch.where(has_mach, reported, by_cas)
    temperature = (tas * KT_MPS / mach).square() / (KAPPA * R_AIR)
    # dM/dCAS of nearby speeds: at these levels Mach is nearly linear in CAS.
    mach_per_kt = cas_to_mach((cas + 0.5) * KT_MPS, grid.altitude_m) - cas_to_mach(
        (cas - 0.5) * KT_MPS, grid.altitude_m
    )
    of_mach = -2 * temperature / mach
    parts: list[ReportedChannel] = [
        (tas, STEPS["TAS"], 2 * temperature / tas),
        (reported, STEPS["Mach"], torch.where(has_mach, of_mach, 0.0)),
        (cas, STEPS["IAS"], torch.where(has_mach, 0.0, of_mach * mach_per_kt)),
    ]
    return _banded(grid, _possible(temperature - isa_temperature_k(grid.altitude_m), MAX_DEVIATION_K), parts)


def tailwind_reports(grid: LevelGrid) -> AirReports:
    """Wind along the track (m/s) by groundspeed, true airspeed, track and heading.

    Flights that do not report track and heading count as pointing along their track.

    Example:
        >>> levels_fl = torch.arange(150.0, 200.0).double()
        >>> speeds = {"vertical_rate": 0.0, "TAS": 380.0, "groundspeed": 400.0}
        >>> values = {name: torch.full((1, 50), speed).double() for name, speed in speeds.items()}
        >>> grid = LevelGrid(levels_fl, -levels_fl[None], values, torch.zeros(1), ("one",))
        >>> round(float(tailwind_reports(grid).values.mean() / 0.514444))
        20
    """
    tas, groundspeed = grid.values["TAS"], grid.values["groundspeed"]
    along = level_part_kt(grid.values) * drift_cosine(grid.values)
    weight = torch.full_like(tas, KT_MPS)
    parts: list[ReportedChannel] = [(tas, STEPS["TAS"], -weight), (groundspeed, STEPS["groundspeed"], weight)]
    return _banded(grid, _possible((groundspeed - along) * KT_MPS, MAX_WIND_MPS), parts)


def _banded(grid: LevelGrid, values: Tensor, parts: list[ReportedChannel]) -> AirReports:
    """Means over bands, and the covariance of their errors by rounding."""
    n, n_levels = values.shape
    count = -(-n_levels // BAND_LEVELS)
    inside = torch.nn.functional.one_hot(torch.arange(n_levels) // BAND_LEVELS, count).double()
    shown = values.isfinite()
    number = shown.double() @ inside
    mean_of = inside.T * shown[:, None, :] / number.clamp(min=1)[:, :, None]
    mean = (mean_of @ values.nan_to_num(0.0)[:, :, None])[:, :, 0]
    seen, scatter = _without_outliers(mean, number >= MIN_IN_BAND)
    rounding = torch.zeros(n, count, count, dtype=torch.float64)
    for reported, step, weight in parts:
        run, variance = _runs(reported, step)
        weighted = mean_of * weight.nan_to_num(0.0)[:, None, :]
        in_runs = torch.zeros_like(weighted).scatter_add_(2, run[:, None, :].expand_as(weighted), weighted)
        rounding += (in_runs * variance[:, None, :]) @ in_runs.transpose(1, 2)
    middle = grid.altitude_m @ inside / inside.sum(0)
    return AirReports(middle, torch.where(seen, mean, 0.0), seen, rounding, scatter)


def _possible(values: Tensor, most: float) -> Tensor:
    return torch.where(values.abs() <= most, values, torch.nan)


def _without_outliers(values: Tensor, seen: Tensor) -> tuple[Tensor, float]:
    """Bands (n, B) that are no outliers, and their scatter: a receiver may join values of different instants."""
    shown = torch.where(seen, values, torch.nan)
    around = torch.nn.functional.pad(shown, (WINDOW, WINDOW), value=torch.nan).unfold(1, 2 * WINDOW + 1, 1).clone()
    around[:, :, WINDOW] = torch.nan
    left = (shown - around.nanmedian(-1).values).abs()
    # 1.4826 times the median absolute deviation is the standard deviation of normal numbers.
    spread = 1.4826 * float(left[seen].nanmedian()) if bool(seen.any()) else 0.0
    return seen & (left <= OUTLIER * max(spread, 1e-3)), spread


def _runs(reported: Tensor, step: float) -> tuple[Tensor, Tensor]:
    """For each level (n, L) the number of its run of equal reports, and for each run (n, L) the variance of its error.

    A level that is not reported begins a run of its own.
    """
    steps = (reported / step).round().nan_to_num(float("inf"))
    change = steps[:, 1:] != steps[:, :-1]
    run = torch.nn.functional.pad(change.long().cumsum(1), (1, 0))
    n, n_levels = run.shape
    length = torch.zeros(n, n_levels, dtype=torch.float64).scatter_add_(1, run, torch.ones_like(run).double())
    value = torch.full((n, n_levels), torch.nan, dtype=torch.float64).scatter_(1, run, steps)
    before = torch.nn.functional.pad(value[:, :-1], (1, 0), value=torch.nan)
    after = torch.nn.functional.pad(value[:, 1:], (0, 1), value=torch.nan)
    through = (value - before) * (after - value) > 0
    through &= before.isfinite() & after.isfinite()
    return run, step**2 / 12 / torch.where(through, length.clamp(min=1).square(), 1.0)
