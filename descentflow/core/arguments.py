"""Check of arguments of public functions by their annotations before anything is done with them."""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from inspect import Parameter, signature
from math import inf
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, ParamSpec, TypeVar, Union, get_args, get_origin

from descentflow.core._remote_files import has_address, with_local_files
from descentflow.core.errors import ConfigError
from descentflow.core.files import is_name
from descentflow.core.tabular import held_table

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
LONGEST_SHOWN = 60
"""Characters of a wrong value that are shown."""
BITS = " of 64 bits"
INT64_MAX = (1 << 63) - 1


class Within(NamedTuple):
    """Least and greatest value of a number, in its annotation."""

    low: float
    high: float = inf

    @property
    def words(self) -> str:
        """Both in words."""
        return f"{self.low:,} or more" if self.high == inf else f"from {self.low:,} to {self.high:,}"


Count = Annotated[int, Within(1)]
"""A number of things, at least one."""
NotNegativeInt = Annotated[int, Within(0)]
Seed = Annotated[int, Within(0, (1 << 32) - 1)]
"""A seed that the generators of NumPy and torch take alike."""
Numbered = Annotated[int, Within(0, 1 << 53)]
"""A number of a draw, which float64 and every counter hold exactly."""
NotNegativeFloat = Annotated[float, Within(0)]
Output = Annotated[str | Path, "a path"]
"""A file or a folder to write; one elsewhere is sent when the function has ended well."""


class ArgumentKind(NamedTuple):
    """Values that an annotation takes: their description, and a test of a value."""

    words: str
    takes: Callable[[Any], bool]


def checked_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function refuse arguments that are not of the annotated kinds.

    Numbers of NumPy and torch are passed on as Python's own, tables as those of Polars where these are taken, and
    addresses as copies (``_remote_files``). A text is a path too; a list, a tuple, an array and a column are all
    sequences. Missing and unknown names remain Python's own `TypeError`.

    Example:
        >>> @checked_arguments
        ... def first(names: Sequence[str], n: Count = 1) -> list[str]:
        ...     return list(names[:n])
        >>> first(["a", "b"])
        ['a']
        >>> first(["a", "b"], n=0)
        Traceback (most recent call last):
        ...
        descentflow.core.errors.ConfigError: n = 0; expected a whole number, 1 or more; to mend it, see help(first)
    """
    parameters = signature(function)
    kinds = {name: kind_of(one.annotation) for name, one in parameters.parameters.items() if _is_checked(one)}
    hints = {name: one.annotation for name, one in parameters.parameters.items()}
    outputs = [name for name, hint in hints.items() if Output in (hint, *get_args(hint))]
    is_constructor = function.__name__ == "__init__"

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            bound = parameters.bind(*args, **kwargs)
        except TypeError:
            return function(*args, **kwargs)  # this raises, with the function's name
        for name, kind in kinds.items():
            if name in bound.arguments:
                value = bound.arguments[name]
                if not (getattr(value, "requires_grad", False) and kind.takes(value)):
                    value = _plain(value)
                if not kind.takes(value):
                    value = held_table(value)
                bound.arguments[name] = value
                if not kind.takes(value):
                    place = function.__qualname__.removesuffix(".__init__")
                    raise ConfigError(f"{name} = {_shown(value)}", expected=kind.words, mend=f"see help({place})")

        # What a constructor is given is read later, by functions that fetch it.
        if is_constructor or not has_address(bound.arguments):
            return function(*bound.args, **bound.kwargs)

        def call(arguments: Mapping[str, Any]) -> R:
            bound.arguments.update(arguments)
            return function(*bound.args, **bound.kwargs)

        return with_local_files(call, bound.arguments, outputs)

    return checked


def checked_settings(settings: type[T]) -> type[T]:
    """Let a dataclass refuse fields that are not of the annotated kinds."""
    settings.__init__ = checked_arguments(settings.__init__)  # type: ignore[method-assign]
    return settings


def kind_of(hint: Any) -> ArgumentKind:
    """Kind of an annotation; an `Annotated` one may have limits (:class:`Within`) or a description of its own."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        plain, more = kind_of(inside[0]), inside[1]
        if isinstance(more, str):
            return ArgumentKind(more, plain.takes)
        words = f"{plain.words.removesuffix(BITS)}, {more.words}"
        return ArgumentKind(words, lambda value: plain.takes(value) and more.low <= value <= more.high)
    if origin in (Union, UnionType):
        kinds = [kind_of(part) for part in inside if not (part is str and Path in inside)]
        return ArgumentKind(
            " or ".join(kind.words for kind in kinds), lambda value: any(kind.takes(value) for kind in kinds)
        )
    if origin is Literal:
        return ArgumentKind(" or ".join(map(repr, inside)), lambda value: isinstance(value, str) and value in inside)
    if origin is Callable:
        return ArgumentKind(f"a function of {len(inside[0])} argument", lambda value: _can_be_called(value, inside[0]))
    if origin is tuple:
        parts = [kind_of(part) for part in inside]
        words = f"({', '.join(part.words for part in parts)})"
        return ArgumentKind(
            words, lambda value: _is_sequence(value) and len(value) == len(parts) and _all_of(value, parts)
        )
    if origin is list:
        each = kind_of(inside[0])
        words = f"a list, each {each.words},"
        return ArgumentKind(words, lambda value: isinstance(value, list | tuple) and all(map(each.takes, value)))
    if origin is Sequence:
        each = kind_of(inside[0])
        words = f"several, each {each.words},"
        return ArgumentKind(words, lambda value: _is_sequence(value) and _all_of(value, [each] * len(value)))
    if origin is Mapping:
        key, held = map(kind_of, inside)
        words = f"a dictionary of {key.words} to {held.words}"
        return ArgumentKind(
            words,
            lambda value: (
                isinstance(value, Mapping)
                and not hasattr(value, "to_dataframe")  # of xarray: a table
                and all(key.takes(k) and held.takes(v) for k, v in value.items())
            ),
        )
    return _kind_of_one(origin or hint)


def _kind_of_one(hint: Any) -> ArgumentKind:
    """Of a class, or anything at all."""
    if hint in (Any, object) or not isinstance(hint, type):
        # A text among anything is a path or a designator.
        return ArgumentKind(
            "a name that files can have", lambda value: not isinstance(value, str | Path) or is_name(value)
        )
    if hint is Path:
        return ArgumentKind("a path", lambda value: isinstance(value, str | os.PathLike) and is_name(value))
    if hint is str:
        return ArgumentKind("a text", lambda value: isinstance(value, str) and _is_text(value))
    if hint in (NoneType, bool):
        return ArgumentKind("None" if hint is NoneType else "True or False", lambda value: isinstance(value, hint))
    if getattr(hint, "_is_protocol", False):  # names alone are not enough: `at` of a pandas table is no method
        methods = [name for name, one in vars(hint).items() if name[0] != "_" and callable(one)]
        return ArgumentKind(
            f"a {hint.__name__} of descentflow",
            lambda value: all(callable(getattr(value, name, None)) for name in methods),
        )
    if issubclass(hint, int | float):
        words, number = (f"a whole number{BITS}", Integral) if issubclass(hint, int) else ("a finite number", Real)
        bounds = (hint.__doc__ or "").partition("restricted to be")[2]  # of jsonargparse's own numbers
        return ArgumentKind(words + bounds, lambda value: _is_number(number, value) and _can_be_made(hint, value))
    return ArgumentKind(
        f"a {hint.__name__} of {hint.__module__.partition('.')[0]}", lambda value: isinstance(value, hint)
    )


def _is_checked(parameter: Parameter) -> bool:
    return parameter.kind is not Parameter.VAR_KEYWORD and parameter.annotation is not Parameter.empty


def _is_sequence(value: object) -> bool:
    """Arrays and columns are no `Sequence`; a text is one, of letters, and a table looks like one, of columns."""
    whole = hasattr(value, "__len__") and hasattr(value, "__getitem__") and not hasattr(value, "columns")
    return whole and not isinstance(value, str | bytes | Mapping)


def _all_of(values: Any, kinds: Sequence[ArgumentKind]) -> bool:
    return all(kind.takes(_plain(value)) for kind, value in zip(kinds, values, strict=False))


def _is_text(value: str) -> bool:
    try:
        return b"\0" not in value.encode()
    except UnicodeEncodeError:
        return False


def _is_number(kind: Any, value: Any) -> bool:
    """Test for a finite number of a kind, a whole one of 64 bits; Python takes `True` for a number."""
    if not isinstance(value, kind) or isinstance(value, bool):
        return False
    return bool(abs(value) <= (INT64_MAX if isinstance(value, Integral) else sys.float_info.max))


def _can_be_made(hint: type, value: Any) -> bool:
    try:
        hint(value)
    except (ValueError, OverflowError):
        return False
    return True


def _can_be_called(value: Any, arguments: Sequence[Any]) -> bool:
    """Test for a callable of so many arguments; some built-in ones do not declare them."""
    try:
        return callable(value) and signature(value).bind(*arguments) is not None
    except ValueError:
        return True
    except TypeError:
        return False


def _plain(value: Any) -> Any:
    """A number of NumPy or torch as Python's own; anything else as it is."""
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def _shown(value: object) -> str:
    """A value as Python shows it, in a few letters of one line."""
    text = " ".join(ascii(value).split())
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."
