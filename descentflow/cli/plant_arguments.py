"""Effects to plant, on the command line: `temperature:deviation_k=10,spread_k=4`."""

import argparse
from collections.abc import Mapping, Sequence
from typing import NoReturn

from descentflow.core.errors import ConfigError
from descentflow.simulation.cause_values import Plantable


def add_arguments(parser: argparse.ArgumentParser, known: Mapping[str, Plantable]) -> None:
    """Declare ``--plant``, and list the effects below the options.

    Args:
        parser: Of a command.
        known: Effects that it can plant.
    """
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = listing(known)
    parser.add_argument(
        "--plant",
        action="append",
        default=[],
        metavar="EFFECT:VALUE=NUMBER,...",
        help="effect to plant in the flights, again for each one: temperature:deviation_k=10,spread_k=4 (see below)",
    )


def listing(known: Mapping[str, Plantable]) -> str:
    """Effects with their values, units and defaults.

    Example:
        >>> from descentflow.simulation.plantable import PLANTABLE
        >>> print(listing({"measurement_noise": PLANTABLE["measurement_noise"]}))
        effects that --plant knows, and their values with defaults:
          measurement_noise: noisier reports of all fields
            factor=3 factor of every standard deviation
    """
    lines = ["effects that --plant knows, and their values with defaults:"]
    for name, effect in known.items():
        lines += [f"  {name}: {effect.says}", *(f"    {value.text}" for value in effect.values)]
    return "\n".join(lines)


def planted(words: Sequence[str]) -> dict[str, dict[str, float]]:
    """Values by the name of the effect.

    Args:
        words: Each `EFFECT` or `EFFECT:VALUE=NUMBER,...`.

    Raises:
        ConfigError: If a word is no such thing, or an effect or a value comes twice. Whether there is such an effect is
            asked where it is planted.

    Example:
        >>> planted(["temperature:deviation_k=10,spread_k=4", "mass"])
        {'temperature': {'deviation_k': 10.0, 'spread_k': 4.0}, 'mass': {}}
    """
    found: dict[str, dict[str, float]] = {}
    for word in words:
        name, _, rest = word.partition(":")
        if name in found:
            raise ConfigError(f"--plant {name} twice", expected="each effect once", mend="put its values in one")
        if "=" in name:
            _complain(word, name)
        found[name] = _numbers(word, rest)
    return found


def _numbers(word: str, text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for pair in text.split(",") if text else []:
        name, _, number = pair.partition("=")
        try:
            value = float(number)
        except ValueError:
            _complain(word, pair)
        if name in found:
            _complain(word, pair)
        found[name] = value
    return found


def _complain(word: str, part: str) -> NoReturn:
    raise ConfigError(
        f"--plant {word}",
        expected="EFFECT:VALUE=NUMBER,VALUE=NUMBER with each value once, as temperature:deviation_k=10",
        mend=f"correct {part!r}",
    )
