"""A licence holder's own file of BADA 4 with other drag, idle thrust and speeds of the descent."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from descentflow.aircraft_types.bada4.acm_file import read_xml
from descentflow.aircraft_types.bada4.wing import Wing
from descentflow.core.tabular import optional_library

SPEEDS = {"des_cas_low_kt": "CAS1", "des_cas_high_kt": "CAS2", "des_mach": "M"}
"""Speed of the descent -> its element."""


def changed_acm(file: Path, speeds: dict[str, float], parasitic: float, induced: float, idle: float) -> bytes:
    """The file with factors in the numbers of clean drag and idle thrust, and speeds; all else as it stands.

    Args:
        file: Of :func:`~descentflow.aircraft_types.bada4.acm_file.read_acm`, which has checked it.
        speeds: Of the first schedule, by the name of the coefficient.
        parasitic: Factor of the drag without lift, five numbers ``d``.
        induced: Factor of the drag by lift, the other ten.
        idle: Factor of the idle thrust, the numbers ``ti``.

    Raises:
        AircraftError: If the file cannot be read.

    Example:
        >>> changed_acm(Path("A320-231.xml"), {"des_mach": 0.78}, 1.05, 1.0, 0.9)
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: A320-231.xml: ...
    """
    tree = read_xml(file, "an XML file (ACM) of BADA 4", remove_comments=False).node.getroottree()
    idles = tree.findall("PFM/*/LIDL/CT/ti")
    (path, n), *_ = Wing.PLACES["drag"]
    _scale(tree.findall(path), [parasitic] * 5 + [induced] * (n - 5))
    _scale(idles, [idle] * len(idles))
    phases = tree.find("ARPM/SpeedScheduleList/SpeedSchedule").findall("SpeedPhase")
    descent = next(one for one in phases if (one.findtext("name") or "").strip() == "Descent")
    for name, value in speeds.items():
        descent.find(SPEEDS[name]).text = f"{value:g}"
    etree = optional_library("lxml.etree", "bada4")
    return bytes(etree.tostring(tree, xml_declaration=True, encoding="utf-8"))


def _scale(nodes: Sequence[Any], factors: Sequence[float]) -> None:
    for node, factor in zip(nodes, factors, strict=True):
        if factor != 1:
            node.text = repr(float(node.text) * factor)
