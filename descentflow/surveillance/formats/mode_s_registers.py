"""The Mode S registers that radars ask for, from their 56 bits (ICAO Doc 9871, tables A-2-64, A-2-80 and A-2-96)."""

FIELDS: dict[tuple[int, int], dict[str, tuple[int, int | None, int, int, float]]] = {
    (4, 0): {"selected_altitude": (1, None, 2, 12, 16.0)},
    (5, 0): {
        "roll": (1, 2, 3, 9, 45 / 256),
        "track": (12, 13, 14, 10, 90 / 512),
        "groundspeed": (24, None, 25, 10, 2.0),
        "TAS": (46, None, 47, 10, 2.0),
    },
    (6, 0): {
        "heading": (1, 2, 3, 10, 90 / 512),
        "IAS": (13, None, 14, 10, 1.0),
        "Mach": (24, None, 25, 10, 2.048 / 512),
        "vertical_rate": (35, 36, 37, 9, 32.0),
    },
}
"""Register -> row column -> status bit, sign bit, first bit, number of bits, and unit."""


def values_of(register: tuple[int, int], content: int) -> dict[str, float]:
    """Values of a register: track and heading from 0 to 360 degrees, a selected altitude in whole 100 ft.

    The last is selected in hundreds of feet and sent in steps of 16.

    Example:
        >>> values_of((6, 0), 0xFBF9F51BE3A475)["IAS"]
        250.0
    """
    found = {}
    for name, (status, sign, first, count, unit) in FIELDS.get(register, {}).items():
        if not _bits(content, status, 1):
            continue
        number = _bits(content, first, count)
        if sign is not None and _bits(content, sign, 1):
            number -= 1 << count
        value = number * unit
        if name in ("track", "heading"):
            value %= 360
        found[name] = round(value, -2) if name == "selected_altitude" else value
    return found


def _bits(content: int, first: int, count: int) -> int:
    """Bits of the 56, numbered from 1."""
    return content >> (57 - first - count) & ((1 << count) - 1)
