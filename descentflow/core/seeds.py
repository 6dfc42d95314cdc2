"""Seeds, whole numbers of 64 bits as generators take them."""

import argparse
from hashlib import blake2b

LEAST, MOST = -(1 << 63), (1 << 63) - 1


def seed_of(seed: int, name: str) -> int:
    """The seed of one of many that are drawn for, a flight for instance, each with draws of its own.

    Example:
        >>> seed_of(0, "KLM204") == seed_of(0, "KLM204"), seed_of(0, "KLM204") == seed_of(0, "KLM205")
        (True, False)
    """
    return int.from_bytes(blake2b(f"{seed} {name}".encode(), digest_size=7).digest())


def seed_word(text: str) -> int:
    """The seed in a word of the command line, for argparse.

    Example:
        >>> seed_word("3")
        3
    """
    try:
        if LEAST <= (seed := int(text)) <= MOST:
            return seed
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"{text[:40]!r}; expected a whole number from -2^63 to 2^63 - 1")
