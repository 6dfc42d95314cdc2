"""Errors of coefficients on aircraft that were not used: time, rate and speeds by level, with what chance gives.

Errors of the time are weighted by time: those of all flights together are seconds over seconds, so that a flight with
two bands counts as little as it flies. Errors at a level are means over the flights that show it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from descentflow.core.linear_gaussian import Array
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.physics.performance_model import PerformanceModel
from descentflow.repairs.mixed_model import before_flights, predictive_log_density
from descentflow.repairs.type_fit import TypeFlights, fit_types, linearised

FOLDS = 8
"""Parts of the aircraft, each predicted by the others."""
FLEETS = 400
"""Bootstrapped fleets."""
FEWEST_AIRCRAFT_A_LEVEL = 3
"""Aircraft that show a level, for its errors to be given."""


@dataclass(frozen=True)
class Error:
    """Mean error of one quantity, before and after, on aircraft that were not used.

    Attributes:
        before: Model minus flights.
        after: The same with the repaired coefficients.
        low: Lower end of the 90 % interval of ``after``, by aircraft.
        high: Its upper end.
        floor: What the means of nine in ten pairs of such fleets differ by at most.

    Example:
        >>> Error(25.0, 1.0, -2.0, 4.0, 3.0).within
        True
    """

    before: float
    after: float
    low: float
    high: float
    floor: float

    @property
    def within(self) -> bool:
        """True if the rest is no more than chance."""
        return abs(self.after) <= self.floor


@dataclass(frozen=True)
class LevelErrors:
    """Errors at one level: of the rate (ft/min) at the flights' own speeds, and of the scheduled CAS (kt)."""

    level_fl: float
    aircraft: int
    rate: Error
    cas: Error


@dataclass(frozen=True)
class HeldOut:
    """Errors on aircraft that were not used.

    Attributes:
        flights: Number.
        aircraft: Number.
        time: Of the time of all flights over their own levels at their own speeds, percent of it.
        absolute: Absolute errors of single flights' times, percent of all time, before and after.
        levels: By level, from the top down.
        gain: What the log density of an aircraft's flights gains, nats: the median, for one held path can cost more
            than all others gain.

    Example:
        >>> HeldOut(3, 3, Error(2.0, 1.0, 0.0, 2.0, 1.0), (9.0, 8.0), (), 2.5).better
        True
    """

    flights: int
    aircraft: int
    time: Error
    absolute: tuple[float, float]
    levels: tuple[LevelErrors, ...]
    gain: float

    @property
    def better(self) -> bool:
        """True if most other aircraft are predicted better, and the time no worse: of all flights, and of single ones.

        Nothing is forgiven to chance: a change that makes the time worse is not worth a file of its own.
        """
        closer = abs(self.time.after) <= abs(self.time.before) and self.absolute[1] <= self.absolute[0]
        return self.gain > 0 and closer


Finish = Callable[[TypeFlights, Array], PerformanceModel]
"""The file that flights and coefficients (3,) lead to, speeds included."""


def held_out(types: Sequence[TypeFlights], finish: Finish) -> HeldOut:
    """Predict each aircraft of the first type by a repair from the others.

    Args:
        types: Flights by type, that to be repaired first.
        finish: Makes the file.
    """
    mine, before = types[0], types[0].aircraft
    names = np.unique(mine.tails)
    fold = np.random.default_rng(0).permutation(len(names)) % min(FOLDS, len(names))
    seconds, rate, cas = np.empty(len(mine.tails)), np.empty(mine.log_rate.shape), np.empty(mine.log_rate.shape)
    gains = []
    for k in range(fold.max() + 1):
        out = np.isin(mine.tails, names[fold == k])
        kept, left = mine.rows(np.flatnonzero(~out)), mine.rows(np.flatnonzero(out))
        refitted = fit_types([kept, *types[1:]])
        seconds[out], rate[out], cas[out] = _flown(left, finish(kept, refitted.of(0)[0]))
        one = refitted.only(0)
        about = linearised([left], one.mean)
        prior = before_flights(about, refitted.sizes)
        was, now = (predictive_log_density(linearised([left], each.mean), each) for each in (prior, one))
        gains.append(now - was)
    seconds_before, rate_before, cas_before = _flown(mine, before)
    own_rate = np.exp(mine.log_rate) / FPM_MPS
    own_seconds = np.nansum(mine.evidence.state.width_m / np.exp(mine.log_rate), axis=1)
    own_cas = np.where(np.isfinite(own_rate), mine.evidence.state.cas_mps.numpy() / KT_MPS, np.nan)
    whole = own_seconds > 0
    weight, tails = own_seconds[whole], mine.tails[whole]
    late = [100.0 * (value[whole] / weight - 1.0) for value in (seconds_before, seconds)]
    levels = []
    for band in range(own_rate.shape[1] - 1, -1, -1):
        shown = np.isfinite(own_rate[:, band])
        there = mine.tails[shown]
        if len(np.unique(there)) >= FEWEST_AIRCRAFT_A_LEVEL:
            errors = [
                _error(there, was[shown, band] - own[shown, band], now[shown, band] - own[shown, band])
                for was, now, own in ((rate_before, rate, own_rate), (cas_before, cas, own_cas))
            ]
            level = float(mine.evidence.state.altitude_m[band]) / FL_M
            levels.append(LevelErrors(level, len(np.unique(there)), errors[0], errors[1]))
    absolute = [float(np.average(np.abs(values), weights=weight)) for values in late]
    return HeldOut(
        len(mine.evidence),
        len(names),
        _error(tails, late[0], late[1], weight),
        (absolute[0], absolute[1]),
        tuple(levels),
        float(np.median(np.concatenate(gains))),
    )


def _flown(flights: TypeFlights, aircraft: PerformanceModel) -> tuple[Array, Array, Array]:
    """Seconds (n,) over each flight's bands, rate (n, K) at its own speed, ft/min, and scheduled CAS (n, K), kt."""
    evidence = flights.evidence
    rate = np.exp(evidence.expected(aircraft).numpy())
    seconds = np.where(np.isfinite(flights.log_rate), evidence.state.width_m / rate, 0.0).sum(1)
    cas = (aircraft.descent_cas_mps(evidence.state.altitude_m) / KT_MPS).to(torch.float64).numpy()
    return seconds, rate / FPM_MPS, np.broadcast_to(cas, rate.shape)


def _error(tails: np.ndarray, before: Array, after: Array, weight: Array | None = None) -> Error:
    """Means over flights, weighted or not, with what drawing other aircraft of the same fleet changes."""
    names, index = np.unique(tails, return_inverse=True)
    weight = np.ones(len(tails)) if weight is None else weight
    count, sums = np.bincount(index, weight), np.bincount(index, after * weight)
    drawn = np.random.default_rng(0).integers(0, len(names), (2 * FLEETS, len(names)))
    means = sums[drawn].sum(1) / count[drawn].sum(1)
    low, high = np.quantile(means, [0.05, 0.95])
    floor = np.quantile(np.abs(means[:FLEETS] - means[FLEETS:]), 0.9)
    was, now = (float(np.average(values, weights=weight)) for values in (before, after))
    return Error(was, now, float(low), float(high), float(floor))
