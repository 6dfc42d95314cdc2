"""One door to aircraft: the embedded open ones, or a licence holder's folder of BADA 3 or BADA 4."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada4.bada4_aircraft import FAMILY, Bada4Aircraft
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.core.arguments import checked_arguments
from descentflow.physics.performance_model import PerformanceModel

AnyAircraft = Bada3Aircraft | Bada4Aircraft


@checked_arguments
def aircraft(typecode: str, bada_dir: str | Path | None = None) -> AnyAircraft:
    """Return the aircraft of a type.

    Args:
        typecode: ICAO type designator, in any case; of BADA 4 also the name of a model.
        bada_dir: Folder of BADA 3, or of BADA 4 or one above it; None for the embedded open aircraft, which are not
            EUROCONTROL's.

    Returns:
        Its coefficients.

    Raises:
        AircraftError: If the type is not known there, or a file of the directory is missing or malformed.

    Example:
        >>> aircraft("A320").engine
        'jet'
    """
    if bada_dir is None:
        return open_aircraft(typecode)
    # Readers of a licence holder's files, which most never have.
    from descentflow.aircraft_types.bada3 import bada_directory
    from descentflow.aircraft_types.bada4 import bada4_directory

    release = bada4_directory.release_folder(bada_dir)
    if release is None:
        return bada_directory.load_aircraft(typecode, bada_dir)
    return bada4_directory.load_aircraft(typecode, release)


def every_aircraft(bada_dir: str | Path | None = None) -> Mapping[str, AnyAircraft]:
    """All aircraft that :func:`aircraft` finds, by type code.

    Raises:
        AircraftError: As :func:`aircraft`, for the first file that fails.

    Example:
        >>> every_aircraft()["B738"].n_engines
        2
    """
    if bada_dir is None:
        return {name: open_aircraft(name) for name in open_typecodes()}
    from descentflow.aircraft_types.bada3 import bada_directory
    from descentflow.aircraft_types.bada4 import bada4_directory

    release = bada4_directory.release_folder(bada_dir)
    return bada_directory.load_directory(bada_dir) if release is None else bada4_directory.load_directory(release)


def aircraft_from_state(state: dict[str, Any]) -> PerformanceModel:
    """Rebuild an aircraft from the primitives of a checkpoint.

    Raises:
        AircraftError: If a coefficient is missing, not known, or no finite number.

    Example:
        >>> aircraft_from_state(aircraft("A320").to_state()) == aircraft("A320")
        True
    """
    return (Bada4Aircraft if state.get("family") == FAMILY else Bada3Aircraft).from_state(state)
