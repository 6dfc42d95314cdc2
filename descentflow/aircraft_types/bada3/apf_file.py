"""APF, the airlines procedures file: standard speeds of one type (BADA 3 user manual, section 6.5)."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.fixed_columns import Line, data_lines, header, read_lines
from descentflow.core.errors import AircraftError
from descentflow.core.files import whole_file

DEFAULT_COMPANY = "***"
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
_RULER = "===:=======:=======::==::===:===:==:====:==::===:===:==::==:===:===:====:==::===:===:===::======:"


@dataclass(frozen=True)
class Speeds:
    """One line of procedures: CAS in whole knots, Mach in whole hundredths (0.78); 0 where a phase has none.

    Example:
        >>> Speeds(des_mach=0.78).climb_mach
        0.0
    """

    climb_cas_low_kt: float = 0.0
    climb_cas_high_kt: float = 0.0
    climb_mach: float = 0.0
    cruise_cas_low_kt: float = 0.0
    cruise_cas_high_kt: float = 0.0
    cruise_mach: float = 0.0
    des_mach: float = 0.0
    des_cas_high_kt: float = 0.0
    """V_des,2: above 10,000 ft."""
    des_cas_low_kt: float = 0.0
    """V_des,1: below 10,000 ft."""
    approach_1: float = 0.0
    approach_2: float = 0.0
    approach_3: float = 0.0


@dataclass(frozen=True)
class Company:
    """The procedures of one company, for low, average and high masses."""

    code: str
    letters: str
    name: str
    version: str
    low: Speeds
    average: Speeds
    high: Speeds


@dataclass(frozen=True)
class Apf:
    """The content of an APF file."""

    typecode: str
    companies: tuple[Company, ...]
    masses: str = ""
    """The comment that gives the mass ranges."""
    created: str = ""
    modified: str = ""

    @property
    def default(self) -> Company:
        """The procedures that hold where no company is known (company ``***``)."""
        return next(c for c in self.companies if c.code == DEFAULT_COMPANY)


def read_apf(path: str | Path) -> Apf:
    """Read an APF file by its fixed columns.

    Args:
        path: File such as ``A320__.APF``.

    Returns:
        The file's procedures; :attr:`Apf.default` ``.average`` is what BADA's tables use.

    Raises:
        AircraftError: If a line is missing, out of its columns or not a number, or the file has no default company; the
            message names file and line.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_apf(apf_of(open_aircraft("A320")), "A320__.APF")
        >>> read_apf("A320__.APF").default.average.des_mach
        0.77
    """
    lines = read_lines(Path(path))
    data = data_lines(lines)
    if len(data) % 4:
        data[-1].fail(f"{len(data)} data lines up to here", "four lines that start with CD for each company")
    companies = tuple(_company(data[at : at + 4]) for at in range(0, len(data), 4))
    if DEFAULT_COMPANY not in {company.code for company in companies}:
        data[0].fail("no default company", f"a company {DEFAULT_COMPANY}")
    return Apf(
        typecode=data[1].cut(92, 98).rstrip("_") or data[1].fail("no type code", "a type code in columns 93 to 98"),
        companies=companies,
        masses=next((x.text.rstrip("/ ")[2:].strip() for x in lines if x.text.startswith("CC   LO=")), ""),
        created=header(lines, "Creation_date"),
        modified=header(lines, "Modification_date"),
    )


def _company(block: list[Line]) -> Company:
    title, *rows = block
    for row, mass in zip(rows, ("LO", "AV", "HI"), strict=True):
        if row.cut(23, 25) != mass:
            row.fail(f"mass range {row.cut(23, 25)!r}", f"{mass} in columns 24 and 25")
    low, average, high = map(_speeds, rows)
    code, letters, name = title.cut(4, 7), title.cut(8, 10), title.cut(14, 40)
    return Company(code, letters, name, rows[0].cut(6, 22), low, average, high)


def _speeds(row: Line) -> Speeds:
    edges = {row.text[place - 1 : place] for columns in _PLACES.values() for place in (columns[0], columns[1] + 1)}
    if edges - {" "}:
        row.fail("text between the columns", "speeds in their columns with a blank on either side")
    return Speeds(**{name: row.integer(*columns, name) / _per_unit(name) for name, columns in _PLACES.items()})


def _per_unit(name: str) -> int:
    return 100 if name.endswith("mach") else 1


def apf_of(aircraft: Bada3Aircraft) -> Apf:
    """Put an aircraft's descent speeds in APF form; climb and cruise, which an Aircraft does not hold, are zero.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> apf_of(open_aircraft("A320")).default.name
        'Default Company'
    """
    state = aircraft.to_state()
    names = ("des_mach", "des_cas_high_kt", "des_cas_low_kt")
    speeds = Speeds(**{name: float(state[name]) for name in names})
    company = Company(DEFAULT_COMPANY, "**", "Default Company", "", speeds, speeds, speeds)
    return Apf(aircraft.typecode, (company,))


def write_apf(apf: Apf, path: str | Path) -> None:
    """Write an APF file, whole or not at all; one that was read comes back byte for byte.

    Args:
        apf: Content, see :func:`apf_of` for an aircraft.
        path: File to write, by BADA's convention the type code filled up to six characters with underscores.

    Raises:
        AircraftError: If a CAS is not a whole number of knots, or a Mach number of hundredths, that fits its columns:
            the format would round the speed in silence.
        DataError: If the folder does not exist.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> speeds = apf_of(open_aircraft("A320"))
        >>> write_apf(speeds, "A320__.APF")
        >>> read_apf("A320__.APF") == speeds
        True
    """
    text = "\n".join(_lines(apf))
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="latin-1", newline="\n")


def _lines(apf: Apf) -> Iterator[str]:
    name = f"{apf.typecode:_<6}"
    yield f"{'C' * 44} {name}.APF {'C' * 43}/"
    body = ["CC", "CC                 AIRLINES PROCEDURES FILE", "CC", f"CC      File_name: {name}.APF", "CC"]
    body += [f"CC      Creation_date: {apf.created}", "CC", f"CC      Modification_date: {apf.modified}"]
    body += ["CC", "CC", "CC", f"CC   {apf.masses}", "CC", f"CC{'=' * 97}", *_TITLES, f"CC{_RULER}"]
    for company in apf.companies:
        body.append(f"CD  {company.code:<3} {company.letters:<2}    {company.name}")
        ranges = {"LO": company.low, "AV": company.average, "HI": company.high}
        body += [_row(name, company.version, mass, speeds) for mass, speeds in ranges.items()]
    yield from (f"{line:<99}/" for line in [*body, f"CC{_RULER}"])
    yield f"CC{'/' * 45}THE END{'/' * 45}"


_TITLES = (
    "CC  COM CO    Company name ------climb-------  --cruise--  -----descent------  --approach-  model-",
    "CC                    mass  lo  hi              lo  hi         hi  lo            (unused)",
    "CC    version engines  ma  cas cas mc xxxx xx  cas cas mc  mc cas cas xxxx xx  xxx xxx xxx  opf___",
)


def _row(name: str, version: str, mass: str, speeds: Speeds) -> str:
    row = f"CD    {version:<17}{mass:<69}{name}"
    for item in fields(speeds):
        first, last = _PLACES[item.name]
        value = getattr(speeds, item.name) * _per_unit(item.name)
        text = f"{round(value):>{last - first}}"
        if abs(value - round(value)) > 1e-9 or len(text) > last - first or value < 0:
            raise AircraftError(
                f"{name} {mass}: {item.name} {getattr(speeds, item.name)!r}",
                expected=f"a multiple of {1 / _per_unit(item.name)} that fits {last - first} digits",
                mend="round the speed on purpose before writing it to an APF file",
            )
        row = row[:first] + text + row[last:]
    return row
