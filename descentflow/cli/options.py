"""Options of a command: the parameters of its function, with the texts of its docstring.

Positional parameters are arguments; those by keyword are options, which are required where they have no default. A
list takes several values, again and again; a `bool` is a flag. In `Annotated`, a function reads the value, and a text
that begins with a minus is a name of the option.
"""

import argparse
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Sequence
from importlib import import_module
from inspect import Parameter
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NoReturn, TypedDict, Union, get_args, get_origin, get_type_hints

from docstring_parser import DocstringParam, parse

from descentflow.core.errors import ConfigError

BEGINS_AS_A_NUMBER = re.compile(r"-\.?\d")


class CommandParser(argparse.ArgumentParser):
    """The parser of one command, whose errors are a line.

    Example:
        >>> def echo(words: list[str], *, times: Annotated[int, "-n"] = 1) -> None:
        ...     '''Print words.
        ...
        ...     Args:
        ...         words: What to print.
        ...         times: How often.
        ...     '''
        >>> CommandParser("echo", echo).parse_args(["a", "b", "-n", "2"])
        Namespace(words=['a', 'b'], times=2)
    """

    def __init__(self, name: str, function: Callable[..., None]) -> None:
        text = parse(inspect.getdoc(function) or "")
        description = " ".join((text.description or "").split())
        super().__init__(
            prog=f"descentflow {name}",
            description=textwrap.fill(description, 100, break_on_hyphens=False),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        self._negative_number_matcher = BEGINS_AS_A_NUMBER  # a southern point is no option
        texts = {param.arg_name: param for param in text.params}
        hints = get_type_hints(function, include_extras=True)
        for parameter in inspect.signature(function).parameters.values():
            if parameter.kind is parameter.VAR_KEYWORD:
                for group in get_args(hints[parameter.name]):  # of Unpack
                    self._add_group(group)
            else:
                self._add(self, parameter, hints[parameter.name], texts.get(parameter.name))

    def error(self, message: str) -> NoReturn:
        """Print what is wrong in a line, and end with status 2."""
        error = ConfigError(message, expected="arguments as its help lists them", mend=f"see {self.prog} --help")
        print(f"{self.prog}: {error}", file=sys.stderr)
        raise SystemExit(2)

    def _add_group(self, group: Any) -> None:
        """The keys of a `TypedDict`, each passed on only where it is given."""
        text = parse(inspect.getdoc(group) or "")
        place = self.add_argument_group((text.short_description or "").rstrip("."), text.long_description)
        texts = {param.arg_name: param for param in text.params}
        for name, hint in get_type_hints(group, include_extras=True).items():
            parameter = Parameter(name, Parameter.KEYWORD_ONLY, default=argparse.SUPPRESS)
            self._add(place, parameter, hint, texts.get(name))

    def _add(self, place: Any, parameter: Parameter, hint: Any, text: DocstringParam | None) -> None:
        """An argument, or an option; a type in the docstring is what the help calls its value.

        There is no text where Python was asked to leave docstrings out (-OO).
        """
        settings, names = _kind(hint)
        required = parameter.default is Parameter.empty
        settings["help"] = "" if text is None else _help(text, parameter.default)
        if not required:
            settings["default"] = parameter.default
        if parameter.kind is Parameter.KEYWORD_ONLY:
            if not any(name.startswith("--") for name in names):
                names.append(f"--{parameter.name.rstrip('_').replace('_', '-')}")
            if settings.get("action") != "store_true" and "choices" not in settings:
                shown = (text and text.type_name) or names[-1].lstrip("-").replace("-", "_").upper()
                settings["metavar"] = tuple(shown.split()) if "," not in shown and " " in shown else shown
            place.add_argument(*names, dest=parameter.name, required=required, **settings)
        else:
            if settings.pop("action", "") == "extend" and not required:
                settings["nargs"] = "*"
            place.add_argument(parameter.name, **settings)


def _help(text: DocstringParam, default: Any) -> str:
    """The text of an option, with its default."""
    described = " ".join((text.description or "").split())
    if type(default) in (int, float, str) and default not in ("", argparse.SUPPRESS) and "(default" not in described:
        described += f" (default: {default})"
    return described.replace("%", "%%")


def _kind(hint: Any) -> tuple[dict[str, Any], list[str]]:
    """Settings of argparse for values of a type, and names that its option has."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        settings, names = _kind(inside[0])
        readers = [reader for reader in inside[1:] if callable(reader)]
        return {"type": readers[0]} if readers else settings, names + [
            name for name in inside[1:] if isinstance(name, str)
        ]
    if origin in (Union, UnionType):
        return _kind(inside[0])
    if origin is Literal:
        return {"choices": inside}, []
    if origin is list:
        return _kind(inside[0])[0] | {"nargs": "+", "action": "extend"}, []
    if origin is tuple:
        return _kind(inside[0])[0] | {"nargs": len(inside)}, []
    return {"action": "store_true"} if hint is bool else {"type": path if hint is Path else hint}, []


def path(text: str) -> Path:
    """A path; an empty text would be the working directory.

    Example:
        >>> path("rows.parquet")
        PosixPath('rows.parquet')
    """
    if not text:
        raise argparse.ArgumentTypeError("an empty path")
    return Path(text)


def point(text: str) -> tuple[float, float]:
    """LAT,LON in degrees, with a sign or with a letter.

    Example:
        >>> point("33.95S,151.18E")
        (-33.95, 151.18)
    """
    try:
        latitude, longitude = (part.strip() for part in text.split(","))
        return _degrees(latitude, "NS"), _degrees(longitude, "EW")
    except ValueError as error:
        expected = "LAT,LON in degrees, as 51.47,-0.45 or 33.95S,151.18E"
        raise argparse.ArgumentTypeError(f"{text!r}; expected {expected}") from error


def _degrees(text: str, letters: str) -> float:
    if text[-1:].upper() in tuple(letters):
        return float(text[:-1]) * (-1 if text[-1].upper() == letters[1] else 1)
    return float(text)


class Where(TypedDict, total=False):
    """positions.

    Every table has the distance flown and the distance to go (NM), the distance from the top of descent to the end
    point (NM) and the groundspeed (kt). With an end point and a track, or with a route, it has latitude, longitude and
    track too: descents are laid back from the end point.

    Attributes:
        end (LAT,LON): point where descents end, a threshold or a fix: 51.47,-0.45; or -33.95,151.18, also as
            33.95S,151.18E
        track (DEG): true track on which they arrive there
        route (LAT,LON): in place of both, fixes in the order in which they are flown; the last one is the end point
        to_go_nm (NM): distance left to the end point where the model's lowest level is passed (default: 0)
        wind (WIND): FROM/KT as 270/35, by flight level as 100:250/20,300:270/60, or a NetCDF or GRIB file of winds on
            pressure levels (needs the extra `wind`); still air by default
        end_time (UTC): when the lowest level is passed, as 2026-11-22T10:00:00; adds timestamps, and chooses within a
            file of winds at several times
    """

    end: Annotated[tuple[float, float], point]
    track: float
    route: list[Annotated[tuple[float, float], point]]
    to_go_nm: Annotated[float, "--to-go"]
    wind: str
    end_time: Annotated[str, "--time"]


class Sides(TypedDict, total=False):
    """flights of both sides.

    Attributes:
        typecode: without --simulator: nominal BADA of this type at each flight's own speed, for instance A320; with a
            simulator's flights: the type whose coefficients carry rates from one airspeed to another and give the
            signatures of effects (default: their own)
        nearest_type: where the flights' type has no coefficients, take those of the nearest type: as many engines of
            the same kind, nearest in take-off mass
        any_type: take real flights of all types; without it those of other types than the checkpoint's or --typecode's
            are left out and counted
        bada_dir: folder of BADA 3 or 4 for --typecode or a simulator's flights (default: open aircraft)
        columns (NAME=COLUMN): column of the real rows' tables for a name of the rows, as in `descentflow prepare`:
            altitude=alt_ft, or altitude=alt_m*3.2808; may be given again
        simulator_columns (NAME=COLUMN): the same of the rows of the simulator's flights
        simulator_name: name of the simulator on the page (default: the simulator)
    """

    typecode: Annotated[str, str.upper]
    nearest_type: bool
    any_type: bool
    bada_dir: Path
    columns: Annotated[list[str], "--column"]
    simulator_columns: Annotated[list[str], "--simulator-column"]
    simulator_name: str


def of_sides(given: Sides) -> dict[str, Any]:
    """Arguments for both sides as :func:`~descentflow.diagnosis.diagnose.diagnose` takes them."""
    real, simulated = given.get("columns", ()), given.get("simulator_columns", ())
    return {**given, "columns": pairs("--column", real), "simulator_columns": pairs("--simulator-column", simulated)}


def pairs(option: str, words: Sequence[str]) -> dict[str, str]:
    """Values by name, of words `NAME=VALUE`.

    Raises:
        ConfigError: If a word is none, or a name comes twice.

    Example:
        >>> pairs("--given", ["operator=FST", "hour="])
        {'operator': 'FST', 'hour': ''}
    """
    split = [word.partition("=") for word in words]
    values = {name: value for name, _, value in split}
    if len(values) < len(words) or not all(name and equals for name, equals, _ in split):
        raise ConfigError(
            f"{option} {' '.join(words)}", expected="NAME=VALUE, each name once", mend="correct the words"
        )
    return values


def context_of(given: Sequence[str] | None, table: Path | None) -> dict[str, str | None] | Path | None:
    """The context that words or a table stand for; None if there are neither.

    Raises:
        ConfigError: If there are both.
    """
    if given and table:
        raise ConfigError("both --given and --given-table", expected="one of them", mend="leave one of them out")
    return {name: value or None for name, value in pairs("--given", given).items()} if given else table


def one_or_several(words: list[Any] | None) -> Any:
    """The only one of a list, else all; None if there are none."""
    return words[0] if words is not None and len(words) == 1 else words


def class_in(path: str) -> str:
    """The place of the model that a user's file defines; from then on a checkpoint may hold its density.

    Raises:
        ConfigError: If it has none, or fails.

    Example:
        >>> class_in("absent.py")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: absent.py: no such file; expected a Python file with a density ...
    """
    print(f"descentflow: runs {path} for the density that it defines", file=sys.stderr)
    own = import_module("descentflow.training.training_settings").model_of_file(path)
    return f"{own.__module__}.{own.__name__}"
