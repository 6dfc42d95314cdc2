r"""Times of continuations, calibrated on all flights that the density was fitted to.

The density's median time to a level, and CAS and rate at the last observed level, forecast the time by least squares.
How far that is off, each flight tells by the forecast of the others (cross-conformal prediction: Barber, Candes, Ramdas
and Tibshirani 2021, doi:10.1214/20-AOS1965). A density knows too much of a flight that it was fitted to, so that a
Gaussian or mixture continues it as fitted to the others. Of n flights the share :math:`0.9 (n + 1) / n` lies within

.. math:: h_{il} = q_l \sqrt{d_{il}^2 + \overline{d_l^2}}

of its forecast, where :math:`d_{il}` is half the interval of its continuations as drawn, and the bar is a median over
flights. At the level just below, a few seconds away, all of it is what reports are off by. That is added to the
intervals of all levels; continuations are spread about their median by the rest of h. Rates follow, so that every
continuation is flown in the times that it has; speeds and drag stay as they were drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from descentflow.representation.decoder.trajectories import Trajectories

HELD = 0.9
"""Share of the times that intervals shall hold."""
DEPTHS = 12
"""Numbers of levels below the last observed one at which times are compared with flights; between, on a log scale."""
PRIOR_FLIGHTS = 5.0
"""Flights by which the slopes of forecasts are shrunk."""
LEAST_STEP = 0.2
"""Of the time from one level to the next, which is left at least: a descent does not turn back."""
LEAST_SPREAD = 0.1
"""Of h, by which continuations are spread at least."""


def least_squares(features: Tensor, values: Tensor, prior_flights: float = 0.0) -> tuple[Tensor, Tensor]:
    """Regress values (..., n, k) on features (..., n, p), the first of which is one.

    Args:
        features: (..., n, p).
        values: (..., n, k).
        prior_flights: Flights that say that no feature but the first counts: with few flights, slopes are shrunk.

    Returns:
        Coefficients (..., p, k), and residuals (..., n, k) of each flight by the fit without it.

    Example:
        >>> x = torch.stack([torch.ones(9), torch.arange(9.0)], 1).double()
        >>> y = (3 + 2 * x[:, 1:]) + torch.eye(9)[:, 4:5]  # the fifth is one off
        >>> _, residuals = least_squares(x, y)
        >>> others = torch.arange(9) != 4
        >>> without, _ = least_squares(x[others], y[others])
        >>> torch.allclose(residuals[4], y[4] - x[4] @ without)
        True
    """
    # Slopes of features about their means and in their deviations, which the first column undoes.
    scale = torch.eye(features.shape[-1], dtype=features.dtype).repeat(*features.shape[:-2], 1, 1)
    mean, deviation = features[..., 1:].mean(-2), features[..., 1:].std(-2).clamp(min=1e-9)
    scale[..., 0, 1:] = -mean / deviation
    scale[..., 1:, 1:] = torch.diag_embed(1 / deviation)
    whitened = features @ scale
    prior = prior_flights * torch.eye(features.shape[-1], dtype=features.dtype)
    prior[0, 0] = 0.0
    inverse = torch.linalg.pinv(whitened.mT @ whitened + prior, hermitian=True) @ whitened.mT
    leverage = (whitened * inverse.mT).sum(-1, keepdim=True)
    slopes = inverse @ values
    return scale @ slopes, (values - whitened @ slopes) / (1 - leverage).clamp(min=1e-3)


def held_within(misses: Tensor) -> Tensor:
    """Distance (...) within which 90 % of flights to come lie, by the absolute misses (..., n) of n.

    Example:
        >>> held_within(torch.arange(1.0, 20.0))  # of 19 the 18th
        tensor(18.)
    """
    n = misses.shape[-1]
    return misses.sort(-1).values[..., min(ceil(HELD * (n + 1)), n) - 1]


@dataclass(frozen=True)
class TimeCalibration:
    """Forecast of times at depths (k,), numbers of levels below the last observed one.

    Attributes:
        ahead: (k,) ascending.
        coefficients: (k, 4) of one, CAS (m/s) and rate (m/s) at the last observed level, and the median time (s).
        typical: (k,) median of the squared half intervals as drawn.
        factor: (k,) q of the module.
        last: Index of the last observed level.
        n_flights: How many it was calibrated on.

    Example:
        >>> from descentflow.generation.prediction.predict import predict
        >>> one = predict("best.ckpt", "descents.parquet", from_fl=290, n=50).flights[0].trajectories
        >>> ahead, factor = torch.tensor([1.0, 139.0]).double(), torch.full((2,), 2.0).double()
        >>> as_drawn = torch.tensor([0.0, 0.0, 0.0, 1.0]).double().expand(2, 4)
        >>> twice = TimeCalibration(ahead, as_drawn, torch.zeros(2).double(), factor, 139, 10)
        >>> wide, _ = twice.applied(one, torch.zeros(2))
        >>> 1.8 < float(wide.time_s[:, 0].std() / one.time_s[:, 0].std()) < 2  # the rest is noise of reports
        True
    """

    ahead: Tensor
    coefficients: Tensor
    typical: Tensor
    factor: Tensor
    last: int
    n_flights: int

    @classmethod
    def of_flights(cls, drawn: Sequence[Trajectories], observed: Tensor, flown_s: Tensor) -> "TimeCalibration":
        """Calibrate on flights, all continued from one level.

        Args:
            drawn: Continuations of each of n flights, more than four.
            observed: (n, 2) CAS and rate of each there, in m/s.
            flown_s: (n, L) seconds that each took from there to each level below.
        """
        last = int(drawn[0].entry[0])
        ahead = torch.linspace(0, torch.tensor(float(last)).log(), DEPTHS, dtype=torch.float64).exp().round().unique()  # type: ignore[no-untyped-call]
        to = last - ahead.long()
        seen = [_seen(flown, known, to) for flown, known in zip(drawn, observed, strict=True)]
        features = torch.stack([flight.features for flight in seen], 1)
        half = torch.stack([flight.half_s for flight in seen], 1)
        coefficients, residuals = least_squares(features, flown_s[:, to].T[:, :, None], PRIOR_FLIGHTS)
        typical = half.square().median(1).values
        factor = held_within(residuals[:, :, 0].abs() / _spread(half.T, typical).T)
        return cls(ahead, coefficients[:, :, 0], typical, factor, last, len(drawn))

    def applied(self, flown: Trajectories, observed: Tensor) -> tuple[Trajectories, Tensor]:
        """Continuations of one flight, times moved, and half the 90 % interval (L,) that reports add, in seconds.

        Args:
            flown: All from one level.
            observed: (2,) CAS and rate there, in m/s.
        """
        last = int(flown.entry[0])
        noise_s = torch.zeros(len(flown.levels_fl), dtype=torch.float64)
        if last == 0:
            return flown, noise_s
        ahead = self.ahead[self.ahead <= last]
        n = len(ahead)
        seen = _seen(flown, observed, last - ahead.long())
        shift = (seen.features * self.coefficients[:n]).sum(1) - seen.features[:, 3]
        half = self.factor[:n] * _spread(seen.half_s, self.typical[:n])
        noise = half[0].square() - torch.minimum(half[0], seen.half_s[0]).square()
        own = (half.square() - noise).clamp(min=0).sqrt().maximum(LEAST_SPREAD * half)
        every = np.log(np.arange(1, last + 1))
        shift, own_s, half_s = (torch.from_numpy(np.interp(every, ahead.log(), one)) for one in (shift, own, half))
        noise_s[:last] = (half_s.square() - own_s.square()).clamp(min=0).sqrt().flip(0)
        return _moved(flown, shift, own_s), noise_s


class Control(NamedTuple):
    """Least squares on CAS and rate alone: coefficients (3, L) and half the 90 % interval (L,), in seconds.

    Example:
        >>> flights = torch.tensor([[140.0, -9.0], [150.0, -10.0], [145.0, -12.0], [150.0, -9.0], [140.0, -10.0]])
        >>> Control.of_flights(flights, torch.full((5, 1), 60.0)).time_s(flights).round()[:2]
        tensor([[60.],
                [60.]], dtype=torch.float64)
    """

    coefficients: Tensor
    half_s: Tensor

    @classmethod
    def of_flights(cls, observed: Tensor, flown_s: Tensor) -> "Control":
        """Fit to flights with CAS and rate (n, 2) at a level and times (n, L) from there, as the calibration is."""
        coefficients, residuals = least_squares(_with_one(observed), flown_s.double())
        return cls(coefficients, held_within(residuals.abs().T))

    def time_s(self, observed: Tensor) -> Tensor:
        """Forecast (n, L) of flights with CAS and rate (n, 2)."""
        return _with_one(observed) @ self.coefficients


def _with_one(observed: Tensor) -> Tensor:
    return torch.nn.functional.pad(observed.double(), (1, 0), value=1.0)


class _Seen(NamedTuple):
    """Features (k, 4) of a flight at k levels, and half the interval (k,) of its continuations as drawn."""

    features: Tensor
    half_s: Tensor


def _seen(flown: Trajectories, observed: Tensor, to: Tensor) -> _Seen:
    low, middle, high = _quantiles(flown.time_s[:, to])
    of_flight = _with_one(observed).expand(len(to), 3)
    return _Seen(torch.cat([of_flight, middle[:, None]], 1), (high - low) / 2)


def _quantiles(time_s: Tensor) -> Tensor:
    return time_s.double().quantile(torch.tensor([0.5 - HELD / 2, 0.5, 0.5 + HELD / 2], dtype=torch.float64), dim=0)


def _spread(half_s: Tensor, typical: Tensor) -> Tensor:
    return (half_s.square() + typical).sqrt().clamp(min=torch.finfo(torch.float64).tiny)


def _moved(flown: Trajectories, shift_s: Tensor, half_s: Tensor) -> Trajectories:
    """Times moved by a shift at each level downwards, and spread until half their interval is as long as asked."""
    last = len(shift_s)
    # From the last observed level downwards; there the time is zero.
    time_s = flown.time_s[:, : last + 1].flip(1)
    low, middle, high = _quantiles(time_s[:, 1:])
    factor = half_s / ((high - low) / 2).clamp(min=torch.finfo(torch.float64).tiny)
    moved = torch.nn.functional.pad(middle + shift_s + factor * (time_s[:, 1:] - middle), (1, 0))
    before = time_s.diff(dim=1)
    steps = torch.maximum(moved.diff(dim=1), LEAST_STEP * before)
    time_from_entry_s, slower = flown.time_s.clone(), (steps / before).flip(1)
    time_from_entry_s[:, :last] = steps.cumsum(1).flip(1)
    neighbours = torch.nn.functional.pad(slower[:, None], (1, 1), mode="replicate")[:, 0]
    rate_mps = flown.rate_mps.clone()
    rate_mps[:, : last + 1] /= 0.5 * (neighbours[:, 1:] + neighbours[:, :-1])
    return replace(flown, time_s=time_from_entry_s, rate_mps=rate_mps)
