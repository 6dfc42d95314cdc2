"""BADA 3 directories by their list of synonyms (manual, sections 6.3 and 6.8): a licensee's files in, aircraft out.

With them their GPF, the parameters that all types share.
"""

from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path

from descentflow.aircraft_types.bada3._fixed_columns import Line, data_lines, read_lines
from descentflow.aircraft_types.bada3.apf_file import DESCENT, Apf, read_apf
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.opf_file import Opf, read_opf
from descentflow.aircraft_types.standard_descent import STANDARD, GlobalParameters
from descentflow.core.errors import AircraftError, UnknownTypeError

_TURBINE = {"jet", "turbo", "tbp"}
_PISTON = {"piston", "pst"}


def _row(line: Line) -> tuple[str, set[str], set[str], set[str], float]:
    """A parameter's name, the flights, engines and phases that it holds for, and its value."""
    words = line.text[2:].rstrip("/ ").split()
    # The columns differ between releases, but no field of this file may hold a blank.
    if len(words) != 5:
        line.fail(f"{len(words)} fields", "name, flights, engines, phases and value")
    try:
        value = float(words[4])
    except ValueError:
        line.fail(f"value {words[4]!r}", "a number such as .13000E+01")
    flights, engines, phases = (set(word.lower().split(",")) for word in words[1:4])
    return words[0], flights, engines, phases, value


def read_gpf(path: str | Path) -> GlobalParameters:
    """Read what a descent needs of a GPF file, for civil flights.

    Args:
        path: File ``BADA.GPF``.

    Returns:
        The global parameters.

    Raises:
        AircraftError: If a line is malformed or a parameter is missing; the message names the file.

    Example:
        >>> needed = {"C_v_min": 1.3, "H_max_app": 8000, "H_max_ld": 3000, "C_des_exp": 1.6}
        >>> needed |= {f"V_des_{number}": 5 * number for number in range(1, 8)}
        >>> lines = [f"CD {name} civ jet,piston des,app,lnd {value} /" for name, value in needed.items()]
        >>> _ = Path("BADA.GPF").write_text(chr(10).join(lines))
        >>> read_gpf("BADA.GPF").min_speed_factor
        1.3
    """
    lines = data_lines(read_lines(Path(path)))
    rows = list(map(_row, lines))

    def find(name: str, phase: str, engines: set[str]) -> float:
        for known, flights, kinds, phases, value in rows:
            if known == name and "civ" in flights and phase in phases and kinds & engines:
                return value
        lines[0].fail(f"no parameter {name} for civil flights in phase {phase} in the file", f"a line for {name}")

    def increments(numbers: range, engines: set[str]) -> Iterator[float]:
        return (find(f"V_des_{number}", "des", engines) for number in numbers)

    one, two, three, four = increments(range(1, 5), _TURBINE)
    five, six, seven = increments(range(5, 8), _PISTON)
    return GlobalParameters(
        min_speed_factor=find("C_v_min", "des", _TURBINE),
        approach_ceiling_ft=find("H_max_app", "app", _TURBINE),
        landing_ceiling_ft=find("H_max_ld", "lnd", _TURBINE),
        expedited_drag_factor=find("C_des_exp", "des", _TURBINE),
        des_increment_kt=(one, two, three, four),
        des_increment_piston_kt=(five, six, seven),
    )


def to_aircraft(opf: Opf, apf: Apf, typecode: str | None = None, limits: GlobalParameters = STANDARD) -> Bada3Aircraft:
    """Join coefficients and procedures into one aircraft; speeds are the default company's at average mass.

    Args:
        opf: Coefficients.
        apf: Procedures.
        typecode: Name of the result; the OPF's own when None.
        limits: Global parameters.

    Returns:
        The aircraft.

    Raises:
        AircraftError: If the two files belong to different types.

    Example:
        >>> from descentflow.aircraft_types.bada3.apf_file import write_apf
        >>> from descentflow.aircraft_types.bada3.opf_file import write_opf
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(open_aircraft("A320"), "A320__.OPF")
        >>> write_apf(open_aircraft("A320"), "A320__.APF")
        >>> to_aircraft(read_opf("A320__.OPF"), read_apf("A320__.APF")).wing_area_m2
        122.4
    """
    if opf.typecode != apf.typecode:
        raise AircraftError(
            f"OPF of {opf.typecode} with APF of {apf.typecode}",
            expected="two files of one type",
            mend="pair the files that carry the same name",
        )
    known = Bada3Aircraft.__dataclass_fields__
    numbers = {name: value for name, value in opf.numbers.items() if name in known}
    speeds = {name: apf.speeds[name] for name in DESCENT}
    return Bada3Aircraft(
        typecode=typecode or opf.typecode,
        engine=opf.engine,
        n_engines=opf.n_engines,
        wake_category=opf.wake_category,
        source=opf.source,
        **numbers,
        **speeds,
        limits=limits,
    )


def load_aircraft(typecode: str, bada_dir: str | Path) -> Bada3Aircraft:
    """Load one type from a BADA 3 directory, resolved through SYNONYM.NEW.

    Global parameters are those of the directory's BADA.GPF, or the manual's where it has none.

    Args:
        typecode: ICAO type designator, in any case; without SYNONYM.NEW the name of the files themselves.
        bada_dir: Directory of OPF, APF and SYNONYM.NEW files.

    Returns:
        The aircraft, named by the type asked for.

    Raises:
        AircraftError: If the directory or a file is missing or malformed, or the type is not in it; the message lists
            near names.

    Example:
        >>> from descentflow.aircraft_types.bada3.apf_file import write_apf
        >>> from descentflow.aircraft_types.bada3.opf_file import write_opf
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(open_aircraft("A320"), "A320__.OPF")  # a licence holder has these files
        >>> write_apf(open_aircraft("A320"), "A320__.APF")
        >>> load_aircraft("A320", ".").wing_area_m2
        122.4
    """
    return _load(file_of(typecode, bada_dir), typecode.strip().upper(), _limits(Path(bada_dir)))


def file_of(typecode: str, bada_dir: str | Path) -> Path:
    """OPF file of a type, see :func:`load_aircraft`; its APF lies next to it.

    Raises:
        AircraftError: If the directory is missing, or the type is not in it.

    Example:
        >>> from descentflow.aircraft_types.bada3.opf_file import write_opf
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(open_aircraft("A320"), "A320__.OPF")
        >>> file_of("A320", ".").name
        'A320__.OPF'
    """
    folder = _folder(bada_dir)
    wanted = typecode.strip().upper()
    synonyms = _synonyms(folder)
    if wanted not in synonyms:
        near = ", ".join(get_close_matches(wanted, synonyms, n=8)) or "none"
        raise UnknownTypeError(
            f"type {typecode!r} in {folder}",
            expected=f"one of the {len(synonyms)} types there (near it: {near})",
            mend="choose a type the directory holds, or add a line to its SYNONYM.NEW",
        )
    return folder / f"{synonyms[wanted]}.OPF"


def load_directory(bada_dir: str | Path) -> dict[str, Bada3Aircraft]:
    """Load every type of a BADA 3 directory.

    Args:
        bada_dir: Directory of OPF, APF and SYNONYM.NEW files.

    Returns:
        Aircraft by type code.

    Raises:
        AircraftError: As :func:`load_aircraft`, for the first file that fails.

    Example:
        >>> from descentflow.aircraft_types.bada3.apf_file import write_apf
        >>> from descentflow.aircraft_types.bada3.opf_file import write_opf
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> write_opf(open_aircraft("A320"), "A320__.OPF")  # a licence holder has these files
        >>> write_apf(open_aircraft("A320"), "A320__.APF")
        >>> list(load_directory("."))
        ['A320']
    """
    folder = _folder(bada_dir)
    limits = _limits(folder)
    return {code: _load(folder / f"{file}.OPF", code, limits) for code, file in _synonyms(folder).items()}


def _folder(bada_dir: str | Path) -> Path:
    folder = Path(bada_dir)
    if not folder.is_dir():
        raise AircraftError(
            f"BADA directory {folder}",
            expected="an existing folder of BADA 3 (OPF, APF and SYNONYM.NEW files) or BADA 4 (GPF.xml)",
            mend="pass the folder of your release as --bada-dir (of fit: --data.bada_dir)",
        )
    return folder


def _synonyms(folder: Path) -> dict[str, str]:
    """Types and the names of their files: those of SYNONYM.NEW, or each OPF file for itself without that list."""
    listed = folder / "SYNONYM.NEW"
    if listed.is_file():
        return read_synonym(listed)
    names = [path.stem for path in sorted(folder.glob("*.OPF"))]
    if not names:
        raise AircraftError(
            f"{folder} holds neither SYNONYM.NEW nor OPF files, nor GPF.xml",
            expected="a release of BADA 3, or of BADA 4",
            mend="unpack the release there and keep the names of its files",
        )
    return {name.rstrip("_"): name for name in names}


def read_synonym(path: str | Path) -> dict[str, str]:
    """Read SYNONYM.NEW, the list of types and the files that stand for them, by its columns (manual, section 6.3).

    Args:
        path: File ``SYNONYM.NEW``.

    Returns:
        By type code the name of its OPF and APF files without the suffix, underscores kept.

    Raises:
        AircraftError: If a line is out of its columns or a type stands twice; the message names file and line.

    Example:
        >>> _ = Path("SYNONYM.NEW").write_text(f"CD * {'A20N':<6} {'AIRBUS':<19} {'A320 neo':<24} {'A320__':<6}  Y /")
        >>> read_synonym("SYNONYM.NEW")["A20N"]
        'A320__'
    """
    files: dict[str, str] = {}
    for line in data_lines(read_lines(Path(path))):
        mark, typecode, file, icao = line.cut(3, 4), line.cut(5, 11), line.cut(57, 63), line.cut(65, 66)
        gaps = line.text[4:5] + line.text[11:12] + line.text[56:57] + line.text[63:65]
        if mark not in ("-", "*") or not typecode or not file or icao not in ("Y", "N") or gaps.strip():
            line.fail(
                f"type {typecode!r} and file {file!r}",
                "CD, - or *, type, maker, model, file and Y or N in their columns",
            )
        if typecode in files:
            line.fail(f"type {typecode} a second time", "each type once")
        files[typecode] = file
    return files


def _limits(folder: Path) -> GlobalParameters:
    file = folder / "BADA.GPF"
    return read_gpf(file) if file.is_file() else STANDARD


def _load(opf: Path, typecode: str, limits: GlobalParameters) -> Bada3Aircraft:
    return to_aircraft(read_opf(opf), read_apf(opf.with_suffix(".APF")), typecode, limits)
