"""A parser of options whose errors are a line, with the nearest names, in place of the whole usage."""

import argparse
import re
import sys
from collections.abc import Iterable
from difflib import get_close_matches
from typing import NoReturn

UNKNOWN = re.compile(r"unrecognized arguments: (?P<words>.*)", re.DOTALL)


class OneLineParser(argparse.ArgumentParser):
    """As :class:`argparse.ArgumentParser`, which prints every option of the command before what is wrong.

    Example:
        >>> parser = OneLineParser(prog="descentflow sample")
        >>> _ = parser.add_argument("--seed", type=int)
        >>> parser.told("argument --seed: expected one argument")
        'argument --seed: expected one argument; descentflow sample --help lists all options'
        >>> parser.told("unrecognized arguments: --sede 3")
        'unrecognized arguments: --sede 3; did you mean --seed? descentflow sample --help lists all options'
    """

    def error(self, message: str) -> NoReturn:
        """Print what is wrong in a line, and end with status 2."""
        print(f"{self.prog}: {self.told(message)}", file=sys.stderr)
        raise SystemExit(2)

    def told(self, message: str) -> str:
        """A message of argparse with the nearest option where one is unknown, and the way to all of them."""
        unknown = UNKNOWN.fullmatch(message)
        words = [word.partition("=")[0] for word in (unknown["words"].split() if unknown else ())]
        meant = [nearest(word, self._option_string_actions) for word in words if word.startswith("-")]
        hint = f"; did you mean {', '.join(filter(None, meant))}?" if any(meant) else ";"
        return f"{message}{hint} {self.prog} --help lists all options"


def nearest(word: str, names: Iterable[str]) -> str:
    """The name that a mistyped word is nearest to; empty if it is near none.

    Example:
        >>> nearest("prepar", ["prepare", "predict"]), nearest("xyz", ["prepare"])
        ('prepare', '')
    """
    return next(iter(get_close_matches(word, list(names), n=1)), "")
