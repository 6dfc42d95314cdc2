"""Copies of JSBSim's aircraft files, made fit for flights of many: nothing read, nothing written, factors added.

Taken out: ``<input>`` (a network port), ``<output>`` (files), ``<system>`` and ``<autopilot>`` (JSBSim's own guidance;
the autopilot is ours). Added: a point mass at the centre of gravity, and properties that multiply the model's own
drag functions and its table of idle thrust; all are 1 unless an effect changes them.
"""

import shutil
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError
from descentflow.core.tabular import optional_library
from studies.jsbsim_world.airframes import Airframe

CD0_FACTOR, CDI_FACTOR, WAVE_FACTOR, IDLE_FACTOR = (
    f"injected/{name}" for name in ("cd0-factor", "cdi-factor", "wave-factor", "idle-factor")
)
FACTORS = (CD0_FACTOR, CDI_FACTOR, WAVE_FACTOR, IDLE_FACTOR)
"""Properties that the copies know and the originals do not."""
_DRAG = {
    "aero/coefficient/CD0": CD0_FACTOR,
    "aero/force/Drag_basic": CD0_FACTOR,
    "aero/coefficient/CDi": CDI_FACTOR,
    "aero/force/Drag_induced": CDI_FACTOR,
    "aero/coefficient/CDmach": WAVE_FACTOR,
    "aero/force/Drag_mach": WAVE_FACTOR,
}
_STRIPPED = ("input", "output", "system", "autopilot")
LOAD = "Load"
"""Name of the point mass that is added."""


def jsbsim() -> Any:
    """Import JSBSim.

    Raises:
        ConfigError: If it is not installed.

    Example:
        >>> callable(jsbsim().FGFDMExec)
        True
    """
    return optional_library("jsbsim")


def copy_model(airframe: Airframe, folder: Path) -> int:
    """Write the changed copy of a model and its engines.

    Args:
        airframe: The model.
        folder: An existing folder; gets ``aircraft``, ``engine`` and ``systems``.

    Returns:
        Index of the added point mass.

    Raises:
        ConfigError: If JSBSim is not installed.

    Example:
        >>> from studies.jsbsim_world.airframes import airframe_of
        >>> copy_model(airframe_of("MD11"), Path("."))
        0
        >>> Path("aircraft/MD11/MD11.xml").is_file()
        True
    """
    source = Path(jsbsim().__file__).parent
    tree = ET.parse(source / "aircraft" / airframe.name / f"{airframe.name}.xml")
    root = tree.getroot()
    _strip(root)
    load = _add_load(root)
    for function in root.iter("function"):
        factor = _DRAG.get(function.get("name", ""))
        if factor:
            _multiply(function, factor)
    target = folder / "aircraft" / airframe.name
    target.mkdir(parents=True, exist_ok=True)
    (folder / "systems").mkdir(exist_ok=True)
    tree.write(target / f"{airframe.name}.xml")
    (folder / "engine").mkdir(exist_ok=True)
    for name in {str(engine.get("file")) for engine in root.iter("engine")}:
        engine = ET.parse(source / "engine" / f"{name}.xml")
        for function in engine.iter("function"):
            if function.get("name") == "IdleThrust":
                _multiply(function, IDLE_FACTOR)
        engine.write(folder / "engine" / f"{name}.xml")
    shutil.copy(source / "engine" / "direct.xml", folder / "engine")
    return load


def _strip(root: ET.Element) -> None:
    """Take out what reads, writes or guides, and the inputs of what is gone."""
    for tag in _STRIPPED:
        for element in root.findall(tag):
            root.remove(element)
    for summer in root.iter("summer"):
        for element in summer.findall("input"):
            if (element.text or "").strip().startswith("ap/"):
                summer.remove(element)


def _add_load(root: ET.Element) -> int:
    """Add a point mass of no weight at the empty aircraft's centre of gravity; return its index."""
    balance = root.find("mass_balance")
    centre = None if balance is None else balance.find("location[@name='CG']")
    if balance is None or centre is None:
        raise ConfigError("a model without a centre of gravity", expected="<location name='CG'>", mend="use another")
    index = len(balance.findall("pointmass"))
    mass = ET.SubElement(balance, "pointmass", name=LOAD)
    ET.SubElement(mass, "weight", unit="LBS").text = "0"
    place = ET.SubElement(mass, "location", unit=centre.get("unit", "IN"))
    place.extend(list(centre))
    return index


def _multiply(function: ET.Element, factor: str) -> None:
    """Multiply a function's value by a property."""
    value = next(child for child in function if child.tag != "description")
    product = value
    if value.tag != "product":
        function.remove(value)
        product = ET.SubElement(function, "product")
        product.append(value)
    ET.SubElement(product, "property").text = factor
