"""Seeds, whole numbers of 64 bits as generators take them."""

from hashlib import blake2b

LEAST, MOST = -(1 << 63), (1 << 63) - 1


def seed_of(seed: int, name: str) -> int:
    """The seed of one of many that are drawn for, a flight for instance, each with draws of its own.

    Example:
        >>> seed_of(0, "KLM204") == seed_of(0, "KLM204"), seed_of(0, "KLM204") == seed_of(0, "KLM205")
        (True, False)
    """
    return int.from_bytes(blake2b(f"{seed} {name}".encode(), digest_size=7).digest())
