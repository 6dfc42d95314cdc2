"""Kinds of values that options take, in plain words, by the names of types in sources and in parser errors."""

import re
from collections.abc import Sequence

from descentflow.core.errors import nearest

NUMBERS = {
    "int": "a whole number",
    "float": "a number",
    "PositiveInt": "a whole number above 0",
    "PositiveFloat": "a number above 0",
    "NonNegativeInt": "a whole number, 0 or above",
    "NonNegativeFloat": "a number, 0 or above",
    "OpenUnitInterval": "a number between 0 and 1",
    "ClosedUnitInterval": "a number from 0 to 1",
}
INSIDE = {
    "PositiveInt": lambda value: value > 0,
    "PositiveFloat": lambda value: value > 0,
    "NonNegativeInt": lambda value: value >= 0,
    "NonNegativeFloat": lambda value: value >= 0,
    "OpenUnitInterval": lambda value: 0 < value < 1,
    "ClosedUnitInterval": lambda value: 0 <= value <= 1,
}
"""Kind of number -> whether a value is in its range."""
OTHERS = {
    "bool": "true or false",
    "str": "text",
    "Path": "a path",
    "NoneType": "null for none",
    "list[str]": "a list of names, [a, b]",
    "list[Path]": "a list of paths, [a, b]",
}
FEWEST_PERCENT = 5
"""From here on a number is taken for a share in percent."""
SHARES = ("OpenUnitInterval", "ClosedUnitInterval")
CHOICE = re.compile(r"Literal\[(.*)\]")


def in_words(kinds: Sequence[str]) -> str:
    """Kinds of values, any of which an option takes.

    Example:
        >>> in_words(["list[str]", "NoneType"]), in_words(["Literal['flight', 'aircraft']"])
        ('a list of names, [a, b], or null for none', 'flight or aircraft')
    """
    told = []
    for kind in kinds:
        told += choices(kind) or [NUMBERS.get(kind) or OTHERS.get(kind) or _class_in_words(kind)]
    comma = "," if any("," in one for one in told[:-1]) else ""
    return told[0] if len(told) == 1 else f"{', '.join(told[:-1])}{comma} or {told[-1]}"


def _class_in_words(kind: str) -> str:
    name = kind.rpartition(".")[2]
    return f"a list of classes {name[:-1]}" if "[" in kind else f"the name of a class {name}"


def choices(kind: str) -> list[str]:
    """The words of a kind that is one of some; none of another kind.

    Example:
        >>> choices("typing.Literal['flight', 'aircraft']"), choices("int")
        (['flight', 'aircraft'], [])
    """
    found = CHOICE.search(kind)
    return [] if found is None else [word.strip(" '\"") for word in found[1].split(",")]


def how_to_write(option: str, value: str, kinds: Sequence[str]) -> str:
    """Example of a value that an option of these kinds takes.

    Args:
        option: With its dashes.
        value: What was given.
        kinds: What it takes.

    Example:
        >>> how_to_write("--data.context", "hour", ["list[str]", "NoneType"])
        "write --data.context '[hour]'"
        >>> how_to_write("--data.explained_variance", "80", ["OpenUnitInterval"])
        'write 0.8 for 80 %, --data.explained_variance 0.8'
    """
    words = [word for kind in kinds for word in choices(kind)]
    if words:
        near = nearest(value, words)
        return f"write {option} {near or words[0]}"
    if any(kind in ("list[str]", "list[Path]") for kind in kinds) and value:
        return f"write {option} '[{value}]'"
    share = number_of(value)
    if share is not None and FEWEST_PERCENT <= share <= 100 and any(kind in SHARES for kind in kinds):
        return f"write {share / 100:g} for {share:g} %, {option} {share / 100:g}"
    if "bool" in kinds:
        return f"write {option} true or {option} false"
    return f"write {option} and such a value, or leave it out for its default"


def number_of(value: str) -> float | None:
    """The number that a text is; None if it is none.

    Example:
        >>> number_of("1e-3"), number_of("hour")
        (0.001, None)
    """
    try:
        return float(value)
    except ValueError:
        return None


def is_wrong(value: str, kinds: Sequence[str]) -> bool:
    """True where a value is surely none of these kinds; what is not known here is left to the full parser.

    Example:
        >>> is_wrong("hour", ["list[str]", "NoneType"]), is_wrong("[hour]", ["list[str]", "NoneType"])
        (True, False)
        >>> is_wrong("80", ["OpenUnitInterval"]), is_wrong("hour", ["NobodyKnows"])
        (True, False)
    """
    if not value or (value.lower() in ("null", "~") and "NoneType" in kinds):
        return False
    rest = [kind for kind in kinds if kind != "NoneType"]
    return bool(rest) and all(_is_no(value, kind) for kind in rest)


def _is_no(value: str, kind: str) -> bool:
    if kind in ("list[str]", "list[Path]"):
        return not value.startswith(("[", "{"))
    if kind not in INSIDE:
        return False
    number = number_of(value)
    return not value.startswith(".") if number is None else not INSIDE[kind](number)
