"""GPF, the global parameters file (BADA 3 user manual, section 6.8)."""

from collections.abc import Iterator
from pathlib import Path

from descentflow.aircraft_types.bada3.fixed_columns import Line, data_lines, read_lines
from descentflow.aircraft_types.standard_descent import GlobalParameters

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
