r"""Profiles of temperature and wind from noisy reports: a Gaussian process along each flight.

What is observed in band b is :math:`y_b = g(h_b) + e_b`. Of g nothing is assumed but how far it spreads and how fast it
changes, learnt from the flights by maximum likelihood: a level of its own (:math:`s_0`), a trend (:math:`s_1` for each
5 km), and a departure :math:`s_2` that is correlated over a length :math:`\ell` (Matern 5/2, so that the slope, which
the energy equation needs, has a variance). The errors have the covariance that rounding leaves
(:mod:`~descentflow.air.air_reports`) and a white part, learnt too.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), equations 2.23 to 2.26, 4.17 and 5.8.
"""

import math
from dataclasses import asdict, dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.air.air_reports import AirReports
from descentflow.core.errors import DataError

TREND_M = 5000.0
"""Height over which the trend has its spread."""
LENGTHS_M = (600.0, 8000.0)
"""Shortest and longest length of a departure: four bands, beyond which it is a trend again."""
FLIGHTS_TO_LEARN = 200
"""Flights from which spreads and length are learnt: they are five numbers, told by some 8,000 bands."""
MIN_BANDS = 4
"""Bands that a flight must show to say anything of its air: 2,000 ft, the least that has a slope."""
STEPS = 60
"""Iterations of the optimiser; the likelihood no longer changes by 0.01 a flight after some 30."""
BLOCK = 256
"""Flights smoothed at a time."""


class Smoothed(NamedTuple):
    """Profiles (m, L) of the flights that say something, and their standard errors.

    Example:
        >>> levels = torch.zeros(1, 3).double()
        >>> Smoothed(torch.tensor([0]), levels, levels + 0.5, levels).error.amax()
        tensor(0.5000, dtype=torch.float64)
    """

    flights: Tensor
    """(m,) positions of the flights."""
    values: Tensor
    error: Tensor
    """Standard error of the values."""
    slope_error_per_m: Tensor
    """Standard error of their slope."""


@dataclass(frozen=True)
class AirSmoother:
    """Spreads of one quantity of the air along flights, and of the reports' white noise, in its unit.

    Example:
        >>> from descentflow.air.air_reports import temperature_reports
        >>> from descentflow.measurements.quantities import grid_of
        >>> from descentflow.measurements.quantity_registry import CHANNELS
        >>> import polars as pl
        >>> grid = grid_of(pl.read_parquet("descents.parquet"), 150, 340, CHANNELS)
        >>> reports = temperature_reports(grid)
        >>> found = AirSmoother.learnt(reports).smooth(reports, grid.altitude_m)
        >>> found.values.shape, bool((found.error > 0).all())
        (torch.Size([120, 191]), True)
    """

    mean: float
    level: float
    trend: float
    departure: float
    length_m: float
    noise: float

    @classmethod
    def learnt(cls, reports: AirReports) -> "AirSmoother":
        """Learn the spreads from flights by maximum likelihood.

        Raises:
            DataError: If no flight shows enough bands.
        """
        told = torch.nonzero(reports.seen.sum(1) >= MIN_BANDS)[:, 0]
        if not len(told):
            raise DataError(
                "no flight that reports its air",
                expected=f"true airspeed and what goes with it over {MIN_BANDS * 500:,} ft or more",
                mend="use rows with Mode S reports (TAS, Mach, groundspeed), or a weather file",
            )
        some = _rows(reports, told[:: max(len(told) // FLIGHTS_TO_LEARN, 1)][:FLIGHTS_TO_LEARN])
        own = (some.values * some.seen).sum(1) / some.seen.sum(1)
        spread = max(float(own.std()) if len(own) > 1 else 0.0, 0.1)
        start = torch.tensor([0.0, math.log(spread), math.log(spread), math.log(spread / 2), 0.0, math.log(0.5)])
        free = start.double().requires_grad_()
        middle = float(own.mean())
        optimiser = torch.optim.LBFGS([free], max_iter=STEPS, line_search_fn="strong_wolfe")

        def loss() -> Tensor:
            optimiser.zero_grad()
            found = -_log_likelihood(cls._of(free, middle, spread), some) / len(some.values)
            # A weak pull to the start keeps what the flights do not tell (a spread that is nil) finite.
            total = found + 1e-3 * (free - start).square().sum()
            total.backward()  # type: ignore[no-untyped-call]
            return total

        optimiser.step(loss)  # type: ignore[no-untyped-call]
        return cls(*(float(value) for value in cls._of(free.detach(), middle, spread)))

    @staticmethod
    def _of(free: Tensor, middle: float, spread: float) -> tuple[Tensor, ...]:
        """Mean, spreads, length and noise of six unbounded numbers."""
        low, high = LENGTHS_M
        return (middle + spread * free[0], *free[1:4].exp(), low + (high - low) * free[4].sigmoid(), free[5].exp())

    def smooth(self, reports: AirReports, altitude_m: Tensor) -> Smoothed:
        """Profiles on levels (L,) of the flights that show enough bands, with what the smoothing leaves unknown.

        Args:
            reports: Observations of the flights.
            altitude_m: (L,) pressure altitudes.
        """
        told = torch.nonzero(reports.seen.sum(1) >= MIN_BANDS)[:, 0]
        parts = [self._smoothed(_rows(reports, block), altitude_m) for block in torch.split(told, BLOCK)]
        empty = torch.zeros(0, len(altitude_m), dtype=torch.float64)
        columns = [torch.cat(column) for column in zip(*parts, strict=True)] if parts else [empty] * 3
        return Smoothed(told, *columns)

    def _smoothed(self, reports: AirReports, altitude_m: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        numbers = [torch.tensor(value, dtype=torch.float64) for value in asdict(self).values()]
        factor = torch.linalg.cholesky(_covariance(numbers, reports))
        cross = _kernel(numbers, altitude_m, reports.altitude_m)
        step = torch.tensor(1.0, dtype=torch.float64)
        rise = (
            _kernel(numbers, altitude_m + step, reports.altitude_m)
            - _kernel(numbers, altitude_m - step, reports.altitude_m)
        ) / (2 * step)
        left = torch.where(reports.seen, reports.values - self.mean, 0.0)
        solved = torch.cholesky_solve(left[:, :, None], factor)
        seen = reports.seen[:, None, :]
        values = self.mean + ((cross * seen) @ solved)[:, :, 0]
        known = torch.linalg.solve_triangular(factor, (cross * seen).transpose(1, 2), upper=False).square().sum(1)
        told = torch.linalg.solve_triangular(factor, (rise * seen).transpose(1, 2), upper=False).square().sum(1)
        own = torch.diagonal(_kernel(numbers, altitude_m, altitude_m))
        # The variance of the slope of a trend, and of a Matern 5/2 departure: s^2 5 / (3 l^2).
        slope = (self.trend / TREND_M) ** 2 + 5 / 3 * (self.departure / self.length_m) ** 2
        return values, (own - known).clamp(min=0).sqrt(), (slope - told).clamp(min=0).sqrt()


def _rows(reports: AirReports, index: Tensor) -> AirReports:
    return AirReports(reports.altitude_m, reports.values[index], reports.seen[index], reports.rounding[index])


def _kernel(numbers: list[Tensor] | tuple[Tensor, ...], first: Tensor, second: Tensor) -> Tensor:
    """Covariance of the quantity at altitudes (A,) and (B,): level, trend and departure."""
    _, level, trend, departure, length, _ = numbers
    middle = 8000.0
    away = math.sqrt(5.0) * (first[:, None] - second[None, :]).abs() / length
    rough = departure.square() * (1 + away + away.square() / 3) * torch.exp(-away)
    line = (first[:, None] - middle) * (second[None, :] - middle) / TREND_M**2
    return level.square() + trend.square() * line + rough


def _covariance(numbers: list[Tensor] | tuple[Tensor, ...], reports: AirReports) -> Tensor:
    """Covariance (n, B, B) of the observations; bands that are not seen stand apart with variance one."""
    both = reports.seen[:, :, None] & reports.seen[:, None, :]
    whole = _kernel(numbers, reports.altitude_m, reports.altitude_m) + reports.rounding
    identity = torch.eye(len(reports.altitude_m), dtype=torch.float64)
    white = (numbers[-1].square() + 1e-9) * identity
    return torch.where(both, whole + white, identity)


def _log_likelihood(numbers: tuple[Tensor, ...], reports: AirReports) -> Tensor:
    factor = torch.linalg.cholesky(_covariance(numbers, reports))
    left = torch.where(reports.seen, reports.values - numbers[0], 0.0)
    white = torch.linalg.solve_triangular(factor, left[:, :, None], upper=False)[:, :, 0]
    logs = torch.where(reports.seen, torch.diagonal(factor, dim1=1, dim2=2).log(), 0.0)
    found: Tensor = -0.5 * white.square().sum() - logs.sum() - 0.5 * math.log(2 * math.pi) * reports.seen.sum()
    return found
