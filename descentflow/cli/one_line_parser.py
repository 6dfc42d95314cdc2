"""A parser of options whose errors are a line, with the nearest names, in place of the whole usage."""

import argparse
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from descentflow.core.errors import ConfigError, nearest

SAID = tuple(
    (re.compile(pattern, re.DOTALL), got, expected)
    for pattern, got, expected in (
        (r"argument (?P<name>\S+): invalid (?P<kind>\S+) value: (?P<value>.*)", "{name} is {value}", "{kind}"),
        (r"argument (?P<name>\S+): (?P<value>.*); expected (?P<wanted>.*)", "{name} is {value}", "{wanted}"),
        (
            r"argument (?P<name>\S+): invalid choice: (?P<value>.*) \(choose from (?P<wanted>.*)\)",
            "{name} is {value}",
            "one of {wanted}",
        ),
        (r"argument (?P<name>\S+): expected (?P<wanted>.*)", "{name} without its value", "{wanted}"),
        (
            r"argument (?P<name>\S+): ignored explicit argument (?P<value>.*)",
            "{name} is {value}",
            "{name} without a value",
        ),
        (r"argument (?P<name>\S+): not allowed with argument (?P<other>\S+)", "{name} and {other}", "one of them"),
        (r"the following arguments are required: (?P<names>.*)", "no {names}", "what has no default"),
        (r"one of the arguments (?P<names>.*) is required", "none of {names}", "one of them"),
        (
            r"ambiguous option: (?P<value>.*) could match (?P<wanted>.*)",
            "{value}, which begins several",
            "one of {wanted}",
        ),
        (r"unrecognized arguments: (?P<words>.*)", "no option {words}", "an option of {prog}"),
    )
)
"""Messages of argparse, and the parts of ours: the first that matches. Our own types name what they expected."""
BEGINS_AS_A_NUMBER = re.compile(r"-\.?\d")
KINDS = {"int": "a whole number", "float": "a number", "Path": "a path"}


class OneLineParser(argparse.ArgumentParser):
    """As :class:`argparse.ArgumentParser`, which prints every option of the command before what is wrong.

    Example:
        >>> parser = OneLineParser(prog="descentflow sample")
        >>> _ = parser.add_argument("--seed", type=int)
        >>> print(parser.told("argument --seed: invalid int value: 'x'"))
        --seed is 'x'; expected a whole number; to mend it, see descentflow sample --help, which has every option
        >>> print(parser.told("unrecognized arguments: --sede 3"))
        no option --sede 3; expected an option of descentflow sample; to mend it, try --seed, or see \
descentflow sample --help, which has every option
        >>> _ = parser.add_argument("--out", required=True)
        >>> _ = parser.parse_known_args(["--out", "a.csv", "--seed", "3"])
        >>> parser.words = ("--ouput", "a.csv")
        >>> print(parser.told("the following arguments are required: --out"))
        no --out, and no option --ouput is known; expected what has no default; to mend it, try --out, or see \
descentflow sample --help, which has every option
    """

    words: Sequence[str] = ()
    """Words that are parsed."""

    def __init__(self, *words: Any, **settings: Any) -> None:
        """As argparse's own, but what begins with a minus and a digit is a value: a southern point is no option."""
        super().__init__(*words, **settings)
        self._negative_number_matcher = BEGINS_AS_A_NUMBER

    # The overloads of argparse differ in the namespace alone.
    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """As argparse does; the words are kept for what is said of them."""
        self.words = sys.argv[1:] if args is None else args
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Print what is wrong in a line, and end with status 2."""
        print(f"{self.prog}: {self.told(message)}", file=sys.stderr)
        raise SystemExit(2)

    def told(self, message: str) -> str:
        """Messages of argparse in one line: what was got, what was expected, how to mend it."""
        got, expected, words, parts = message, f"what {self.prog} --help says", "", dict[str, str]()
        for pattern, of_got, of_expected in SAID:
            if found := pattern.fullmatch(message):
                parts = found.groupdict() | {"prog": self.prog}
                parts["kind"] = KINDS.get(parts.get("kind", ""), parts.get("kind", ""))
                got, expected, words = of_got.format(**parts), of_expected.format(**parts), parts.get("words", "")
                break
        typed = [word.partition("=")[0] for word in words.split() if word.startswith("-")]
        # argparse misses what is required before it looks at what it does not know: the latter is the mistake.
        if "names" in parts and (typed := self._unknown()):
            got += f", and no option {', '.join(typed)} is known"
        meant = ", ".join(filter(None, (nearest(word, self._option_string_actions) for word in typed)))
        mend = f"{f'try {meant}, or ' if meant else ''}see {self.prog} --help, which has every option"
        return str(ConfigError(got, expected=expected, mend=mend))

    def _unknown(self) -> list[str]:
        """Options among the words that are neither known nor the beginning of one that is."""
        typed = [word.partition("=")[0] for word in self.words if word.startswith("--") and len(word) > len("--")]
        return [word for word in typed if not any(known.startswith(word) for known in self._option_string_actions)]
