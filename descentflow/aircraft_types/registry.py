"""One door to aircraft: the embedded open ones, or a licence holder's folder of BADA 3 or BADA 4.

Each is imported when it is asked for.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from descentflow.core.arguments import checked_arguments
from descentflow.physics.performance_model import PerformanceModel

if TYPE_CHECKING:
    from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
    from descentflow.aircraft_types.bada4.bada4_aircraft import Bada4Aircraft

    AnyAircraft = Bada3Aircraft | Bada4Aircraft


@checked_arguments
def aircraft(typecode: str, bada_dir: str | Path | None = None) -> "AnyAircraft":
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
        from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft

        return open_aircraft(typecode)
    reader, folder = _reader(bada_dir)
    loaded: AnyAircraft = reader.load_aircraft(typecode, folder)
    return loaded


def every_aircraft(bada_dir: str | Path | None = None) -> "Mapping[str, AnyAircraft]":
    """All aircraft that :func:`aircraft` finds, by type code.

    Raises:
        AircraftError: As :func:`aircraft`, for the first file that fails.

    Example:
        >>> every_aircraft()["B738"].n_engines
        2
    """
    if bada_dir is None:
        from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes

        return {name: open_aircraft(name) for name in open_typecodes()}
    reader, folder = _reader(bada_dir)
    by_type: dict[str, AnyAircraft] = reader.load_directory(folder)
    return by_type


def file_of(typecode: str, bada_dir: str | Path) -> Path:
    """A licence holder's file of a type: its OPF file of BADA 3, its XML file of BADA 4.

    Raises:
        AircraftError: If the type is not known there.
    """
    reader, folder = _reader(bada_dir)
    return Path(reader.file_of(typecode, folder))


def _reader(bada_dir: str | Path) -> tuple[Any, Path]:
    """The module that reads a folder, and the folder that it reads."""
    from descentflow.aircraft_types.bada3 import _bada_directory
    from descentflow.aircraft_types.bada4 import bada4_directory

    release = bada4_directory.release_folder(bada_dir)
    return (_bada_directory, Path(bada_dir)) if release is None else (bada4_directory, release)


def aircraft_from_state(state: dict[str, Any]) -> PerformanceModel:
    """Rebuild an aircraft from the primitives of a checkpoint.

    Raises:
        AircraftError: If a coefficient is missing, not known, or no finite number.

    Example:
        >>> aircraft_from_state(aircraft("A320").to_state()) == aircraft("A320")
        True
    """
    if "family" in state:
        from descentflow.aircraft_types.bada4.bada4_aircraft import Bada4Aircraft

        return Bada4Aircraft.from_state(state)
    from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft

    return Bada3Aircraft.from_state(state)
