"""Numbers of a file of BADA 4 that no aircraft has, and those that its own printed table (PTD) contradicts."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.aircraft_types.bada4.bada4_aircraft import Bada4Aircraft
from descentflow.core.constants import G0_MPS2
from descentflow.core.errors import AircraftError
from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps

PARTS = {"jet": "PFM/TFM", "turboprop": "PFM/TPM", "piston": "PFM/PEM"}
"""Element of the engines' forces."""
CLEAN = "AFCM/Configuration[@HLid='0']/LGUP"
CEILINGS_FT = {"jet": (20_000, 65_000), "turboprop": (12_000, 45_000), "piston": (4_000, 35_000)}
LOADINGS = {"jet": (120, 1_200), "turboprop": (60, 800), "piston": (20, 400)}
"""Heaviest mass on a square metre of wing: 150 (a very light jet) to 830 (A346), 140 to 630 (A400M), 60 to 350."""
HEATING_J_KG = (40e6, 47e6)
"""Kerosene, avgas and synthetic fuels have 42.8 to 44.2 MJ/kg."""
OF_CEILING = (0.25, 0.5, 0.8)
OF_SPEED_LIMIT = 0.8
"""States at which forces and fuel are judged: these shares of the ceiling, and of V_MO (within M_MO and M_max)."""
PRINTED = ("level", "TAS", "CAS", "mass_kg", "thrust", "drag", "fuel")
_PLACES = (0, 5, 6, 8, 9, 10, 11)
_CONFIGURATION = 15
AGREED = 0.002
"""Relative room for the rounding of constants; EUROCONTROL's dummies need less than 0.0001 besides that of prints."""


class Judged(NamedTuple):
    """A figure, the element that it hangs on, and the range of aircraft that fly.

    Example:
        >>> Judged("ALM/GLM/hmo", "a ceiling in ft", 37_000, 20_000, 65_000).within
        True
    """

    path: str
    words: str
    value: Tensor | float
    low: float
    high: float

    @property
    def within(self) -> bool:
        """True if all values are finite and in the range."""
        value = torch.as_tensor(self.value)
        return bool(((value >= self.low) & (value <= self.high)).all())

    @property
    def worst(self) -> float:
        """The value that is farthest out."""
        value = torch.as_tensor(self.value, dtype=torch.float64).reshape(-1)
        beyond = torch.maximum(self.low - value, value - self.high).nan_to_num(torch.inf)
        return float(value[beyond.argmax()])


def judged(model: Bada4Aircraft) -> Iterator[Judged]:
    """Figures of a type in an order in which each rests on those before alone.

    Example:
        >>> from descentflow.aircraft_types.bada4.acm_file import read_acm
        >>> from descentflow.aircraft_types.standard_descent import STANDARD
        >>> all(one.within for one in judged(read_acm("A320-231.xml", STANDARD)))
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: A320-231.xml: ...
    """
    kind, heaviest = model.engine, float(model.mass_maximum_kg)
    part = PARTS[kind]
    yield Judged("ALM/GLM/hmo", "a ceiling in ft", float(model.altitude_maximum_ft), *CEILINGS_FT[kind])
    yield Judged("ALM/KLM/vmo", "V_MO in kt", float(model.vmo_kt), 60, 900)
    yield Judged("ALM/DLM/MTOW", "a heaviest mass in kg", heaviest, 300, 700_000)
    yield Judged("ALM/DLM/OEW", "of the heaviest mass empty", float(model.mass_minimum_kg) / heaviest, 0.2, 0.95)
    yield Judged("PFM/MREF", "of the heaviest mass as MREF", float(model.engines.reference_kg) / heaviest, 0.2, 2)
    yield Judged("AFCM/S", "kg of the heaviest mass on a m2", heaviest / float(model.wing.area_m2), *LOADINGS[kind])
    yield Judged("PFM/LHV", "J/kg", float(model.engines.heating_value_j_kg), *HEATING_J_KG)
    yield Judged(f"{CLEAN}/DPM_clean/M_max", "a Mach number", float(model.wing.mach_max), 0.1, 2)
    yield Judged("ALM/KLM", "M_MO", float(model.mmo), 0.1, 3)
    for name, speed in (("CAS1", model.des_cas_low_kt), ("CAS2", model.des_cas_high_kt)):
        yield Judged("ARPM/SpeedScheduleList", f"{name} of the descent in kt", float(speed), 40, 600)
    yield Judged("ARPM/SpeedScheduleList", "M of the descent", float(model.des_mach), 0.05, 2)
    yield Judged(CLEAN, "kt of minimum speed at sea level", model.minimum_cas_mps(0.0) / KT_MPS, 25, 250)
    altitude = torch.tensor(OF_CEILING, dtype=torch.float64) * float(model.altitude_maximum_ft) * FT_M
    fastest = torch.tensor(0.95 * min(float(model.mmo), float(model.wing.mach_max)), dtype=torch.float64)
    mach = torch.minimum(cas_to_mach(OF_SPEED_LIMIT * float(model.vmo_kt) * KT_MPS, altitude), fastest)
    tas, weight = mach_to_tas_mps(mach, altitude), float(model.mass_reference_kg) * G0_MPS2
    power = weight * tas / HEATING_J_KG[0]
    idle, climb = model.idle_thrust_n(altitude, tas), model.climb_thrust_n(altitude, tas)
    yield Judged(f"{CLEAN}/DPM_clean", "of the weight as clean drag", model.drag_n(tas, altitude) / weight, 0.02, 0.4)
    for configuration in ("AP", "LD"):
        slow = 1.3 * model.minimum_cas_mps(0.0, configuration=configuration)
        drag = model.drag_n(slow, 0.0, configuration=configuration) / weight
        yield Judged("AFCM", f"of the weight as drag in configuration {configuration}", drag, 0.02, 0.6)
    rating = part if kind == "piston" else f"{part}/LIDL"
    yield Judged(rating, "of the weight as idle thrust", idle / weight, -0.3, 0.2)
    yield Judged(part, "of the weight as climb thrust", climb / weight, 0.01, 1.5)
    flow = model.idle_fuel_flow_kg_s(altitude, tas) / power
    # A piston of BADA 4.2 idles with the throttle closed.
    yield Judged(rating, "of the power of flight as fuel at idle", flow, 0.0 if kind == "piston" else 0.003, 1.0)
    spent = climb * tas / (model.fuel_flow_kg_s(altitude, tas, climb) * HEATING_J_KG[0])
    yield Judged(part, "as efficiency of the engines in climb", spent, 0.04, 0.65)


class PrintedRows(NamedTuple):
    """Rows (n,) of one phase in the clean configuration: columns by name, and lines of the file.

    Example:
        >>> PrintedRows("CRUISE", {"level": torch.tensor([100.0])}, [7]).lines
        [7]
    """

    phase: str
    columns: dict[str, Tensor]
    lines: list[int]


def printed_rows(table: Path) -> list[PrintedRows]:
    """Clean rows of a printed table by phase (CLIMB, DESCENT, CRUISE), at all masses.

    Raises:
        AircraftError: If the file cannot be read.

    Example:
        >>> printed_rows(Path("A320-231_ISA.PTD"))
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: A320-231_ISA.PTD: ...
    """
    try:
        lines = table.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise AircraftError(
            f"{table}: {error}", expected="a printed table of BADA 4", mend="take the file as EUROCONTROL ships it"
        ) from error
    by_phase: dict[str, list[tuple[int, list[float]]]] = {"CLIMB": [], "DESCENT": [], "CRUISE": []}
    phase = ""
    for number, line in enumerate(lines, 1):
        words = line.split()
        title = re.search(r"mass (CLIMB|DESCENT|CRUISE)", line)
        phase = title[1] if title else phase
        if phase and len(words) > _CONFIGURATION and words[0].isdecimal() and words[_CONFIGURATION] == "CR":
            by_phase[phase].append((number, [float(words[place]) for place in _PLACES]))
    return [
        PrintedRows(
            name,
            dict(zip(PRINTED, torch.tensor([row for _, row in rows], dtype=torch.float64).T, strict=True)),
            [number for number, _ in rows],
        )
        for name, rows in by_phase.items()
        if rows
    ]


def contradicted(model: Bada4Aircraft, table: Path) -> str | None:
    """The first figure that differs from the printed one; None where all agree.

    Args:
        model: The type as it was read.
        table: Its printed table in standard air.

    Raises:
        AircraftError: If the table cannot be read.

    Example:
        >>> from descentflow.aircraft_types.bada4.acm_file import read_acm
        >>> from descentflow.aircraft_types.standard_descent import STANDARD
        >>> contradicted(read_acm("A320-231.xml", STANDARD), Path("A320-231_ISA.PTD"))
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: A320-231.xml: ...
    """
    for rows in printed_rows(table):
        printed = rows.columns
        level, mass, thrust = printed["level"], printed["mass_kg"], printed["thrust"]
        altitude, tas = level * FL_M, printed["TAS"] * KT_MPS
        ours = {"drag": model.drag_n(tas, altitude, 0.0, mass)}
        if rows.phase == "DESCENT":
            ours["thrust"] = model.idle_thrust_n(altitude, tas)
            ours["fuel"] = 60 * model.idle_fuel_flow_kg_s(altitude, tas)
        elif rows.phase == "CLIMB":
            ours["thrust"] = model.climb_thrust_n(altitude, tas)
        if rows.phase == "CRUISE" and model.engine != "piston":  # printed in steps of a piston's throttle
            ours["fuel"] = 60 * model.fuel_flow_kg_s(altitude, tas, thrust)
        for name, value in ours.items():
            scale = torch.maximum(printed[name].abs(), 0.05 * printed["drag"]) if name == "thrust" else printed[name]
            off = (value - printed[name]).abs() > AGREED * scale + (0.01 if name == "fuel" else 1.0)
            if off.any():
                row = int(off.nonzero()[0])
                return (
                    f"{name} of {float(value[row]):.5g} in {rows.phase.lower()} at FL{float(level[row]):.0f}, "
                    f"where {table.name}, line {rows.lines[row]}, has {float(printed[name][row]):.5g}"
                )
        if float(level.max()) * FL_M > (float(model.altitude_maximum_ft) + 1) * FT_M:
            return f"hmo = {float(model.altitude_maximum_ft):g} ft, and {table.name} has FL{float(level.max()):.0f}"
    return None
