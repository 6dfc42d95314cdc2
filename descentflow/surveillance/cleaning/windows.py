"""Windows of time around the rows of each flight, computed for all rows at once."""

import numpy as np
from numpy.typing import NDArray

from descentflow.surveillance.rows.air_data import Array

Index = NDArray[np.int64]

PAUSE_S = 1e6
"""Time between two flights on the common clock; longer than any window."""
SLACK_S = 1e-6
"""Added to both ends of a window, so that a row exactly at an end is inside in spite of rounding."""


def clock_of(flight: Index, seconds: Array) -> Array:
    """One ascending clock for all flights, with a long time between two, so that no window has rows of both.

    Args:
        flight: (n,) number of the flight, equal for the rows of one flight, which are neighbours.
        seconds: (n,) ascending within a flight.

    Example:
        >>> clock_of(np.array([0, 0, 1]), np.array([5.0, 7.0, 6.0])) - PAUSE_S
        array([0.000000e+00, 2.000000e+00, 1.000002e+06])
    """
    step = np.diff(seconds, prepend=seconds[:1])
    return np.cumsum(np.where(np.diff(flight, prepend=flight[:1] - 1) != 0, PAUSE_S, step))


def windows(clock: Array, start_s: float, stop_s: float) -> tuple[Index, Index]:
    """First row, and one after the last, of the window from `start_s` to `stop_s` after each row.

    Args:
        clock: (n,) as :func:`clock_of`.
        start_s: Begin of the window, negative before the row.
        stop_s: End of the window.

    Returns:
        (n,) first rows, and (n,) rows after the last.

    Example:
        >>> windows(np.array([0.0, 1.0, 2.0, 10.0]), -1.0, 1.0)
        (array([0, 0, 1, 3]), array([2, 3, 3, 4]))
    """
    first = np.searchsorted(clock, clock + (start_s - SLACK_S))
    return first, np.searchsorted(clock, clock + (stop_s + SLACK_S), side="right")


def window_sum(values: Array, first: Index, last: Index) -> Array:
    """Sum of values[first:last] for every window.

    Each window is summed by itself: differences of running sums over millions of rows would lose the digits that a
    variance needs. The time therefore grows with the windows' length, and they should be sorted.

    Example:
        >>> window_sum(np.array([1.0, 2.0, 4.0]), np.array([0, 1, 3]), np.array([2, 3, 3]))
        array([3., 6., 0.])
    """
    return np.where(last > first, _reduced(np.add, values, first, last), 0.0)


def window_max(values: Array, first: Index, last: Index) -> Array:
    """Largest of values[first:last] for every window, none of which may be empty.

    Example:
        >>> window_max(np.array([1.0, 4.0, 2.0]), np.array([0, 2]), np.array([2, 3]))
        array([4., 2.])
    """
    return _reduced(np.maximum, values, first, last)


def _reduced(operation: np.ufunc, values: Array, first: Index, last: Index) -> Array:
    ends = np.empty(2 * len(first), dtype=np.int64)
    ends[::2], ends[1::2] = first, last
    return np.asarray(operation.reduceat(np.append(values, 0.0), ends)[::2])
