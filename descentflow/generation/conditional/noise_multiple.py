"""Scale of the observation noise assumed for the flown part."""

from descentflow.core.errors import ConfigError

LEAST, MOST = 1e-4, 1e4
"""Of the variance: a hundredth of the noise, and a hundred times it."""


def checked_multiple(multiple: float) -> float:
    """The multiple of the noise's variance, if it is one.

    Raises:
        ConfigError: If it is no number within the limits.

    Example:
        >>> checked_multiple(2)
        2.0
        >>> checked_multiple(0)
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: a noise multiple of 0; expected a number from 0.0001 to 10000, ...
    """
    try:
        number = float(multiple)
    except (TypeError, ValueError):
        number = float("nan")
    if not LEAST <= number <= MOST:
        raise ConfigError(
            f"a noise multiple of {multiple!r:.40}",
            expected=f"a number from {LEAST:g} to {MOST:g}, by which the noise's variance is multiplied",
            mend="leave it out, or take 0.001 where what was flown has no noise",
        )
    return number
