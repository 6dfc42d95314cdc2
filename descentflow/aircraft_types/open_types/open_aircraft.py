"""Open aircraft in BADA 3 form: coefficients from open sources, none of them EUROCONTROL's.

One readable file per type in ``coefficients/``; every coefficient carries its source and a confidence. A type is read
on demand, so that importing this module costs nothing.
"""

import tomllib
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, Literal

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.core.errors import UnknownTypeError

Confidence = Literal["direct", "derived", "textbook estimate", "unchecked", "fitted"]
"""Printed by the source; follows from printed numbers by the stated formula; typical of the class of aircraft; commonly
published but not checked against a type-certificate data sheet; estimated from real flights, with an interval."""

_FOLDER = "coefficients"
_SOURCES = "sources"


@dataclass(frozen=True)
class CoefficientSource:
    """Source of one number of an open aircraft.

    Example:
        >>> area = next(s for s in open_type("A320").coefficients if s.name == "wing_area_m2")
        >>> area.value, area.unit
        (122.4, 'm2')
    """

    name: str
    """Field of :class:`Bada3Aircraft`, or the name of a fact or a published range."""
    value: float | str | tuple[float, ...]
    """The number; a published range reads (middle, lowest, highest)."""
    unit: str
    source: str
    confidence: Confidence
    interval: tuple[float, float] | None = None
    """90 % interval of a number that was fitted."""


@dataclass(frozen=True)
class OpenType:
    """The content of a type's data file.

    Example:
        >>> open_type("A320").typecode, len(open_type("A320").coefficients)
        ('A320', 50)
    """

    typecode: str
    summary: str
    judged_by: str
    """Real flights by which it was fitted or looked at, or that there are none."""
    known_to_be_off: str
    """Numbers that a user must not trust, and by how much, as far as it is known."""
    relation: str | None
    """The type that this one is made from, or None."""
    relation_stated: str
    """Differences from that type; empty when it is its own."""
    coefficients: tuple[CoefficientSource, ...]
    facts: tuple[CoefficientSource, ...]
    """Printed numbers from which coefficients were derived."""
    published: tuple[CoefficientSource, ...]
    """Published kinematic ranges (Mach, CAS, rates), for comparison only; empty where there are none."""


def open_aircraft(typecode: str) -> Bada3Aircraft:
    """Coefficients of an open aircraft.

    Args:
        typecode: ICAO type designator, as in :func:`open_typecodes`, in any case.

    Returns:
        The aircraft. Not EUROCONTROL's BADA: rates of types that no flight judges are uncertain by 10 to 30 %.

    Raises:
        AircraftError: If the type is not among the open ones.

    Example:
        >>> open_aircraft("A320").wing_area_m2
        122.4
    """
    read = open_type(typecode)
    values: dict[str, Any] = {c.name: c.value for c in read.coefficients}
    source = f"descentflow open aircraft, not BADA: {read.summary}; {read.judged_by}"
    return Bada3Aircraft(typecode=read.typecode, source=source, **values)


def open_typecodes() -> tuple[str, ...]:
    """Type designators of all open aircraft, sorted.

    Example:
        >>> "B738" in open_typecodes()
        True
    """
    names = (f.name.removesuffix(".toml") for f in _folder().iterdir() if f.name.endswith(".toml"))
    return tuple(sorted(n for n in names if n != _SOURCES))


def open_type(typecode: str) -> OpenType:
    """All that is known of an open aircraft: coefficients, facts, published ranges and what is known to be off.

    Args:
        typecode: ICAO type designator, in any case.

    Returns:
        The type; what a relation leaves open is taken from the type that it names.

    Raises:
        AircraftError: If the type is not among the open ones.

    Example:
        >>> open_type("a20n").relation
        'A320'
    """
    wanted = typecode.strip().upper()
    if wanted not in open_typecodes():
        near = " or ".join(get_close_matches(wanted, open_typecodes()))
        raise UnknownTypeError(
            f"no open aircraft {typecode!r}",
            expected=f"one of {', '.join(open_typecodes())}",
            mend=f"{f'did you mean {near}? Else ' if near else ''}choose one of these, or point --bada-dir (of fit: "
            "--data.bada_dir) at BADA files that have the type",
        )
    return _whole_type(wanted)


@cache
def _whole_type(typecode: str) -> OpenType:
    content = _read(typecode)
    base = open_type(content["relation"]) if "relation" in content else None
    return OpenType(
        typecode=typecode,
        summary=content["summary"],
        judged_by=content["judged_by"],
        known_to_be_off=content["known_to_be_off"].strip(),
        relation=content.get("relation"),
        relation_stated=content.get("relation_stated", ""),
        coefficients=_merged(content, "coefficients", base.coefficients if base else ()),
        facts=_merged(content, "facts", base.facts if base else ()),
        published=_merged(content, "published", base.published if base else ()),
    )


def _merged(content: dict[str, Any], table: str, base: tuple[CoefficientSource, ...]) -> tuple[CoefficientSource, ...]:
    """Entries of a table laid over those of the related type, which keep their order."""
    entries = {e.name: e for e in base}
    entries.update((name, _entry(name, raw)) for name, raw in content.get(table, {}).items())
    return tuple(entries.values())


def _entry(name: str, raw: dict[str, Any]) -> CoefficientSource:
    """One inline table of a type file, with its source written out."""
    value = raw["value"]
    if isinstance(value, list):
        value = tuple(float(v) for v in value)
    elif not isinstance(value, str) and name != "n_engines":
        value = float(value)
    ends = (float(raw["interval"][0]), float(raw["interval"][1])) if "interval" in raw else None
    return CoefficientSource(name, value, raw["unit"], _source_text(raw["source"]), raw["confidence"], ends)


def _source_text(key_and_detail: str) -> str:
    key, colon, detail = key_and_detail.partition(":")
    texts = _read(_SOURCES)["sources"]
    return f"{texts[key]}; {detail.strip()}" if colon else str(texts[key])


def _folder() -> Traversable:
    return files("descentflow.aircraft_types.open_types").joinpath(_FOLDER)


@cache
def _read(name: str) -> dict[str, Any]:
    return tomllib.loads(_folder().joinpath(f"{name}.toml").read_text(encoding="utf-8"))
