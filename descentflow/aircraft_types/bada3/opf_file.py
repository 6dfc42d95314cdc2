"""OPF, the operations performance file: the coefficients of one type (BADA 3 user manual, section 6.4)."""

from dataclasses import dataclass
from pathlib import Path

from descentflow.aircraft_types.bada3._fixed_columns import Line, data_lines, header, read_lines, write_lines
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.standard_descent import EngineKind

PHASES = ("CR", "IC", "TO", "AP", "LD")
ENGINES: dict[str, EngineKind] = {"JET": "jet", "TURBOPROP": "turboprop", "PISTON": "piston"}
TYPECODE, N_ENGINES, ENGINE, WAKE = (5, 11), (20, 21), (33, 42), (59, 60)
"""Columns of the first data line."""
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
REPAIRED, OPEN = MARKS = ("repaired", "not BADA")
"""Next to the date of modification, where there is room in the layout: what is not as EUROCONTROL ships it."""
SIGNS = dict(zip(MARKS, ("repaired by", "not BADA"), strict=True))
"""Mark -> words of a source that ask for it."""
EMPTY = Path(__file__).with_name("empty_opf.txt")
"""A file of zeros, of no type."""


@dataclass(frozen=True)
class Opf:
    """The content of an OPF file, in the units of :class:`~descentflow.aircraft_types.bada3.coefficients.Coefficients`.

    ``numbers`` is keyed by the names of the coefficients, and by names of their own for what a descent does not use
    (ground dimensions, the unused fields).
    """

    typecode: str
    n_engines: int
    engine: EngineKind
    wake_category: str
    numbers: dict[str, float]
    modified: str = ""

    @property
    def source(self) -> str:
        """The files by their date, with what descentflow has noted next to it."""
        day, *marks = self.modified.split(", ")
        day, marks = ("", [day, *marks]) if day in MARKS else (day, marks)
        family = "open coefficients, not BADA, in files" if OPEN in marks else "BADA 3 files"
        by = ", repaired by descentflow" if REPAIRED in marks else ""
        return f"{family} {self.typecode} of {day or 'unknown date'}{by}"


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
        >>> write_opf(open_aircraft("A320"), "A320__.OPF")
        >>> read_opf("A320__.OPF").numbers["wing_area_m2"]
        122.4
    """
    lines = read_lines(Path(path))
    kind, *rows = _data(lines)
    engine = ENGINES.get(kind.cut(*ENGINE).upper()) or kind.fail(f"engine {kind.cut(*ENGINE)!r}", ", ".join(ENGINES))
    return Opf(
        typecode=kind.cut(*TYPECODE).rstrip("_") or kind.fail("no type code", "a type code in columns 6 to 11"),
        n_engines=kind.integer(*N_ENGINES, "number of engines"),
        engine=engine,
        wake_category=kind.cut(*WAKE) or kind.fail("no wake category", "L, M, H or J in column 60"),
        numbers={name: _number(line, at, name) for line, place in _placed(rows) for at, name in place},
        modified=header(lines, "Modification_date"),
    )


def _data(lines: list[Line]) -> list[Line]:
    data = data_lines(lines)
    if len(data) != len(PLACES) + 1:
        data[-1].fail(f"{len(data)} data lines up to here", f"{len(PLACES) + 1} lines that start with CD")
    for line, phase in zip(data[1 + len(_BEFORE_POLARS) :], PHASES, strict=False):
        if line.cut(5, 7) != phase:
            line.fail(f"phase {line.cut(5, 7)!r}", f"phase {phase} in columns 6 and 7")
    return data


def _placed(rows: list[Line]) -> list[tuple[Line, list[tuple[int, str]]]]:
    """Lines with the fields of their numbers."""
    named = ([(at, name) for at, name in enumerate(place) if name] for place in PLACES)
    return list(zip(rows, named, strict=True))


def _number(line: Line, at: int, name: str) -> float:
    return line.real(at, name) * (1000 if name in TONNES else 1)


def write_opf(aircraft: Bada3Aircraft, path: str | Path, own: Path | None = None, day: str = "") -> None:
    """Write an aircraft's coefficients to an OPF file, whole or not at all.

    The format holds five digits (four of a negative number): other coefficients are rounded.

    Args:
        aircraft: Coefficients.
        path: File to write, by BADA's convention the type code filled up to six characters with underscores.
        own: A file in which what differs is changed, and nothing else; without it, what an aircraft does not hold
            (ground, unused fields) is zero.
        day: Date of modification; that of the file if empty.

    Raises:
        AircraftError: If the type code does not fit its columns, or a number is not finite.
        DataError: If the folder does not exist.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(open_aircraft("A320"), "A320__.OPF")
        >>> Path("A320__.OPF").read_text().splitlines()[-1].rstrip("/ ")
        'FI'
    """
    lines, state = read_lines(own or EMPTY), aircraft.to_state()
    kind, *rows = _data(lines)
    name, engine = f"{aircraft.typecode:_<6}", {kind: text for text, kind in ENGINES.items()}[aircraft.engine]
    texts = {TYPECODE: name, N_ENGINES: str(aircraft.n_engines), ENGINE: engine.capitalize()}
    changed = kind
    for columns, text in {**texts, WAKE: aircraft.wake_category}.items():
        if changed.cut(*columns).upper() != text.upper():
            changed = changed.put(*columns, text)
    lines[kind.number - 1] = changed
    for line, place in _placed(rows):
        for at, number in place:
            if number in state and float(state[number]) != _number(line, at, number):
                value = float(state[number]) / (1000 if number in TONNES else 1)
                lines[line.number - 1] = lines[line.number - 1].put_real(at, value)
    noted = [*([day] if day else []), *(mark for mark, sign in SIGNS.items() if sign in aircraft.source)]
    dates = {"Modification_date": ", ".join(noted)} if noted else {}
    if own is None:
        lines[kind.number] = lines[kind.number].put(4, 58, aircraft.source[:54])
        dates["Creation_date"] = day
    write_lines(lines, Path(path), (kind.cut(*TYPECODE), name), dates)
