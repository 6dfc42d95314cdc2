"""One door to aircraft: the embedded open ones, or a licence holder's BADA directory."""

from pathlib import Path
from typing import Any

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.bada_directory import load_aircraft
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.arguments import checked_arguments
from descentflow.physics.performance_model import PerformanceModel


@checked_arguments
def aircraft(typecode: str, bada_dir: str | Path | None = None) -> Bada3Aircraft:
    """Return the aircraft of a type.

    Args:
        typecode: ICAO type designator, in any case.
        bada_dir: BADA 3 directory; None for the embedded open aircraft, which are not EUROCONTROL's.

    Returns:
        Its coefficients.

    Raises:
        AircraftError: If the type is not known there, or a file of the directory is missing or malformed.

    Example:
        >>> aircraft("A320").engine
        'jet'
    """
    return open_aircraft(typecode) if bada_dir is None else load_aircraft(typecode, bada_dir)


def aircraft_from_state(state: dict[str, Any]) -> PerformanceModel:
    """Rebuild an aircraft from the primitives of a checkpoint.

    Raises:
        AircraftError: If a coefficient is missing, not known, or no finite number.

    Example:
        >>> aircraft_from_state(aircraft("A320").to_state()) == aircraft("A320")
        True
    """
    return Bada3Aircraft.from_state(state)
