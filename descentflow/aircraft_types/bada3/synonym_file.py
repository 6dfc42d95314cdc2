"""SYNONYM.NEW, the list of types and the files that stand for them (BADA 3 user manual, section 6.3)."""

from dataclasses import dataclass
from pathlib import Path

from descentflow.aircraft_types.bada3.fixed_columns import Line, data_lines, read_lines


@dataclass(frozen=True)
class Synonym:
    """One type: ``file`` is the name of its OPF and APF files without the suffix, underscores kept.

    Example:
        >>> Synonym("A20N", "AIRBUS", "A320 neo", "A320__", is_icao=True, direct=False).file
        'A320__'
    """

    typecode: str
    manufacturer: str
    model: str
    file: str
    is_icao: bool
    """True if the type code is ICAO's own designator."""
    direct: bool
    """True if the file was made for this very type (``-``) and not for an equivalent one (``*``)."""


def read_synonym(path: str | Path) -> dict[str, Synonym]:
    """Read SYNONYM.NEW by its fixed columns.

    Args:
        path: File ``SYNONYM.NEW``.

    Returns:
        The types by type code.

    Raises:
        AircraftError: If a line is out of its columns or a type stands twice; the message names file and line.

    Example:
        >>> _ = Path("SYNONYM.NEW").write_text(f"CD * {'A20N':<6} {'AIRBUS':<19} {'A320 neo':<24} {'A320__':<6}  Y /")
        >>> read_synonym("SYNONYM.NEW")["A20N"].file
        'A320__'
    """
    found: dict[str, Synonym] = {}
    for line in data_lines(read_lines(Path(path))):
        synonym = _synonym(line)
        if synonym.typecode in found:
            line.fail(f"type {synonym.typecode} a second time", "each type once")
        found[synonym.typecode] = synonym
    return found


def _synonym(line: Line) -> Synonym:
    mark, typecode, file, icao = line.cut(3, 4), line.cut(5, 11), line.cut(57, 63), line.cut(65, 66)
    gaps = line.text[4:5] + line.text[11:12] + line.text[56:57] + line.text[63:65]
    if mark not in ("-", "*") or not typecode or not file or icao not in ("Y", "N") or gaps.strip():
        line.fail(
            f"type {typecode!r} and file {file!r}", "CD, - or *, type, maker, model, file and Y or N in their columns"
        )
    return Synonym(typecode, line.cut(12, 32), line.cut(32, 56), file, icao == "Y", mark == "-")
