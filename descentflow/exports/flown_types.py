"""Types of aircraft that fly the samples of each model, where several are exported together."""

import re
from collections.abc import Sequence

from descentflow.core.errors import ConfigError

TYPE = re.compile(r"[A-Z][A-Z0-9]+")
"""An ICAO designator, or a class of types that a program has in its place."""


def flown_types(said: Sequence[str], typecodes: Sequence[str]) -> list[tuple[str, ...]]:
    """The types of each model.

    Args:
        said: A text for each model, as ``A319,A320,A321``; nothing for the models' own types.
        typecodes: The models' own.

    Raises:
        ConfigError: If there is not one text for each model, a type is none, or two models fly one type.

    Example:
        >>> flown_types(["A319,A320", "B738"], ["A320", "B738"])
        [('A319', 'A320'), ('B738',)]
        >>> flown_types([], ["A320", "A320"])
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: A320 twice; expected each type once, of one model; to mend it, ...
    """
    texts = list(said or typecodes)
    if len(texts) != len(typecodes):
        raise ConfigError(
            f"types {' '.join(texts)} of {len(typecodes)} model{'s' * (len(typecodes) > 1)}",
            expected="types with commas between them, and one such list for each model",
            mend="write for two models for instance --as A319,A320,A321 B738",
        )
    found = [tuple(word.strip().upper() for word in text.split(",")) for text in texts]
    every = [word for types in found for word in types]
    for word in every:
        if not TYPE.fullmatch(word):
            raise ConfigError(f"type {word!r}", expected="letters and digits", mend="write for instance A320")
        if every.count(word) > 1:
            raise ConfigError(
                f"{word} twice",
                expected="each type once, of one model",
                mend="leave one out, or say by --as which types each model flies",
            )
    return found
