"""Sums over windows of time within each flight, all rows at once, by running sums."""

import numpy as np

from descentflow.surveillance.airdata import Array


def time_in_flight(flight: np.ndarray, seconds: Array) -> Array:
    """Seconds since the flight's first row; small numbers keep running sums exact.

    Args:
        flight: (n,) number of the flight, equal for the rows of one flight, which stand together.
        seconds: (n,) ascending within a flight.
    """
    begins = np.flatnonzero(np.diff(flight, prepend=flight[:1] - 1))
    return seconds - np.repeat(seconds[begins], np.diff(begins, append=len(flight)))


def windows(flight: np.ndarray, time: Array, back_s: float, ahead_s: float) -> tuple[np.ndarray, np.ndarray]:
    """First row, and one past the last, of the same flight within `back_s` before and `ahead_s` after each row.

    Args:
        flight: (n,) as in :func:`time_in_flight`.
        time: (n,) seconds in the flight, from there.
        back_s: Reach backwards.
        ahead_s: Reach forwards.
    """
    number = np.cumsum(np.diff(flight, prepend=flight[:1]) != 0)
    key = number * (time.max(initial=0.0) + 2 * (back_s + ahead_s) + 1) + time
    # A row exactly at the reach is inside, whatever the rounding of the key.
    slack = 1e-6
    return np.searchsorted(key, key - back_s - slack), np.searchsorted(key, key + ahead_s + slack, side="right")


def window_sum(values: Array, first: np.ndarray, last: np.ndarray) -> Array:
    """Sum of values[first:last] for every window.

    Example:
        >>> window_sum(np.array([1.0, 2.0, 4.0]), np.array([0, 1]), np.array([2, 3]))
        array([3., 6.])
    """
    running = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(running[last] - running[first])
