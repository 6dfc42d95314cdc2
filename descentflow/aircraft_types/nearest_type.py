"""The type whose coefficients are nearest to a type that has none: same engines, nearest in take-off mass."""

from collections.abc import Mapping
from math import log
from pathlib import Path
from typing import NamedTuple

from descentflow.aircraft_types.aircraft import Aircraft, Engine
from descentflow.aircraft_types.bada3.bada_directory import load_directory
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.core.errors import AircraftError

LARGEST_RATIO = 1.5
"""A type that is heavier or lighter by more has another wing and other engines: no coefficients are near it."""


class TypeSize(NamedTuple):
    """Engines and maximum take-off mass of a type.

    Example:
        >>> SIZES["B788"].engine, SIZES["B788"].mass_maximum_kg
        ('jet', 227930.0)
    """

    engine: Engine
    n_engines: int
    mass_maximum_kg: float


_TWIN_JETS = {
    "A306": 171700, "A310": 164000, "A318": 68000, "A19N": 75500, "A332": 242000, "A333": 242000, "A338": 251000,
    "A339": 251000, "A359": 283000, "A35K": 319000, "B37M": 80290, "B38M": 82190, "B39M": 88310, "B712": 54880,
    "B733": 62820, "B734": 68040, "B735": 60550, "B736": 65540, "B752": 115680, "B753": 123830, "B762": 179170,
    "B763": 186880, "B764": 204120, "B773": 299370, "B77L": 347450, "B77W": 351530, "B788": 227930, "B789": 254010,
    "B78X": 254010, "BCS1": 63100, "BCS3": 70900, "CRJ2": 24040, "CRJ7": 34020, "CRJ9": 38330, "CRJX": 41640,
    "E135": 20000, "E145": 22000, "E195": 52290, "E290": 56400, "E295": 61500, "E75L": 38790, "E75S": 38790,
    "F100": 45810, "F70": 41730, "GL5T": 41960, "GLEX": 45130, "GLF5": 41280, "GLF6": 45180, "MD82": 67810,
    "MD83": 72570, "MD90": 70760, "SU95": 49450,
}  # fmt: skip
_FOUR_JETS = {
    "A343": 276500, "A346": 380000, "B461": 38100, "B462": 42180, "B463": 44230, "B744": 412770, "B748": 447700,
    "RJ85": 44000,
}  # fmt: skip
_THREE_JETS = {"F900": 22230, "FA7X": 31750, "MD11": 286000}
_TWIN_TURBOPROPS = {"AT43": 16900, "AT45": 18600, "AT72": 22800, "AT75": 22800, "DH8A": 15650, "DH8C": 19500}

_ENGINES: tuple[tuple[Engine, int, dict[str, int]], ...] = (
    ("jet", 2, _TWIN_JETS),
    ("jet", 3, _THREE_JETS),
    ("jet", 4, _FOUR_JETS),
    ("turboprop", 2, _TWIN_TURBOPROPS),
)

SIZES: Mapping[str, TypeSize] = {
    name: TypeSize(engine, number, float(mass)) for engine, number, masses in _ENGINES for name, mass in masses.items()
}
"""Types without open coefficients; masses in kg as manufacturers print them for a heavy variant, which differ by some
percent between variants and years: enough to choose a neighbour by, and for nothing else."""


def nearest_type(typecode: str, bada_dir: str | Path | None = None) -> Aircraft:
    """Coefficients of the nearest type that has any: same kind of engines, nearest in take-off mass.

    Nearest is the least absolute logarithm of the ratio of maximum take-off masses, at most that of
    :data:`LARGEST_RATIO`, among types with as many engines; where none of these is so near, among all of the kind.

    Args:
        typecode: ICAO type designator.
        bada_dir: BADA 3 directory to look in; None for the embedded open aircraft.

    Raises:
        AircraftError: If the type's size is not known, no type is near it, or the directory cannot be read.

    Example:
        >>> nearest_type("B788").typecode, nearest_type("B38M").typecode, nearest_type("A320").typecode
        ('B772', 'B739', 'A320')
    """
    at_hand = {name: open_aircraft(name) for name in open_typecodes()} if bada_dir is None else load_directory(bada_dir)
    if typecode in at_hand:
        return at_hand[typecode]
    size = _size(typecode)

    def away(one: Aircraft) -> float:
        return abs(log(float(one.mass_maximum_kg) / size.mass_maximum_kg))

    alike = [one for one in at_hand.values() if one.engine == size.engine]
    near = [one for one in alike if away(one) <= log(LARGEST_RATIO)]
    best = min([one for one in near if one.n_engines == size.n_engines] or near, key=away, default=None)
    if best is None:
        raise AircraftError(
            f"no coefficients near {typecode} ({size.n_engines} {size.engine} engines, {size.mass_maximum_kg:,.0f} kg)",
            expected=f"a {size.engine} within a factor of {LARGEST_RATIO} of its mass",
            mend="name the type whose coefficients stand for it (typecode)",
        )
    return best


def _size(typecode: str) -> TypeSize:
    if typecode in SIZES:
        return SIZES[typecode]
    if typecode in open_typecodes():
        known = open_aircraft(typecode)
        return TypeSize(known.engine, known.n_engines, float(known.mass_maximum_kg))
    raise AircraftError(
        f"the size of type {typecode!r} is not known",
        expected=f"one of {', '.join(sorted({*SIZES, *open_typecodes()}))}",
        mend="name the type whose coefficients stand for it (typecode)",
    )
