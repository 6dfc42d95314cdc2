"""Seeds: whole numbers of 64 bits, as generators take them."""

import argparse

from descentflow.core.errors import ConfigError

LEAST, MOST = -(1 << 63), (1 << 63) - 1


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
    if not LEAST <= seed <= MOST:
        raise ConfigError(
            f"a seed of {seed}", expected="a whole number from -2^63 to 2^63 - 1", mend="pass a smaller one"
        )
    return seed


def seed_word(text: str) -> int:
    """The seed in a word of the command line, for argparse.

    Example:
        >>> seed_word("3")
        3
    """
    try:
        return checked_seed(int(text))
    except (ValueError, ConfigError) as error:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is no whole number from -2^63 to 2^63 - 1") from error
