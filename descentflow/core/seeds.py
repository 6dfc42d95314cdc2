"""Seeds, whole numbers of 64 bits as generators take them, and numbers of what is drawn."""

import argparse
import operator
from hashlib import blake2b

from descentflow.core.errors import ConfigError

LEAST, MOST = -(1 << 63), (1 << 63) - 1
MOST_NUMBERED = 1 << 53
"""Numbers of draws below which float64 and every counter hold them exactly."""


def checked_seed(seed: int) -> int:
    """The seed, if a generator takes it.

    Raises:
        ConfigError: If it is no number of 64 bits.

    Example:
        >>> checked_seed(3)
        3
        >>> checked_seed(1 << 64)
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: a seed of 18446744073709551616; expected ...
    """
    number = _whole(seed)
    if number is None or not LEAST <= number <= MOST:
        raise ConfigError(
            f"a seed of {_shown(seed)}", expected="a whole number from -2^63 to 2^63 - 1", mend="pass another one"
        )
    return number


def seed_of(seed: int, name: str) -> int:
    """The seed of one of many that are drawn for, a flight for instance, each with draws of its own.

    Raises:
        ConfigError: If the seed is no number of 64 bits.

    Example:
        >>> seed_of(0, "KLM204") == seed_of(0, "KLM204"), seed_of(0, "KLM204") == seed_of(0, "KLM205")
        (True, False)
    """
    return int.from_bytes(blake2b(f"{checked_seed(seed)} {name}".encode(), digest_size=7).digest())


def checked_count(n: int, of: str) -> int:
    """Count that was asked for, if it is a number of things.

    Args:
        n: The number.
        of: What they are, in the plural.

    Raises:
        ConfigError: If it is no whole number, or none is wanted.

    Example:
        >>> checked_count(3, "descents")
        3
        >>> checked_count(1.5, "descents")
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: 1.5 descents; expected a whole number of them, at least one; ...
    """
    number = _whole(n)
    if number is None or number < 1:
        raise ConfigError(
            f"{_shown(n)} {of}", expected="a whole number of them, at least one", mend="ask for a positive number"
        )
    return number


def checked_number(number: int) -> int:
    """The number of a draw.

    Raises:
        ConfigError: If it is no whole number from 0 to 2^53.

    Example:
        >>> checked_number(7)
        7
        >>> checked_number("KLM204")
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: a draw numbered 'KLM204'; expected ...; to mend it, number your flights, \
or take zlib.crc32(text.encode()) of a callsign
    """
    found = _whole(number)
    if found is None or not 0 <= found <= MOST_NUMBERED:
        raise ConfigError(
            f"a draw numbered {_shown(number)}",
            expected="a whole number from 0 to 2^53",
            mend="number your flights, or take zlib.crc32(text.encode()) of a callsign",
        )
    return found


def _whole(number: object) -> int | None:
    """The number as an int, of NumPy's and torch's whole numbers too; none if it is no whole number."""
    try:
        return operator.index(number)  # type: ignore[arg-type]
    except TypeError:
        return None


def _shown(number: object) -> str:
    """A number as it is written, anything else as Python shows it, in a few letters of one line."""
    return str(number)[:40] if isinstance(number, int | float) else " ".join(repr(number).split())[:40]


def seed_word(text: str) -> int:
    """The seed in a word of the command line, for argparse.

    Example:
        >>> seed_word("3")
        3
    """
    try:
        return checked_seed(int(text))
    except (ValueError, ConfigError) as error:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}; expected a whole number from -2^63 to 2^63 - 1") from error
