"""APF, the airlines procedures file: standard speeds of one type (BADA 3 user manual, section 6.5)."""

from dataclasses import dataclass
from pathlib import Path

from descentflow.aircraft_types.bada3._fixed_columns import Line, data_lines, read_lines, write_lines
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.core.errors import AircraftError

DEFAULT_COMPANY = "***"
"""Procedures that hold where no company is known."""
MASSES = ("LO", "AV", "HI")
EMPTY = Path(__file__).with_name("empty_apf.txt")
"""A file of the default company without speeds, of no type."""
_TYPECODE = (92, 98)
_PLACES = {
    "climb_cas_low_kt": (27, 30),
    "climb_cas_high_kt": (31, 34),
    "climb_mach": (35, 37),
    "cruise_cas_low_kt": (47, 50),
    "cruise_cas_high_kt": (51, 54),
    "cruise_mach": (55, 57),
    "des_mach": (59, 61),
    "des_cas_high_kt": (62, 65),
    "des_cas_low_kt": (66, 69),
    "approach_1": (79, 82),
    "approach_2": (83, 86),
    "approach_3": (87, 90),
}
"""Columns of the numbers; those of the descent are in the order Mach, high, low; the approach is unused."""
DESCENT = ("des_mach", "des_cas_high_kt", "des_cas_low_kt")


@dataclass(frozen=True)
class Apf:
    """The content of an APF file that BADA's tables use.

    ``speeds`` are those of the default company at average mass: CAS in whole knots, Mach numbers in whole hundredths
    (0.78), 0 where a phase has none.
    """

    typecode: str
    speeds: dict[str, float]


def read_apf(path: str | Path) -> Apf:
    """Read an APF file by its fixed columns.

    Args:
        path: File such as ``A320__.APF``.

    Raises:
        AircraftError: If a line is missing, out of its columns or not a number, or the file has no default company; the
            message names file and line.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_apf(open_aircraft("A320"), "A320__.APF")
        >>> read_apf("A320__.APF").speeds["des_mach"]
        0.77
    """
    rows, (_, average, _) = _rows(read_lines(Path(path)))
    speeds = {row.number: _speeds(row) for row in rows}
    typecode = rows[0].cut(*_TYPECODE).rstrip("_") or rows[0].fail("no type code", "a type code in columns 93 to 98")
    return Apf(typecode, speeds[average.number])


def _rows(lines: list[Line]) -> tuple[list[Line], list[Line]]:
    """Rows of speeds, of all companies and of the default one: three each, for low, average and high masses."""
    data = data_lines(lines)
    if len(data) % 4:
        data[-1].fail(f"{len(data)} data lines up to here", "four lines that start with CD for each company")
    companies = [data[at : at + 4] for at in range(0, len(data), 4)]
    default = next((rows for title, *rows in companies if title.cut(4, 7) == DEFAULT_COMPANY), None)
    rows = [row for _, *some in companies for row in some]
    for row, mass in zip(rows, MASSES * len(companies), strict=True):
        if row.cut(23, 25) != mass:
            row.fail(f"mass range {row.cut(23, 25)!r}", f"{mass} in columns 24 and 25")
    return rows, default or data[0].fail("no default company", f"a company {DEFAULT_COMPANY}")


def _speeds(row: Line) -> dict[str, float]:
    edges = {row.text[place - 1 : place] for columns in _PLACES.values() for place in (columns[0], columns[1] + 1)}
    if edges - {" "}:
        row.fail("text between the columns", "speeds in their columns with a blank on either side")
    return {name: row.integer(*columns, name) / _per_unit(name) for name, columns in _PLACES.items()}


def _per_unit(name: str) -> int:
    return 100 if name.endswith("mach") else 1


def write_apf(aircraft: Bada3Aircraft, path: str | Path, own: Path | None = None, day: str = "") -> None:
    """Write an aircraft's descent speeds to an APF file, whole or not at all.

    Args:
        aircraft: Its speeds become those of the default company, for all masses.
        path: File to write, by BADA's convention the type code filled up to six characters with underscores.
        own: A file in which these are changed, and nothing else; without it, climb and cruise are zero.
        day: Date of modification; that of the file if empty.

    Raises:
        AircraftError: If a CAS is not a whole number of knots, or a Mach number of hundredths, that fits its columns:
            the format would round the speed in silence.
        DataError: If the folder does not exist.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_apf(open_aircraft("A320"), "A320__.APF")
        >>> "77 280 250" in Path("A320__.APF").read_text()
        True
    """
    lines, name = read_lines(own or EMPTY), f"{aircraft.typecode:_<6}"
    rows, default = _rows(lines)
    speeds = {row: float(aircraft.to_state()[row]) for row in DESCENT}
    for row in rows:
        changed = row.put(*_TYPECODE, name)
        for place in DESCENT if row in default else ():
            changed = changed.put(*_PLACES[place], _text(speeds[place], place))
        lines[row.number - 1] = changed
    dates = dict.fromkeys(("Creation_date", "Modification_date") if own is None else ("Modification_date",), day)
    write_lines(lines, Path(path), (rows[0].cut(*_TYPECODE), name), dates if day else {})


def _text(value: float, name: str) -> str:
    first, last = _PLACES[name]
    number = value * _per_unit(name)
    text = f"{round(number):>{last - first}}"
    if abs(number - round(number)) > 1e-9 or len(text) > last - first or value < 0:
        raise AircraftError(
            f"{name} {value!r}",
            expected=f"a multiple of {1 / _per_unit(name)} that fits {last - first} digits",
            mend="round the speed on purpose before writing it to an APF file",
        )
    return text
