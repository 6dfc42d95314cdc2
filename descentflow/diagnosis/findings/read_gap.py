"""Reads `gap.json` back as the typed findings that wrote it."""

import json
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from descentflow.core.errors import DataError
from descentflow.diagnosis.findings.findings import Findings

SCHEMA_VERSION = 6
"""Of `gap.json`; files of other versions are refused."""
NUMBERS = (int, float)


def read_gap(path: str | Path) -> Findings:
    """The findings in a `gap.json`.

    Fields that have a default may be absent; fields that this version does not know are refused, for they could hold
    what it would leave unsaid.

    Raises:
        DataError: If there is no such file, it is no `gap.json`, or it is of another schema version.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> from descentflow.effects import EFFECTS
        >>> report = diagnose("descents.parquet", "A320", catalogue={"mass": EFFECTS["mass"]}, out="nominal")
        >>> read_gap("nominal/gap.json").causes == report.causes
        True
    """
    source = Path(path)
    whole = "a gap.json that `descentflow diagnose` wrote"
    try:
        content = json.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        mend = f"name {source / 'gap.json'}" if source.is_dir() else "name the file"
        raise DataError(f"{source}: {error.strerror}", expected=whole, mend=mend) from error
    except ValueError as error:
        raise DataError(f"{source}: {error}", expected=whole, mend="write it again") from error
    if not isinstance(content, dict) or "schema_version" not in content:
        raise DataError(f"{source}: no schema_version", expected=whole, mend="name the file")
    version = content.pop("schema_version")
    if version != SCHEMA_VERSION:
        raise DataError(
            f"{source}: schema version {version}",
            expected=f"version {SCHEMA_VERSION}",
            mend="diagnose the same flights again with this version of descentflow",
        )
    return cast("Findings", _built(Findings, content, str(source)))


def _built(kind: Any, content: Any, place: str) -> Any:
    """A value of a type from plain values, each checked against its type."""
    if is_dataclass(kind):
        return _built_dataclass(cast("type[Any]", kind), content, place)
    origin = get_origin(kind)
    if origin in (Union, UnionType):
        if content is None and NoneType in get_args(kind):
            return None
        (kind,) = (k for k in get_args(kind) if k is not NoneType)
        return _built(kind, content, place)
    if origin is Literal:
        _must(content in get_args(kind), content, f"one of {', '.join(map(repr, get_args(kind)))}", place)
        return content
    if origin is list:
        _must(isinstance(content, list), content, "a list", place)
        (inner,) = get_args(kind)
        return [_built(inner, one, f"{place}[{i}]") for i, one in enumerate(content)]
    if origin is dict:
        _must(isinstance(content, dict), content, "an object", place)
        inner = get_args(kind)[1]
        return {key: _built(inner, one, f"{place}.{key}") for key, one in content.items()}
    return _plain(kind, content, place)


def _plain(kind: Any, content: Any, place: str) -> Any:
    # JSON knows no difference between 1 and 1.0; a bool is no number here.
    able = NUMBERS if kind is float else (kind,)
    _must(isinstance(content, able) and (kind is bool or not isinstance(content, bool)), content, kind.__name__, place)
    return kind(content)


def _built_dataclass(kind: type[Any], content: Any, place: str) -> Any:
    _must(isinstance(content, Mapping), content, "an object", place)
    hints, given = get_type_hints(kind), {}
    left = dict(content)
    for one in fields(kind):
        key = one.metadata.get("json", one.name)
        if key in left:
            given[one.name] = _built(hints[one.name], left.pop(key), f"{place}: {key}")
        else:
            optional = one.default is not MISSING or one.default_factory is not MISSING
            _must(optional, "nothing", "a value", f"{place}: {key}")
    _must(not left, f"unknown fields {', '.join(left)}", f"those of schema version {SCHEMA_VERSION}", place)
    return kind(**given)


def _must(right: bool, got: Any, expected: str, place: str) -> None:
    if not right:
        shown = got if isinstance(got, str) else type(got).__name__
        raise DataError(f"{place}: {shown}", expected=expected, mend="write the file again with `descentflow diagnose`")
