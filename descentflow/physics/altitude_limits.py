"""Comparison of altitudes with BADA's thresholds, which are whole feet.

``15 * 30.48`` is smaller than ``1500 * 0.3048`` in floating point, by one unit in the last place: a flight level that
is exactly a threshold must not count as below it for that. Altitudes within five millimetres of a threshold are taken
to be equal to it.
"""

from torch import Tensor

SLACK_M = 5e-3
"""Above the rounding of float32 altitudes (1 mm at 40,000 ft), far below any height that matters."""


def is_below(altitude_m: Tensor, threshold_m: float | Tensor) -> Tensor:
    """Return True strictly below a threshold.

    Example:
        >>> import torch
        >>> is_below(torch.tensor(15 * 30.48, dtype=torch.float64), 1500 * 0.3048).item()
        False
    """
    return altitude_m < threshold_m - SLACK_M


def is_above(altitude_m: Tensor, threshold_m: float | Tensor) -> Tensor:
    """Return True strictly above a threshold.

    Example:
        >>> import torch
        >>> is_above(torch.tensor(3000.0), 3000.0).item()
        False
    """
    return altitude_m > threshold_m + SLACK_M
