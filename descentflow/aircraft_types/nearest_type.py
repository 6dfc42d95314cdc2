"""The type whose coefficients are nearest to a type that has none: same engines, nearest in take-off mass."""

import csv
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from math import log
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.aircraft_types.registry import every_aircraft
from descentflow.aircraft_types.standard_descent import EngineKind
from descentflow.core.errors import AircraftError

if TYPE_CHECKING:
    from descentflow.aircraft_types.registry import AnyAircraft

SIZES = "sizes.csv"
"""Besides the open aircraft: types without coefficients."""
LARGEST_RATIO = 1.5
"""A type that is heavier or lighter by more has another wing and other engines: no coefficients are near it."""


class TypeSize(NamedTuple):
    """Engines and maximum take-off mass of a type.

    Example:
        >>> TypeSize("jet", 2, 228000.0).n_engines
        2
    """

    engine: EngineKind
    n_engines: int
    mass_maximum_kg: float


@cache
def type_sizes() -> Mapping[str, TypeSize]:
    """Types without open coefficients whose size is known: engines and MTOW of OpenAP 2.6.2's aircraft files.

    The masses choose a neighbour and are used for nothing else.

    Example:
        >>> type_sizes()["B788"]
        TypeSize(engine='jet', n_engines=2, mass_maximum_kg=228000.0)
    """
    text = files("descentflow.aircraft_types.open_types").joinpath(SIZES).read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return {
        row["typecode"]: TypeSize(
            cast("EngineKind", row["engine"]), int(row["n_engines"]), float(row["mass_maximum_kg"])
        )
        for row in rows
    }


def nearest_type(typecode: str, bada_dir: str | Path | None = None) -> "AnyAircraft":
    """Coefficients of the nearest type that has any: same kind of engines, nearest in take-off mass.

    Nearest is the least absolute logarithm of the ratio of maximum take-off masses, at most that of
    :data:`LARGEST_RATIO`, among types with as many engines; where none of these is so near, among all of the kind.

    Args:
        typecode: ICAO type designator.
        bada_dir: Folder of BADA 3 or 4 to look in; None for the embedded open aircraft.

    Raises:
        AircraftError: If the type's size is not known, no type is near it, or the directory cannot be read.

    Example:
        >>> nearest_type("B788").typecode, nearest_type("B38M").typecode, nearest_type("A320").typecode
        ('B772', 'B738', 'A320')
    """
    at_hand = every_aircraft(bada_dir)
    if typecode in at_hand:
        return at_hand[typecode]
    size = _size(typecode)

    def away(one: "AnyAircraft") -> float:
        return abs(log(float(one.mass_maximum_kg) / size.mass_maximum_kg))

    alike = [known for known in at_hand.values() if known.engine == size.engine]
    near = [known for known in alike if away(known) <= log(LARGEST_RATIO)]
    best = min([known for known in near if known.n_engines == size.n_engines] or near, key=away, default=None)
    if best is None:
        raise AircraftError(
            f"no coefficients near {typecode} ({size.n_engines} {size.engine} engines, {size.mass_maximum_kg:,.0f} kg)",
            expected=f"a {size.engine} within a factor of {LARGEST_RATIO} of its mass",
            mend="name the type whose coefficients stand for it (typecode)",
        )
    return best


def _size(typecode: str) -> TypeSize:
    if typecode in type_sizes():
        return type_sizes()[typecode]
    if typecode in open_typecodes():
        known = open_aircraft(typecode)
        return TypeSize(known.engine, known.n_engines, float(known.mass_maximum_kg))
    raise AircraftError(
        f"the size of type {typecode!r} is not known",
        expected=f"one of {', '.join(sorted({*type_sizes(), *open_typecodes()}))}",
        mend="name the type whose coefficients stand for it (typecode)",
    )
