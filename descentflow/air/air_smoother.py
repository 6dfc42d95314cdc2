r"""Profiles of temperature and wind from noisy reports: a Gaussian process along each flight.

What is observed in band b is :math:`y_b = g(h_b) + e_b`. Each flight has a level and a trend of its own, of which
nothing is assumed, so that cold days say nothing of warm ones. From that line air departs by a few kelvins and metres
per second over a few thousand feet (inversions, the tropopause, the jet): a Matern 5/2 process, so that the slope,
which the energy equation needs, has a variance. The errors have the covariance that rounding leaves
(:mod:`~descentflow.air.air_reports`) and a white part, which the flights' own scatter tells. Spreads and length are not
learnt: maximum likelihood takes the errors of a receiver that keeps old reports for air that changes every 2,000 ft.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), equations 2.23 to 2.26, 4.17 and 5.8.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.air.air_reports import AirReports
from descentflow.core.errors import DataError

DIFFUSE_SPREAD = 50.0
"""Prior spread of a flight's level, and of its trend over 5 km (K, m/s): five times what air does."""
TREND_M = 5000.0
MIDDLE_M = 8000.0
"""Height about which the trend turns: the middle of a descent from cruise."""
LENGTH_M = 2500.0
"""Over which a departure from the line is correlated: 8,000 ft."""
DEPARTURE_K, DEPARTURE_MPS = 2.0, 3.0
"""Spread of the departures of temperature, and of wind: of its growth that is 0.9 kt for each 1,000 ft."""
MIN_BANDS = 4
"""Bands that a flight must show to say anything of its air: 2,000 ft, the least that has a slope."""
MIN_NOISE = 0.01
"""Of a band, in its unit: reports without any scatter still have some."""
SMOOTHED_FLIGHTS = 256
"""Flights smoothed at a time."""


class Smoothed(NamedTuple):
    """Profiles (m, L) of the flights that say something, and their standard errors."""

    flights: Tensor
    """(m,) positions of the flights."""
    values: Tensor
    error: Tensor
    """Standard error of the values."""
    slope_error_per_m: Tensor
    """Standard error of their slope."""

    def of(self, flights: Tensor) -> "Smoothed":
        """Profiles of some of the flights."""
        chosen = torch.isin(self.flights, flights)
        return Smoothed(*(values[chosen] for values in self))

    def still(self) -> "Smoothed":
        """Zero of the same flights, without any error."""
        zero = torch.zeros_like(self.values)
        return Smoothed(self.flights, zero, zero, zero)


def smoothed(reports: AirReports, departure: float, altitude_m: Tensor) -> Smoothed:
    """Profiles on levels of the flights that show enough bands, with what the smoothing leaves unknown.

    Args:
        reports: Observations of the flights.
        departure: Spread of the departures from a line, in their unit.
        altitude_m: (L,) pressure altitudes.

    Raises:
        DataError: If no flight shows enough bands.

    Example:
        >>> from descentflow.air.air_reports import temperature_reports
        >>> from descentflow.measurements.quantities import grid_of
        >>> from descentflow.measurements.quantity_registry import CHANNELS
        >>> import polars as pl
        >>> grid = grid_of(pl.read_parquet("descents.parquet"), 150, 340, CHANNELS)
        >>> air = smoothed(temperature_reports(grid), 2.0, grid.altitude_m)
        >>> air.values.shape, bool((air.error > 0).all())
        (torch.Size([120, 191]), True)
    """
    enough = torch.nonzero(reports.seen.sum(1) >= MIN_BANDS)[:, 0]
    if not len(enough):
        raise DataError(
            "no flight that reports its air",
            expected=f"true airspeed and what goes with it over {MIN_BANDS * 500:,} ft or more",
            mend="use rows with Mode S reports (TAS, Mach, groundspeed), or fit with data.air=standard",
        )
    parts = [_profiles(_rows(reports, some), departure, altitude_m) for some in torch.split(enough, SMOOTHED_FLIGHTS)]
    return Smoothed(enough, *(torch.cat(column) for column in zip(*parts, strict=True)))


def _profiles(reports: AirReports, departure: float, altitude_m: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    bands_m, seen = reports.altitude_m, reports.seen[:, None, :]
    # Bands that are not seen stand apart with variance one.
    both = seen & reports.seen[:, :, None]
    identity = torch.eye(len(bands_m), dtype=torch.float64)
    whole = _kernel(bands_m, bands_m, departure) + reports.rounding + (reports.scatter**2 + MIN_NOISE**2) * identity
    factor = torch.linalg.cholesky(torch.where(both, whole, identity))
    cross = _kernel(altitude_m, bands_m, departure)
    rise = (_kernel(altitude_m + 1.0, bands_m, departure) - _kernel(altitude_m - 1.0, bands_m, departure)) / 2.0
    left = torch.where(reports.seen, reports.values, 0.0)
    values = ((cross * seen) @ torch.cholesky_solve(left[:, :, None], factor))[:, :, 0]
    known, explained = (
        torch.linalg.solve_triangular(factor, (each * seen).transpose(1, 2), upper=False).square().sum(1)
        for each in (cross, rise)
    )
    own = torch.diagonal(_kernel(altitude_m, altitude_m, departure))
    # The variance of the slope of a trend, and of a Matern 5/2 departure: s^2 5 / (3 l^2).
    slope = (DIFFUSE_SPREAD / TREND_M) ** 2 + 5 / 3 * (departure / LENGTH_M) ** 2
    return values, (own - known).clamp(min=0).sqrt(), (slope - explained).clamp(min=0).sqrt()


def matern(first: Tensor, second: Tensor) -> Tensor:
    """Correlation of departures at altitudes (A,) and (B,).

    Example:
        >>> matern(torch.tensor([0.0]), torch.tensor([0.0, LENGTH_M])).round(decimals=2)
        tensor([[1.0000, 0.5200]])
    """
    away = math.sqrt(5.0) * (first[:, None] - second[None, :]).abs() / LENGTH_M
    return (1 + away + away.square() / 3) * torch.exp(-away)


def _kernel(first: Tensor, second: Tensor, departure: float) -> Tensor:
    """Covariance of the quantity at altitudes (A,) and (B,): level, trend and departure."""
    line = (first[:, None] - MIDDLE_M) * (second[None, :] - MIDDLE_M) / TREND_M**2
    return DIFFUSE_SPREAD**2 * (1 + line) + departure**2 * matern(first, second)


def _rows(reports: AirReports, index: Tensor) -> AirReports:
    return replace(reports, values=reports.values[index], seen=reports.seen[index], rounding=reports.rounding[index])
