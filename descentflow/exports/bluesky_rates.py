"""Vertical speeds that make BlueSky pass the altitudes of a sample in time, under its own limits."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP_S = 4.0
"""Between commands."""
STEEPEST_FPM = 3100.0
"""Below BlueSky's limit of its airliners (3,157 ft/min of the A320, 3,201 of the B738): 1.1.1 holds descents to the
largest rate of climb, and beyond it doubles or stops them while speed changes."""
RAMP_FPM_S = 300.0
"""BlueSky's vertical acceleration; changes of less than 300 ft/min are made at once."""
SLOWEST_FPM = 100.0
"""Below 20 ft/min BlueSky takes its own 1,500 ft/min."""
CATCH_UP_S = 20.0
"""An altitude that is off is made good at this rate: a correction within one step would swing."""


def commanded_rates(time_s: Array, altitude_ft: Array) -> tuple[Array, Array]:
    """Rates to command every :data:`STEP_S` seconds, and the altitudes that BlueSky has when they are given.

    Each is the sample's mean rate until the next command, and what makes good the altitude that the limit kept back.
    The flight comes with the sample's first rate: :func:`run_up` says how.

    Args:
        time_s: (k,) from zero, ascending.
        altitude_ft: (k,) descending.

    Returns:
        Rates (ft/min, negative) and altitudes (ft), a pair for each command.

    Example:
        >>> rates, altitudes = commanded_rates(np.array([0.0, 600.0]), np.array([35_000.0, 15_000.0]))
        >>> rates[60:63].round()
        array([-2000., -2000., -2000.])
    """
    times = np.arange(0.0, time_s[-1], STEP_S)
    planned = np.interp(np.append(times, times[-1] + STEP_S), time_s, altitude_ft)
    rates, altitudes = np.empty(len(times)), np.empty(len(times))
    altitude, rate = float(altitude_ft[0]), first_rate(time_s, altitude_ft)
    for k in range(len(times)):
        wanted = 60 * ((planned[k + 1] - planned[k]) / STEP_S + (planned[k] - altitude) / CATCH_UP_S)
        rates[k], altitudes[k] = min(max(wanted, -STEEPEST_FPM), -SLOWEST_FPM), altitude
        change, rate = _flown(rate, float(rates[k]))
        altitude += change
    return rates, altitudes


def first_rate(time_s: Array, altitude_ft: Array) -> float:
    """The rate (ft/min) with which a sample begins, within what can be commanded.

    Example:
        >>> round(first_rate(np.array([0.0, 600.0]), np.array([35_000.0, 15_000.0])))
        -2000
    """
    slope = 60 * float(np.interp(STEP_S, time_s, altitude_ft) - altitude_ft[0]) / STEP_S
    return min(max(slope, -STEEPEST_FPM), -SLOWEST_FPM)


def run_up(rate_fpm: float) -> tuple[float, float]:
    """How long before (s), and how far above (ft), a level flight must be told to descend to have a rate in time.

    Example:
        >>> run_up(-2100.0)  # six seconds of 300 ft/min each; the last 300 at once
        (6.0, 90.0)
    """
    seconds = max(abs(rate_fpm) - RAMP_FPM_S, 0.0) / RAMP_FPM_S
    return seconds, RAMP_FPM_S * seconds**2 / 2 / 60


def _flown(rate_fpm: float, target_fpm: float) -> tuple[float, float]:
    """Altitude change (ft) of one step towards another rate, and the rate at its end."""
    change = target_fpm - rate_fpm
    ramp_s = max(abs(change) - RAMP_FPM_S, 0.0) / RAMP_FPM_S
    slope = float(np.sign(change)) * RAMP_FPM_S
    if ramp_s >= STEP_S:
        return (rate_fpm * STEP_S + slope * STEP_S**2 / 2) / 60, rate_fpm + slope * STEP_S
    during = rate_fpm * ramp_s + slope * ramp_s**2 / 2
    return (during + target_fpm * (STEP_S - ramp_s)) / 60, target_fpm
