"""OPF, the operations performance file: the coefficients of one type (BADA 3 user manual, section 6.4)."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.fixed_columns import Line, data_lines, e10, header, read_lines
from descentflow.aircraft_types.standard_descent import Engine
from descentflow.core.errors import AircraftError
from descentflow.core.files import whole_file

PHASES = ("CR", "IC", "TO", "AP", "LD")
ENGINES: dict[str, Engine] = {"JET": "jet", "TURBOPROP": "turboprop", "PISTON": "piston"}
TONNES = ("mass_reference_kg", "mass_minimum_kg", "mass_maximum_kg", "mass_payload_kg")
"""Masses are in tonnes in the file."""

Place = tuple[str | None, ...]
"""Names of the numbers in a line; None for a blank field."""
_BEFORE_POLARS: tuple[Place, ...] = (
    (*TONNES, "altitude_mass_gradient_ft_kg"),
    ("vmo_kt", "mmo", "altitude_maximum_ft", "altitude_mtow_ft", "altitude_temperature_gradient_ft_k"),
    ("wing_area_m2", "buffet_clbo", "buffet_k", "cm16"),
)
_AFTER_POLARS: tuple[Place, ...] = (
    (),
    (None, None, None, "cd2_spoiler", "unused_spoiler"),
    (),
    (None, None, "cd0_gear", "cd2_gear", "unused_gear"),
    (),
    (None, None, None, "cd2_brakes", "unused_brakes"),
    ("ct1", "ct2", "ct3", "ct4", "ct5"),
    ("ct_des_low", "ct_des_high", "altitude_des_ft", "ct_des_app", "ct_des_ld"),
    ("reference_des_cas_kt", "reference_des_mach", "unused_des_1", "unused_des_2", "unused_des_3"),
    ("cf1", "cf2"),
    ("cf3", "cf4"),
    ("cf_cr", "unused_cf_1", "unused_cf_2", "unused_cf_3", "unused_cf_4"),
    ("takeoff_length_m", "landing_length_m", "span_m", "length_m", "unused_ground"),
)


def _polar_place(phase: str) -> Place:
    low = phase.lower()
    return (None, f"vstall_{low}_kt", f"cd0_{low}", f"cd2_{low}", f"unused_{low}")


PLACES: tuple[Place, ...] = (*_BEFORE_POLARS, *map(_polar_place, PHASES), *_AFTER_POLARS)
"""The numbers of the file's 21 data lines after the first, in order."""
PLACED_NAMES = tuple(name for place in PLACES for name in place if name)


@dataclass(frozen=True)
class Opf:
    """The content of an OPF file, in the units of :class:`~descentflow.aircraft_types.bada3.coefficients.Coefficients`.

    ``numbers`` is keyed by the names of the coefficients, and by names of their own for what a descent does not use
    (ground dimensions, the unused fields), so that writing a file back gives the same file.
    """

    typecode: str
    n_engines: int
    engine: Engine
    wake_category: str
    numbers: dict[str, float]
    description: str = ""
    created: str = ""
    modified: str = ""
    configurations: tuple[str, ...] = field(default=("Clean", "", "", "", ""))
    """Names of the flap settings in the order CR, IC, TO, AP, LD; they may hold blanks."""


def read_opf(path: str | Path) -> Opf:
    """Read an OPF file by its fixed columns.

    Args:
        path: File such as ``A320__.OPF``.

    Returns:
        The file's content, masses in kg.

    Raises:
        AircraftError: If a line is missing, out of its columns or not a number; the message names file and line.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(opf_of(open_aircraft("A320")), "A320__.OPF")
        >>> read_opf("A320__.OPF").numbers["wing_area_m2"]
        122.4
    """
    lines = read_lines(Path(path))
    data = data_lines(lines)
    if len(data) != len(PLACES) + 1:
        data[-1].fail(f"{len(data)} data lines up to here", f"{len(PLACES) + 1} lines that start with CD")
    kind, rows = data[0], data[1:]
    engine = ENGINES.get(kind.cut(33, 42).upper()) or kind.fail(f"engine {kind.cut(33, 42)!r}", ", ".join(ENGINES))
    return Opf(
        typecode=_typecode(kind),
        n_engines=kind.integer(20, 21, "number of engines"),
        engine=engine,
        wake_category=kind.cut(59, 60) or kind.fail("no wake category", "L, M, H or J in column 60"),
        numbers=dict(_numbers(rows)),
        description=_description(lines, kind),
        created=header(lines, "Creation_date"),
        modified=header(lines, "Modification_date"),
        configurations=_configurations(rows),
    )


def _typecode(kind: Line) -> str:
    return kind.cut(5, 11).rstrip("_") or kind.fail("no type code", "a type code in columns 6 to 11")


def _description(lines: list[Line], kind: Line) -> str:
    """Free text under the type line (model and engines)."""
    return lines[kind.number].cut(2, 58) if kind.number < len(lines) else ""


def _configurations(rows: list[Line]) -> tuple[str, ...]:
    names = []
    for index, phase in enumerate(PHASES):
        line = rows[len(_BEFORE_POLARS) + index]
        if line.cut(5, 7) != phase:
            line.fail(f"phase {line.cut(5, 7)!r}", f"phase {phase} in columns 6 and 7")
        names.append(line.cut(10, 20))
    return tuple(names)


def _numbers(rows: list[Line]) -> Iterator[tuple[str, float]]:
    for line, place in zip(rows, PLACES, strict=True):
        for index, name in enumerate(place):
            if name:
                value = line.real(index, name)
                yield name, value * 1000 if name in TONNES else value


def opf_of(aircraft: Bada3Aircraft) -> Opf:
    """Put an aircraft's coefficients in OPF form; what an Aircraft does not hold (ground, unused fields) is zero.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> opf_of(open_aircraft("A320")).engine
        'jet'
    """
    state = aircraft.to_state()
    return Opf(
        typecode=aircraft.typecode,
        n_engines=aircraft.n_engines,
        engine=aircraft.engine,
        wake_category=aircraft.wake_category,
        numbers={name: float(state.get(name, 0.0)) for name in PLACED_NAMES},
        description=aircraft.source[:54],
    )


def write_opf(opf: Opf, path: str | Path) -> None:
    """Write an OPF file, whole or not at all.

    The format holds five digits (four of a negative number): a file that was read comes back byte for byte,
    coefficients from elsewhere are rounded.

    Args:
        opf: Content, see :func:`opf_of` for an aircraft.
        path: File to write, by BADA's convention the type code filled up to six characters with underscores.

    Raises:
        AircraftError: If the type code or a text does not fit its columns, or a number is not finite.
        DataError: If the folder does not exist.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(opf_of(open_aircraft("A320")), "A320__.OPF")
        >>> Path("A320__.OPF").read_text().splitlines()[-1].rstrip("/ ")
        'FI'
    """
    text = "".join(f"{line:<70}/\n" for line in _lines(opf))
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="latin-1", newline="\n")


def _lines(opf: Opf) -> Iterator[str]:
    rows = [_row(opf.numbers, place) for place in PLACES]
    polars = len(_BEFORE_POLARS)
    for index, (phase, name) in enumerate(zip(PHASES, opf.configurations, strict=True)):
        rows[polars + index] = f"CD {index + 1} {phase}   {_fit(name, 9):<10}" + rows[polars + index][20:]
    rows[polars - 1] = f"CD {len(PHASES)}" + rows[polars - 1][4:]
    for offset, label in enumerate(("1      RET", "2      EXT", "1      UP", "2      DOWN", "1      OFF", "2      ON")):
        at = polars + len(PHASES) + offset
        rows[at] = f"CD {label}" + rows[at][3 + len(label) :]
    name = f"{_fit(opf.typecode, 6):_<6}"
    engine = {kind: text for text, kind in ENGINES.items()}[opf.engine].capitalize()
    yield f"{'C' * 30} {name}.OPF {'C' * 28}"
    yield from ("CC", "CC               AIRCRAFT PERFORMANCE OPERATIONAL FILE", "CC", "CC")
    yield f"CC      File_name: {name}.OPF"
    yield from ("CC", f"CC      Creation_date: {opf.created}", "CC", f"CC      Modification_date: {opf.modified}")
    yield from ("CC", "CC", _title("Actype"))
    yield f"CD   {name}{'':9}{opf.n_engines:1d} engines    {engine:<9}{'':17}{_fit(opf.wake_category, 1)}"
    yield f"CC  {_fit(opf.description, 54):<54}wake"
    yield "CC"
    for comments, count in _SECTIONS:
        yield from comments
        for _ in range(count):
            yield rows.pop(0)
    yield f"CC{'=' * 68}"
    yield "FI"


def _row(numbers: dict[str, float], place: Place) -> str:
    scaled = (numbers[n] / 1000 if n in TONNES else numbers[n] for n in place if n)
    return "CD  " + "".join(f"   {e10(next(scaled)) if name else '':10}" for name in place)


def _fit(text: str, width: int) -> str:
    if len(text) > width or "\n" in text:
        raise AircraftError(
            f"text {text!r}", expected=f"at most {width} characters on one line", mend="shorten it before writing"
        )
    return text


def _title(text: str) -> str:
    return f"CC====== {text} ".ljust(70, "=")


_CONFIGURATION_TITLES = (
    "CC   Configuration characteristics",
    "CC n Phase  Name    Vstall(KCAS)    CD0          CD2        unused",
)
_SECTIONS: tuple[tuple[tuple[str, ...], int], ...] = (
    ((_title("Mass (t)"), "CC    reference      minimum      maximum     max payload  mass grad"), 1),
    ((_title("Flight envelope"), "CC     VMO(KCAS)       MMO        Max.Alt       Hmax       temp grad"), 1),
    (
        (
            _title("Aerodynamics"),
            "CC Wing Area and Buffet coefficients (SIM)",
            "CCndrst Surf(m2)     Clbo(M=0)       k          CM16",
        ),
        1,
    ),
    (_CONFIGURATION_TITLES, 5),
    (("CC   Spoiler",), 2),
    (("CC   Gear",), 2),
    (("CC   Brakes",), 2),
    ((_title("Engine Thrust"), "CC         Max climb thrust coefficients (SIM)"), 1),
    (("CC     Desc(low)    Desc(high)   Desc level   Desc(app)     Desc(ld)",), 1),
    (("CC     Desc CAS     Desc Mach     unused       unused       unused",), 1),
    ((_title("Fuel Consumption"), "CC   Thrust Specific Fuel Consumption Coefficients"), 1),
    (("CC   Descent Fuel Flow Coefficients",), 1),
    (("CC   Cruise Corr.    unused       unused       unused       unused",), 1),
    ((_title("Ground"), "CC        TOL          LDL        span         length       unused"), 1),
)
"""Comment lines of the file, each followed by its number of data lines."""
