"""XML files of BADA 4 (versions 4.2 and 4.3): ACM of one aircraft model, and GPF of all."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn

from descentflow.aircraft_types.bada4._number_checks import contradicted, judged
from descentflow.aircraft_types.bada4.bada4_aircraft import ENGINES, Bada4Aircraft
from descentflow.aircraft_types.bada4.wing import Wing
from descentflow.aircraft_types.coefficient_group import CoefficientGroup
from descentflow.aircraft_types.standard_descent import GlobalParameters
from descentflow.core.errors import AircraftError
from descentflow.core.tabular import optional_library
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach

NAMESPACE = "bada40"
"""Ends the namespace of every file of BADA 4."""
MEDIUM_MASS = 0.7
"""Of the way from the empty to the heaviest mass: the medium mass of BADA 4's tables, a type's reference here."""
NOTE = "descentflow"
"""Target of the processing instructions that say who changed a file."""
WRITTEN_FOR = "take the file as EUROCONTROL ships it"
CLEAN = ("0", "UP")
"""High-lift position and gear of the clean wing."""


@dataclass(frozen=True)
class Element:
    """An element of a file, and how its errors name it."""

    file: Path
    node: Any
    path: str = ""

    def fail(self, got: str, expected: str, mend: str = WRITTEN_FOR) -> NoReturn:
        """Refuse the file at this element."""
        raise AircraftError(f"{self.file}, line {self.node.sourceline}: {got}", expected=expected, mend=mend)

    def every(self, path: str) -> list["Element"]:
        """All elements at a path below."""
        return [Element(self.file, node, f"{self.path}{path}") for node in self.node.findall(path)]

    def one(self, path: str) -> "Element":
        """The only element at a path below."""
        elements = self.every(path)
        if len(elements) != 1:
            self.fail(f"{len(elements)} elements {self.path}{path}", "one of it")
        return Element(self.file, elements[0].node, f"{self.path}{path}/")

    def text(self, path: str) -> str:
        """Text of the only element at a path."""
        return (self.one(path).node.text or "").strip()

    def number(self) -> float:
        """The number that the element holds."""
        text = (self.node.text or "").strip()
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            self.fail(f"{self.path.rstrip('/')} = {text[:60]!r}", "a finite number")
        return value

    def numbers(self, path: str, n: int) -> tuple[float, ...]:
        """The n numbers at a path."""
        elements = self.every(path)
        if len(elements) != n:
            self.fail(f"{len(elements)} elements {self.path}{path}", f"{n} of them")
        return tuple(element.number() for element in elements)

    def single(self, path: str, absent: float | None = None) -> float:
        """The number at a path; a value where it may be absent."""
        return absent if absent is not None and not self.every(path) else self.numbers(path, 1)[0]

    def above_zero(self, path: str) -> float:
        """The number above zero at a path."""
        value = self.single(path)
        return value if value > 0 else self.every(path)[0].fail(f"{self.path}{path} = {value:g}", "a number above zero")


def read_xml(file: Path, what: str, remove_comments: bool = True) -> Element:
    """The root of an XML file; no document type, no entity and no address in it is followed."""
    etree = optional_library("lxml.etree", "bada4")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=remove_comments)
    try:
        with file.open("rb") as opened:
            tree = etree.parse(opened, parser)
    except (OSError, etree.XMLSyntaxError) as error:
        raise AircraftError(f"{file}: {error}", expected=what, mend=WRITTEN_FOR) from error
    root = Element(file, tree.getroot())
    if tree.docinfo.doctype:
        root.fail("a document type", "a file without one, as those of BADA 4 are")
    return root


def read_root(file: Path, tag: str) -> Element:
    """The root of a file of BADA 4, checked by the schema that ships next to or above it where there is one.

    Args:
        file: File.
        tag: Name of the root, ``ACM`` or ``GPF``.

    Raises:
        AircraftError: If the file is missing, no XML, of another kind, or not as its schema wants it; the message names
            file and line.
    """
    root = read_xml(file, f"an XML file ({tag}) of BADA 4")
    etree = optional_library("lxml.etree", "bada4")
    name = etree.QName(root.node)
    if name.localname != tag or not str(name.namespace or "").endswith(NAMESPACE):
        root.fail(f"a root {name.text}", f"{tag} of the namespace {NAMESPACE}", "pass the folder of BADA 4.2 or 4.3")
    schema = next((schema for schema in _schemas(file, tag) if schema.is_file()), None)
    if schema is not None:
        _validate(etree, root, schema)
    return root


def _schemas(file: Path, tag: str) -> Iterator[Path]:
    return (folder / f"{tag}_BADA4.xsd" for folder in (file.parent, file.parent.parent))


def _validate(etree: Any, root: Element, schema: Path) -> None:
    try:
        rules = etree.XMLSchema(read_xml(schema, "the schema of BADA 4").node.getroottree())
    except etree.XMLSchemaParseError as error:
        raise AircraftError(f"{schema}: {error}", expected="the schema of BADA 4", mend=WRITTEN_FOR) from error
    if not rules.validate(root.node.getroottree()):
        first = rules.error_log[0]
        raise AircraftError(
            f"{root.file}, line {first.line}: {first.message}", expected=f"what {schema.name} wants", mend=WRITTEN_FOR
        )


def read_acm(file: str | Path, limits: GlobalParameters, typecode: str | None = None) -> Bada4Aircraft:
    """Read one aircraft model.

    Args:
        file: File such as ``A320-231/A320-231.xml``.
        limits: Global parameters.
        typecode: Name of the result; the file's designator when None.

    Returns:
        The aircraft; its reference mass is the medium mass of BADA 4's tables.

    Raises:
        AircraftError: If the file is damaged, of another version or lacks a part, has numbers that no aircraft has, or
            others than the printed table next to it (``NAME_ISA.PTD``); the message names file, line and element.

    Example:
        >>> read_acm("no_such.xml", GlobalParameters())
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: no_such.xml: ...
    """
    root = read_root(Path(file), "ACM")
    engine = root.text("type").lower()
    if engine not in ENGINES:
        root.one("type").fail(f"type {engine.upper()!r}", f"one of {', '.join(ENGINES).upper()}")
    version, exponents = _fuel_version(root)
    n_engines = root.above_zero("PFM/n_eng")
    if n_engines % 1:
        root.one("PFM/n_eng").fail(f"{n_engines:g} engines", "a whole number")
    own = _placed(Bada4Aircraft, root)
    empty, heaviest = own["mass_minimum_kg"], own["mass_maximum_kg"]
    if not empty < heaviest:
        root.one("ALM/DLM").fail(f"an empty mass of {empty:g} kg", f"one below the heaviest of {heaviest:g} kg")
    fastest = float(cas_to_mach(own["vmo_kt"] * KT_MPS, own["altitude_maximum_ft"] * FT_M))
    speeds = {name: _speeds(root, phase) for name, phase in (("climb_speeds", "Climb"), ("cruise_speeds", "Cruise"))}
    descent = _speeds(root, "Descent") or root.one("ARPM").fail("no speeds of the descent", "a phase Descent")
    values = {
        **own,
        **speeds,
        "typecode": typecode or root.text("ICAO/designator"),
        "engine": engine,
        "wake_category": root.text("ICAO/WTC"),
        "source": "; ".join([*_notes(root), f"BADA {version} file {root.text('model')}"]),
        "engines": ENGINES[engine].of(
            _placed(ENGINES[engine], root) | {"version": version, "exponents": exponents, "n_engines": int(n_engines)}
        ),
        "wing": _wing(root),
        "mass_reference_kg": empty + MEDIUM_MASS * (heaviest - empty),
        "mass_payload_kg": root.single("ALM/DLM/MPL", 0.0),
        "mmo": root.single("ALM/KLM/mmo", fastest),
        "des_cas_low_kt": descent[0],
        "des_cas_high_kt": descent[1],
        "des_mach": descent[2],
        "limits": limits,
    }
    aircraft = Bada4Aircraft.of(values)
    _check_numbers(root, aircraft)
    return aircraft


def _check_numbers(root: Element, aircraft: Bada4Aircraft) -> None:
    """Refuse what no aircraft has, and what the printed table contradicts."""
    for figure in judged(aircraft):
        if not figure.within:
            node = (root.every(figure.path) or [root])[0]
            node.fail(f"{figure.path}: {figure.worst:.4g} {figure.words}", f"{figure.low:,g} to {figure.high:,g}")
    table = root.file.with_name(f"{root.file.stem}_ISA.PTD")
    if table.is_file() and (difference := contradicted(aircraft, table)):
        mend = "take both files as EUROCONTROL ships them, or move a file of your own away from the table"
        raise AircraftError(f"{root.file}: {difference}", expected="the numbers that its table was made of", mend=mend)


def _notes(root: Element) -> list[str]:
    """Notes above the root of who changed the file, the last change first."""
    before = root.node.itersiblings(preceding=True)
    return [str(node.text) for node in before if getattr(node, "target", "") == NOTE]


def _fuel_version(root: Element) -> tuple[str, tuple[float, float]]:
    """Version and exponents of pressure and temperature in the fuel flow, which files have from 4.3 on."""
    given = [root.every(f"PFM/{name}") for name in ("p_delta", "p_theta")]
    if not any(given):
        return "4.2", (1.0, 0.5)
    return "4.3", (root.single("PFM/p_delta"), root.single("PFM/p_theta"))


def _placed(part: type[CoefficientGroup], root: Element) -> dict[str, Any]:
    """Fields of a part that have places in the file."""
    numbers: dict[str, Any] = {}
    optional = {field.name for field in fields(part) if field.default == ()}
    for name, places in part.PLACES.items():
        if name in optional and not any(root.every(path) for path, _ in places):
            continue
        if len(places) == 1 and places[0][1] == 1:
            numbers[name] = (root.above_zero if name in part.POSITIVE else root.single)(places[0][0])
        else:
            numbers[name] = sum((root.numbers(path, n) for path, n in places), ())
    return numbers


def _wing(root: Element) -> Wing:
    """The clean wing, and the positions of flaps and gear for approach and landing."""
    clean = root.one("AFCM/Configuration[@HLid='0']")
    curve = clean.every("LGUP/BLM_clean")
    lift = (
        sum(
            (curve[0].numbers(path, n) for path, n in (("Mmin", 1), ("Mmax", 1), ("CL_Mach0", 1), ("CL_clean/bf", 5))),
            (),
        )
        if curve
        else (clean.above_zero("LGUP/BLM/CL_max"),)
    )
    scale = clean.above_zero("LGUP/DPM_clean/scalar")
    values = _placed(Wing, root)
    values["drag"] = tuple(scale * value for value in values["drag"])
    flaps = {field: _flaps(root, phase) for field, phase in (("approach", "AP"), ("landing", "LD"))}
    return Wing.of({**values, **flaps, "clean_lift": lift})


def _flaps(root: Element, phase: str) -> tuple[float, ...]:
    """Drag coefficients and greatest lift of a phase; none where its wing is clean."""
    schedule = root.one("ARPM/AeroConfSchedule")
    steps = [one for one in schedule.every("AeroPhase") if one.text("name") == phase]
    if len(steps) != 1:
        schedule.fail(f"{len(steps)} phases {phase}", "one of them")
    position, gear = (steps[0].text(name) for name in ("HLid", "LG"))
    if (position, gear) == CLEAN:
        return ()
    if gear not in ("UP", "DN") or not position.isdecimal():
        steps[0].fail(f"high-lift position {position[:20]!r} with gear {gear[:20]!r}", "a number, and UP or DN")
    wing = root.one(f"AFCM/Configuration[@HLid='{position}']/LG{gear}")
    return (*wing.numbers("DPM_nonclean/CD_nonclean/d", 3), wing.above_zero("BLM/CL_max"))


def _speeds(root: Element, phase: str) -> tuple[float, ...]:
    """CAS below and above 10,000 ft and Mach number of a phase, by the first schedule; none where it is absent."""
    schedules = root.one("ARPM/SpeedScheduleList").every("SpeedSchedule")
    for flown in schedules[0].every("SpeedPhase") if schedules else ():
        if flown.text("name") == phase:
            return tuple(flown.above_zero(name) for name in ("CAS1", "CAS2", "M"))
    return ()


SPEEDS = {"des_cas_low_kt": "CAS1", "des_cas_high_kt": "CAS2", "des_mach": "M"}
"""Speed of the descent -> its element."""


def changed_acm(
    file: Path, speeds: dict[str, float], note: str, parasitic: float, induced: float, idle: float
) -> bytes:
    """The file with factors in the numbers of clean drag and idle thrust, and speeds; all else as it stands.

    Args:
        file: Of :func:`read_acm`, which has checked it.
        speeds: Of the first schedule, by the name of the coefficient.
        note: Who changed it, for a processing instruction above the root; none is written if empty.
        parasitic: Factor of the drag without lift, five numbers ``d``.
        induced: Factor of the drag by lift, the other ten.
        idle: Factor of the idle thrust, the numbers ``ti``.

    Raises:
        AircraftError: If the file cannot be read.

    Example:
        >>> changed_acm(Path("A320-231.xml"), {"des_mach": 0.78}, "repaired", 1.05, 1.0, 0.9)
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: A320-231.xml: ...
    """
    tree = read_xml(file, "an XML file (ACM) of BADA 4", remove_comments=False).node.getroottree()
    idles = tree.findall("PFM/*/LIDL/CT/ti")
    (path, n), *_ = Wing.PLACES["drag"]
    _scale(tree.findall(path), [parasitic] * 5 + [induced] * (n - 5))
    _scale(idles, [idle] * len(idles))
    phases = tree.find("ARPM/SpeedScheduleList/SpeedSchedule").findall("SpeedPhase")
    descent = next(phase for phase in phases if (phase.findtext("name") or "").strip() == "Descent")
    for name, value in speeds.items():
        descent.find(SPEEDS[name]).text = f"{value:g}"
    etree = optional_library("lxml.etree", "bada4")
    if note:
        tree.getroot().addprevious(etree.ProcessingInstruction(NOTE, note))
    return bytes(etree.tostring(tree, xml_declaration=True, encoding="utf-8"))


def _scale(nodes: Sequence[Any], factors: Sequence[float]) -> None:
    for node, factor in zip(nodes, factors, strict=True):
        if factor != 1:
            node.text = repr(float(node.text) * factor)


def read_gpf(file: str | Path) -> GlobalParameters:
    """Read what a descent needs of the global parameters.

    Args:
        file: File ``GPF.xml``.

    Raises:
        AircraftError: If the file is damaged or lacks a parameter; the message names file and line.

    Example:
        >>> read_gpf("no_such.xml")
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: no_such.xml: ...
    """
    root = read_root(Path(file), "GPF")
    ceilings = {phase.text("Phase"): phase for phase in root.every("HmaxList/HmaxPhase")}
    steps = {(phase.text("Phase/name"), phase.text("Phase/index")): phase for phase in root.every("VdList/VdPhase")}

    def value(known: Mapping[Any, Element], key: Any, name: str) -> float:
        return known[key].single(name) if key in known else root.fail(f"no {name} of {key}", "one of it")

    one, two, three, four, *piston = (value(steps, ("DES", str(n)), "Vd") for n in range(1, 8))
    return GlobalParameters(
        min_speed_factor=root.above_zero("CVmin"),
        approach_ceiling_ft=value(ceilings, "AP", "Hmax"),
        landing_ceiling_ft=value(ceilings, "LD", "Hmax"),
        des_increment_kt=(one, two, three, four),
        des_increment_piston_kt=(piston[0], piston[1], piston[2]),
    )
