r"""Deviations of single flights from a simulator's mean: airspeed and rate by level, and errors of predictions.

The rate is compared at each flight's own airspeed: the simulator claims the polar's rate at that speed, times the mean
of what its own flights have over the polar's. A prediction begins where a flight is first seen, and follows the mean
time (and way) that the simulator needs through each band; the flight's own times are those of its rates. With
:math:`t(z)` the flight's time to an altitude and :math:`\hat t(z)` the predicted one, after T the error of altitude is
:math:`t^{-1}(T) - \hat t^{-1}(T)` and that of time :math:`t(\hat t^{-1}(T)) - T`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from descentflow.core.units import FL_M, FT_M
from descentflow.diagnosis.gap.costs import flown, simulator_rows
from descentflow.diagnosis.sides.measured_sides import MeasuredSides
from descentflow.diagnosis.sides.two_sides import Compared

BAND_FL = 10.0
"""Height of a band: 1,000 ft, over which Part 60 asks an idle descent to be recorded."""
DEPTH = 1.25
"""Times the prediction's that the simulator must take through a flight's levels: the flight's own time does not choose
it, or only slow flights would be judged."""
Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Deviation:
    """Deviations (n,) of all flights, the simulator's first, from the simulator's mean; NaN where not seen.

    Attributes:
        quantity: See :data:`descentflow.qualification.limits.UNITS`.
        of_flights: (n,) in its unit.
        simulator: The simulator's mean; zero for errors of predictions.
        levels: Lowest and highest flight level.
        minutes: Time for which a prediction is made.
        by_air: (n,) part of it that the air does which each flight measured; None where that is not known.
    """

    quantity: str
    of_flights: Numbers
    simulator: float
    levels: tuple[float, float]
    minutes: float | None = None
    by_air: Numbers | None = None


def own_predictions(sides: MeasuredSides) -> Tensor:
    """(n,) place of the prediction of each flight, the simulator's flights first, as their own; -1 without one."""
    assert sides.simulated is not None
    place = {name: i for i, name in enumerate(sides.simulated.names)}
    return torch.tensor([*range(len(place)), *(place.get(name, -1) for name in sides.real.names)])


def _claims(values: Tensor, simulator: Tensor, own: Tensor | None) -> Tensor:
    """Claim (n, K) of a simulator for each flight: the mean of its flights, or the flight's own prediction."""
    if own is None:
        return values[simulator].nanmean(0).expand_as(values)
    return torch.where((own >= 0)[:, None], values[own], torch.nan)


def by_level(compared: Compared, y: Tensor, own: Tensor | None = None) -> list[Deviation]:
    """Deviations of airspeed and rate in each band, from below, and in all bands together.

    A nominal descent, and a predictor's times, fly each flight's own airspeed, so that there is none of it.

    Args:
        compared: Flights of both sides, in bands of :data:`BAND_FL`.
        y: (n, p) their entries, as they are or with causes put in.
        own: (n,) of :func:`own_predictions`; None where the mean of the simulator's flights is its claim.
    """
    table, simulator = flown(compared, y), simulator_rows(compared)
    rows: dict[str, tuple[Tensor, Tensor, Tensor | None]] = {}
    if compared.has_simulated and "cas" in table and own is None:
        mean = table["cas"][simulator].nanmean(0)
        rows["airspeed"] = (table["cas"] - mean, mean, None)
    ratio = compared.table("rate", y).exp()
    usual = _claims(ratio, simulator, own) if compared.has_simulated else torch.ones_like(ratio)
    claimed = table["rate"] / ratio * usual
    # The air that a predictor assumed is in its times, and is not known.
    by_air = None if own is not None else _rate_by_air(compared, claimed)
    rows["rate"] = (table["rate"] - claimed, table["rate"][simulator].nanmean(0), by_air)
    deviations = []
    for quantity, (deviation, mean, by_air) in rows.items():
        for k in torch.nonzero(deviation[compared.real].isfinite().any(0) & mean.isfinite())[:, 0].tolist():
            middle = compared.middles_fl()[k]
            ends = (round(middle - compared.band_fl / 2, 6), round(middle + compared.band_fl / 2, 6))
            air = None if by_air is None else by_air[:, k].numpy()
            deviations.append(Deviation(quantity, deviation[:, k].numpy(), float(mean[k]), ends, by_air=air))
        air = None if by_air is None else by_air.nanmean(1).numpy()
        whole = compared.levels()
        deviations.append(Deviation(quantity, deviation.nanmean(1).numpy(), float(mean.nanmean()), whole, by_air=air))
    return deviations


def _rate_by_air(compared: Compared, claimed: Tensor) -> Tensor | None:
    """Part (n, K) of the rate's deviation by the air that each flight measured; None where too few did."""
    if not compared.measures_air:
        return None
    change = compared.own_air + torch.zeros_like(claimed)
    simulated = change[simulator_rows(compared)].nanmean(0) if compared.has_simulated else torch.zeros(change.shape[1])
    return claimed * (change - simulated).expm1()


def of_predictions(
    compared: Compared, y: Tensor, minutes: Sequence[float], own: Tensor | None = None
) -> list[Deviation]:
    """Errors of predictions after some minutes, and of the place of the top of descent.

    Distance is over ground where both sides report groundspeeds, else through the air. The top of descent is too late
    by as much as a flight needs more than the simulator from its highest level to the lowest one.

    Args:
        compared: Flights of both sides.
        y: (n, p) their entries.
        minutes: For which predictions are made.
        own: As in :func:`by_level`.
    """
    table, levels = flown(compared, y), compared.levels()
    claimed = table if compared.has_simulated else flown(compared, 0.0 * y)
    way = "ground_distance" if "ground_distance" in table else "air_distance"
    predicted = [claimed["time"], claimed[way]]
    if compared.has_simulated:
        # One without flights of its own follows each flight's airspeed.
        predicted = [_claims(x, simulator_rows(compared), own) for x in predicted]
    flights = list(_flights(compared, table["time"], predicted[0], table[way], predicted[1]))
    deviations = []
    for after in minutes:
        errors = np.array([flight.errors(60.0 * after) for flight in flights])
        for quantity, column in zip(("time_ahead", "altitude_ahead", "along_track_ahead"), errors.T, strict=True):
            deviations.append(Deviation(quantity, column, 0.0, levels, after))
    top = np.array([flight.further_nm for flight in flights])
    return [*deviations, Deviation("top_of_descent", top, 0.0, levels)]


@dataclass(frozen=True)
class _Flight:
    """Flown and predicted descent, from the level where the flight is first seen, band by band.

    ``time_s``, ``predicted_s``, ``way_nm``, ``predicted_nm`` (b + 1,) from zero; ``altitude_ft`` (b + 1,) downwards.
    """

    time_s: Numbers
    predicted_s: Numbers
    way_nm: Numbers
    predicted_nm: Numbers
    altitude_ft: Numbers
    reaches_lowest: bool

    @property
    def further_nm(self) -> float:
        """Distance that the flight needs more than the simulator down to the lowest level; NaN where it ends above."""
        return float(self.way_nm[-1] - self.predicted_nm[-1]) if self.reaches_lowest else float("nan")

    def errors(self, after_s: float) -> tuple[float, float, float]:
        """Errors of time (s), altitude (ft) and distance (NM); NaN where the levels are too few for the prediction."""
        if len(self.time_s) < 2 or self.predicted_s[-1] < DEPTH * after_s:
            return (float("nan"),) * 3
        there = _at(after_s, self.predicted_s, self.altitude_ft)
        late = float(np.interp(-there, -self.altitude_ft, self.time_s)) - after_s
        higher = _at(after_s, self.time_s, self.altitude_ft) - there
        ahead = _at(after_s, self.time_s, self.way_nm) - _at(after_s, self.predicted_s, self.predicted_nm)
        return late, higher, ahead


def _at(x: float, grid: Numbers, values: Numbers) -> float:
    """Value at x; beyond the last one as between the last two, for few flights leave the levels so early."""
    if x <= grid[-1]:
        return float(np.interp(x, grid, values))
    return float(values[-1] + (x - grid[-1]) * (values[-1] - values[-2]) / (grid[-1] - grid[-2]))


def _flights(
    compared: Compared, seconds: Tensor, claimed_s: Tensor, way: Tensor, claimed_way: Tensor
) -> Iterator[_Flight]:
    """Flights from their highest band down to the first that they do not show."""
    tables = [x.flip(1).numpy() for x in (seconds, claimed_s, way, claimed_way)]
    shown = np.isfinite(np.stack(tables)).all(0)
    top = np.array(compared.middles_fl()[::-1]) + compared.band_fl / 2
    for i, row in enumerate(shown):
        first = int(row.argmax())
        gaps = np.flatnonzero(~row[first:])
        last = first + (int(gaps[0]) if len(gaps) else len(row) - first)
        sums = [np.concatenate([[0.0], np.cumsum(table[i, first:last])]) for table in tables]
        altitude = (top[first] - compared.band_fl * np.arange(last - first + 1)) * FL_M / FT_M
        yield _Flight(sums[0], sums[1], sums[2], sums[3], altitude, last == len(row) and last > first)
