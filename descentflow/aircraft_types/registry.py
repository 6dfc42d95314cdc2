"""One door to aircraft: the embedded open ones, or a licence holder's BADA directory."""

from pathlib import Path

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.bada3.bada_directory import load_aircraft
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.arguments import checked_arguments


@checked_arguments
def aircraft(typecode: str, bada_dir: str | Path | None = None) -> Aircraft:
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
