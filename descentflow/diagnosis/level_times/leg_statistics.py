"""Whether flights and a simulator take the same time over legs of altitude."""

from dataclasses import dataclass

import numpy as np

MIN_FLIGHTS = 8
"""Flights on each side below which a leg is not compared: of fewer, a spread is not known to a third of itself."""
RESAMPLES = 999
"""Random labellings behind a p-value, and resamples behind an interval: a p-value of 0.001 can be reached."""


@dataclass(frozen=True)
class LegDifference:
    """One leg: both means and what lies between them, in seconds.

    Attributes:
        leg: What it is called.
        n_real: Flights.
        n_simulated: Of the simulator.
        mean_real_s: Mean of the flights.
        mean_simulated_s: Mean of the simulator.
        difference_s: Flights minus simulator.
        low_s: 90 % interval of the difference.
        high_s: The same.
        wasserstein_s: Between as many of each; NaN where the simulator is one descent.
        floor_s: Between flights and as many other flights.
        p_value: That a difference as large arises by chance on any of the legs.

    Example:
        >>> LegDifference("FL200 to FL150", 40, 1000, 161.0, 155.0, 6.0, 2.0, 9.5, 6.5, 3.1, 0.004).difference_s
        6.0
    """

    leg: str
    n_real: int
    n_simulated: int
    mean_real_s: float
    mean_simulated_s: float
    difference_s: float
    low_s: float
    high_s: float
    wasserstein_s: float
    floor_s: float
    p_value: float


def studentised(real: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """Difference of the means over its standard error, by leg: (n, K) and (m, K) with NaN give (K,).

    Example:
        >>> real = np.arange(10.0)[:, None] + 3
        >>> studentised(real, np.arange(10.0)[:, None]).round(3)  # 3 over sqrt(2 * 9.17 / 10)
        array([2.216])
    """
    n, m = np.isfinite(real).sum(0), np.isfinite(simulated).sum(0)
    variance = np.nanvar(real, 0, ddof=1) / n + np.nanvar(simulated, 0, ddof=1) / m
    return np.asarray((np.nanmean(real, 0) - np.nanmean(simulated, 0)) / np.sqrt(variance))


def p_values(real: np.ndarray, simulated: np.ndarray, seed: int, n: int = RESAMPLES) -> np.ndarray:
    """P-value of each leg, adjusted for there being several: the largest statistic of all legs, labels permuted.

    Whole flights change sides, so what a flight does on one leg and on another stays together. The statistic is
    studentised, so that a simulator with another spread is no difference of its own.

    Args:
        real: (n, K) seconds, NaN where not seen; at least :data:`MIN_FLIGHTS` on each leg.
        simulated: (m, K).
        seed: Of the labellings.
        n: How many.

    Returns:
        (K,); the least of them is that of the whole.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> p_values(rng.normal(160, 10, (50, 2)), rng.normal([160, 180], 10, (80, 2)), seed=1) < 0.05
        array([False,  True])
    """
    both, rng = np.concatenate([real, simulated]), np.random.default_rng(seed)
    observed = np.abs(studentised(real, simulated))
    reached = np.ones(real.shape[1])
    seen = np.isfinite(both)
    values = np.where(seen, both, 0.0)
    squares, counts = values**2, seen.astype(float)
    for _ in range(n):
        first = np.zeros(len(both))
        first[rng.permutation(len(both))[: len(real)]] = 1.0
        sums = [np.stack([first @ one, (1 - first) @ one]) for one in (counts, values, squares)]
        number, mean = sums[0], sums[1] / np.maximum(sums[0], 1)
        variance = (sums[2] - number * mean**2) / np.maximum(number - 1, 1)
        error = np.sqrt((variance / np.maximum(number, 1)).sum(0))
        with np.errstate(divide="ignore", invalid="ignore"):
            statistic = np.abs(mean[0] - mean[1]) / error
        # A leg that one side has lost in this labelling says nothing.
        largest = np.nanmax(np.where((number > 1).all(0), statistic, 0.0))
        reached += largest >= observed
    return reached / (n + 1)


def interval(real: np.ndarray, simulated: np.ndarray, seed: int, n: int = RESAMPLES) -> tuple[float, float]:
    """90 % bootstrap interval of the difference of means of two samples without NaN.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> low, high = interval(rng.normal(10, 1, 100), rng.normal(8, 1, 100), seed=0)
        >>> low < 2 < high, high - low < 1
        (True, True)
    """
    rng = np.random.default_rng(seed)
    means = [rng.choice(side, (n, len(side))).mean(1) for side in (real, simulated)]
    low, high = np.quantile(means[0] - means[1], [0.05, 0.95])
    return float(low), float(high)
