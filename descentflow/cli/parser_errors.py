"""Messages of the full parser in one line: the option, what was got, what is expected, the mend."""

import re

from descentflow.cli.option_kinds import choices, how_to_write, in_words
from descentflow.core.errors import ConfigError

KEY = re.compile(r'Parser key "([\w.]+)"')
SUBTYPES = re.compile(r"Subtypes: \[(.*?)\](?=\s*(?:Errors|;|\n|$))", re.DOTALL)
RESTRICTED = re.compile(r"Not of type (\w+): (.*?) does not conform")
NO_NUMBER = re.compile(r"Not of type (\w+): .*?: '(.*?)'")
EXPECTED = re.compile(r"Expected an? (.+?)\. Got value: (.*)")
GIVEN = re.compile(r"Given value: (.*)")
NESTED = re.compile(r"NestedArg\(key='.*?', val='(.*?)'\)")
CLASS = re.compile(r"<class '([\w.]+)'>")
NO_FILE = re.compile(r"File does not exist: '(.*?)'")


def config_error(text: str) -> ConfigError:
    r"""The parser's error in plain words.

    Args:
        text: The parser's message, in several lines.

    Example:
        >>> print(config_error("Parser key \"data.seed\":\n  Expected a <class 'int'>. Got value: x"))
        --data.seed is x; expected a whole number; to mend it, write --data.seed and such a value, or leave it out ...
    """
    keys, (kinds, value) = KEY.findall(text), _kinds_and_value(text)
    if not keys or not kinds or value is None:
        return _as_it_is(text)
    option = "--" + (keys[0] if len(keys) == 1 else f"{keys[0]}.{keys[-1]}")
    return ConfigError(f"{option} is {value}", expected=in_words(kinds), mend=how_to_write(option, value, kinds))


def _as_it_is(text: str) -> ConfigError:
    """Message of an unusual error: the parser's own words in a line."""
    missing = NO_FILE.search(text)
    if missing is not None:
        return ConfigError(f"no file {missing[1]}", expected="a file that is there", mend="correct its name")
    return ConfigError(
        "; ".join(part.strip(" -:") for part in text.splitlines() if part.strip()),
        expected="options, files and values as `descentflow fit --help_all` lists them",
        mend="correct the value that is named first",
    )


def _kinds_and_value(text: str) -> tuple[list[str], str | None]:
    """Expected kind, by name, and what was given; of a model's own option that one's."""
    nested = NESTED.search(text)
    for pattern in (RESTRICTED, NO_NUMBER):
        found = pattern.search(text)
        if found is not None and nested is not None:
            return [found[1]], nested[1]
    subtypes, given = SUBTYPES.search(text), GIVEN.findall(text)
    if nested is None and subtypes is not None and given:
        return _names(subtypes[1]), given[-1].strip()
    for pattern in (RESTRICTED, NO_NUMBER):
        if (found := pattern.search(text)) is not None:
            return [found[1]], found[2]
    found = EXPECTED.search(text)
    if found is None:
        return [], None
    return _names(found[1]), nested[1] if nested is not None else found[2].strip()


def _names(types: str) -> list[str]:
    """Types as Python prints them, by their own names."""
    if choices(types):
        return [types]
    found = CLASS.sub(lambda one: one[1].rpartition(".")[2], types)
    kinds = [one.strip() for one in re.split(r",\s*(?![^\[]*\])", found)]
    # The order of the parser's own is not the same in all its versions.
    kinds.sort(key=lambda kind: kind == "NoneType")
    return [kind for kind in kinds if kind != "int" or "float" not in kinds]
