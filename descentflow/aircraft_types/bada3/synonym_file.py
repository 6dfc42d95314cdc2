"""SYNONYM.NEW, the list of types and the files that stand for them (BADA 3 user manual, section 6.3)."""

from pathlib import Path

from descentflow.aircraft_types.bada3.fixed_columns import data_lines, read_lines


def read_synonym(path: str | Path) -> dict[str, str]:
    """Read SYNONYM.NEW by its fixed columns.

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
    found: dict[str, str] = {}
    for line in data_lines(read_lines(Path(path))):
        mark, typecode, file, icao = line.cut(3, 4), line.cut(5, 11), line.cut(57, 63), line.cut(65, 66)
        gaps = line.text[4:5] + line.text[11:12] + line.text[56:57] + line.text[63:65]
        if mark not in ("-", "*") or not typecode or not file or icao not in ("Y", "N") or gaps.strip():
            line.fail(
                f"type {typecode!r} and file {file!r}",
                "CD, - or *, type, maker, model, file and Y or N in their columns",
            )
        if typecode in found:
            line.fail(f"type {typecode} a second time", "each type once")
        found[typecode] = file
    return found
