"""Reads `gap.json` back as the typed findings that wrote it."""

import json
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from descentflow.core.arguments import kind_of
from descentflow.core.errors import DataError
from descentflow.diagnosis.findings.findings import Findings

SCHEMA_VERSION = 7
"""Of `gap.json`; files of other versions are refused."""


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


def _built(hint: Any, content: Any, place: str) -> Any:
    """A value of a type from plain values, each checked against its type."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        (hint,) = (kind_inside for kind_inside in inside if kind_inside is not NoneType)
        return None if content is None else _built(hint, content, place)
    if is_dataclass(hint):
        return _built_dataclass(cast("type[Any]", hint), content, place)
    if origin is list:
        _must(isinstance(content, list), content, "a list", place)
        return [_built(inside[0], one, f"{place}[{i}]") for i, one in enumerate(content)]
    if origin is dict:
        _must(isinstance(content, dict), content, "an object", place)
        return {key: _built(inside[1], one, f"{place}.{key}") for key, one in content.items()}
    kind = kind_of(hint)
    _must(kind.takes(content), content, kind.words, place)
    # JSON knows no difference between 1 and 1.0.
    return content if origin is Literal else hint(content)


def _built_dataclass(kind: type[Any], content: Any, place: str) -> Any:
    _must(isinstance(content, Mapping), content, "an object", place)
    hints, given = get_type_hints(kind), {}
    left = dict(content)
    for field in fields(kind):
        key = field.metadata.get("json", field.name)
        if key in left:
            given[field.name] = _built(hints[field.name], left.pop(key), f"{place}: {key}")
        else:
            optional = field.default is not MISSING or field.default_factory is not MISSING
            _must(optional, "nothing", "a value", f"{place}: {key}")
    _must(not left, f"unknown fields {', '.join(left)}", f"those of schema version {SCHEMA_VERSION}", place)
    return kind(**given)


def _must(right: bool, got: Any, expected: str, place: str) -> None:
    if not right:
        shown = got if isinstance(got, str) else type(got).__name__
        raise DataError(f"{place}: {shown}", expected=expected, mend="write the file again with `descentflow diagnose`")
