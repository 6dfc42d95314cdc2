r"""Equivalence of two means within a limit, with flights of one aircraft, and of one day, alike.

The squared standard error of a mean over flights that are alike within aircraft and within days is (Cameron, Gelbach
and Miller, Robust Inference With Multiway Clustering, 2011)

.. math:: V = V_\text{aircraft} + V_\text{day} - V_\text{both},

each the sum over its groups of the squared sum of residuals, times :math:`G/(G-1)`, over the squared number of flights.
An interval takes Student's t with one degree of freedom fewer than the fewer of aircraft and days. Of flights of one
day, the scatter between days is not known, and none is added. Two one-sided tests at 5 % (Schuirmann 1987) call a mean
inside where its 90 % interval lies within the limit; outside where it lies beyond; else flights are too few.
"""

from dataclasses import dataclass
from math import ceil, inf
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from descentflow.diagnosis.findings.costs_found import Measured

FALSE = 0.05
"""Rate at which a mean at the limit is called inside, or outside."""
DECIDING = ("{0:,} more flights", "{1:,} more simulated flights", "{0:,} real and {1:,} simulated more")
MOST_FLIGHTS = 100
"""Times the flights beyond which more are no answer: the mean is at the limit."""
UNDECIDED: Literal["not enough flights"] = "not enough flights"
Verdict = Literal["inside", "outside", "not enough flights", "not judged"]
Numbers = NDArray[np.float64]
Groups = NDArray[np.int64]


@dataclass(frozen=True)
class MeanOfFlights:
    """Mean over flights, its variance, and degrees of freedom of the latter.

    Example:
        >>> mean_of(np.array([1.0, 3.0, 2.0, 2.0]), np.array([0, 1, 2, 3]), np.array([0, 0, 0, 0])).freedom
        3
    """

    mean: float
    variance: float
    freedom: int
    flights: int


def mean_of(values: Numbers, aircraft: Groups, day: Groups) -> MeanOfFlights:
    """Mean over flights that are alike within aircraft and within days; NaN are left out.

    Args:
        values: (n,) of flights.
        aircraft: (n,) of each.
        day: (n,) of each.

    Example:
        >>> alone = mean_of(np.array([1.0, 3.0, 2.0, 2.0]), np.arange(4), np.zeros(4, dtype=int))
        >>> alone.mean, round(alone.variance, 4)  # that of independent flights
        (2.0, 0.1667)
    """
    seen = np.isfinite(values)
    values, aircraft, day = values[seen], aircraft[seen], day[seen]
    n = len(values)
    if not n:
        return MeanOfFlights(float("nan"), inf, 0, 0)
    mean = float(values.mean())
    rest = values - mean
    by_aircraft, n_aircraft = _variance(rest, aircraft)
    by_day, n_days = _variance(rest, day)
    if n_days < 2:
        return MeanOfFlights(mean, by_aircraft, n_aircraft - 1, n)
    both, _ = _variance(rest, np.unique(np.stack([aircraft, day], 1), axis=0, return_inverse=True)[1].reshape(-1))
    # By chance the sum may fall below either part.
    variance = max(by_aircraft + by_day - both, by_aircraft, by_day)
    return MeanOfFlights(mean, variance, min(n_aircraft, n_days) - 1, n)


def _variance(rest: Numbers, group: Groups) -> tuple[float, int]:
    """Variance of the mean by groups, infinite of one; and how many there are."""
    names, place = np.unique(group, return_inverse=True)
    if len(names) < 2:
        return inf, len(names)
    sums = np.bincount(place.reshape(-1), weights=rest)
    return float((sums**2).sum() / len(rest) ** 2 * len(names) / (len(names) - 1)), len(names)


@dataclass(frozen=True)
class Judgement:
    """Judgement of one mean difference.

    Attributes:
        difference: Mean of the real flights minus that of the simulator's, with its 90 % interval.
        verdict: See :data:`Verdict`.
        more_flights: Further real flights, of further aircraft and days alike, that would decide; None where it is
            decided, or no such number would.
        decides: What would decide, in words; empty where it is decided.

    Example:
        >>> judge(MeanOfFlights(1.0, 0.01, 50, 100), MeanOfFlights(0.0, 0.0, 0, 0), 2.0).verdict
        'inside'
        >>> few = judge(MeanOfFlights(1.0, 1.0, 50, 100), MeanOfFlights(0.0, 0.0, 0, 0), 2.0)
        >>> few.verdict, few.more_flights
        ('not enough flights', 176)
    """

    difference: Measured
    verdict: Verdict
    more_flights: int | None = None
    decides: str = ""


def judge(real: MeanOfFlights, simulator: MeanOfFlights, width: float | None, tests: int = 1) -> Judgement:
    """Judge the difference of two means by a limit.

    Args:
        real: Of the real flights.
        simulator: Of the simulator's; of variance zero where it has no flights but a rule.
        width: Size of the limit; None where there is none.
        tests: Number of judgements of which one that is outside refuses all: 5 % is divided by it (Bonferroni).
    """
    difference, variance = real.mean - simulator.mean, real.variance + simulator.variance
    freedom = min(real.freedom, simulator.freedom) if simulator.flights else real.freedom
    if not (freedom > 0 and variance < inf):
        lacking = "more aircraft and days"
        return Judgement(Measured(difference), *(("not judged",) if width is None else (UNDECIDED, None, lacking)))
    error = variance**0.5
    half, sure = (float(student.ppf(1 - false, freedom)) * error for false in (FALSE, FALSE / tests))
    shown = Measured(difference, difference - half, difference + half)
    if width is None:
        return Judgement(shown, "not judged")
    if abs(difference) + half < width:
        return Judgement(shown, "inside")
    if abs(difference) - sure > width:
        return Judgement(shown, "outside")
    return Judgement(shown, UNDECIDED, *_deciding(real, simulator, abs(abs(difference) - width)))


def _deciding(real: MeanOfFlights, simulator: MeanOfFlights, room: float) -> tuple[int | None, str]:
    """Flights to be added until the interval is as wide as the room, aircraft and days in proportion; in words.

    Real ones, or simulated ones, or as many times more of both: the first of these that is enough.
    """
    times = np.geomspace(1.0, MOST_FLIGHTS, 500)
    once = np.ones_like(times)
    for words, of_real, of_simulator in zip(DECIDING, (times, once, times), (once, times, times), strict=True):
        freedom = np.minimum(real.freedom * of_real, simulator.freedom * of_simulator if simulator.flights else inf)
        half = student.ppf(1 - FALSE, freedom) * np.sqrt(real.variance / of_real + simulator.variance / of_simulator)
        enough = np.flatnonzero(half <= room)
        if len(enough):
            counts = [max(ceil(side.flights * (times[enough[0]] - 1)), 1) for side in (real, simulator)]
            return counts[0] if words == DECIDING[0] else None, words.format(*counts)
    return None, "no number, the mean is at its limit"
