"""Types whose files are likely to be wrong alike: of one family, or of one generation of engines."""

from collections.abc import Sequence

import numpy as np

FAMILIES = (
    ("A318", "A319", "A320", "A321", "A19N", "A20N", "A21N"),
    ("B736", "B737", "B738", "B739", "B37M", "B38M", "B39M", "B3XM"),
    ("E170", "E75S", "E75L"),
    ("E190", "E195", "E290", "E295"),
    ("A332", "A333", "A338", "A339"),
    ("A343", "A345", "A346"),
    ("A359", "A35K"),
    ("B762", "B763", "B764"),
    ("B772", "B773", "B77L", "B77W"),
    ("B788", "B789", "B78X"),
    ("AT43", "AT45", "AT72", "AT75", "AT76"),
)
NEW_ENGINES = (
    ("A19N", "A20N", "A21N", "B37M", "B38M", "B39M", "B3XM", "E290", "E295"),
    ("A338", "A339", "A359", "A35K", "B788", "B789", "B78X", "BCS1", "BCS3"),
)
"""Turbofans with a bypass ratio of nine and more."""


def groups_of(typecodes: Sequence[str]) -> np.ndarray:
    """Groups (3, T): all types alike, those of a family, and those of a generation of engines; none for one type alone.

    Example:
        >>> groups_of(["A320", "A20N", "B738"]).tolist()
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
        >>> groups_of(["A320"]).shape
        (0, 1)
    """
    if len(typecodes) == 1:
        return np.zeros((0, 1), dtype=int)
    # A type of no family is one of its own.
    names = [next((family[0] for family in FAMILIES if code in family), code) for code in typecodes]
    family = [names.index(name) for name in names]
    renumbered = [sorted(set(family)).index(number) for number in family]
    return np.array(
        [[0] * len(typecodes), renumbered, [int(any(code in some for some in NEW_ENGINES)) for code in typecodes]]
    )
