"""The simulator that a caller means: a checkpoint, a density, a fitted model, or nominal BADA of a type."""

from dataclasses import replace
from pathlib import Path

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError
from descentflow.densities.checkpoint import as_density, content_of
from descentflow.diagnosis.simulator import Simulator
from descentflow.diagnosis.simulator_kind import is_designator
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.read_checkpoint import read_checkpoint


def open_simulator(simulator: object, bada_dir: str | Path | None = None) -> Simulator:
    """The simulator that is diagnosed, where it is not given by its flights.

    Args:
        simulator: Path of a checkpoint; a density; a fitted model of :mod:`descentflow.training.models`; the designator
            of a type, or its coefficients, for nominal BADA at each flight's own speed. A text that is both the name of
            a file and a designator is taken as the file.
        bada_dir: Folder of BADA files for a designator; the embedded open aircraft if absent.

    Raises:
        AircraftError: If the type is not known.
        CheckpointError: If the path is no checkpoint that can be used.
        ConfigError: If it is none of these, has not been fitted, or its density needs a context.

    Example:
        >>> open_simulator("A320").name, open_simulator("best.ckpt").name
        ('nominal', 'best.ckpt')
    """
    if isinstance(simulator, PerformanceModel):
        return Simulator(simulator)
    if is_designator(simulator):
        return Simulator(find_aircraft(str(simulator), bada_dir))
    if bada_dir is not None:
        raise ConfigError(
            "BADA files for a simulator that has its own coefficients",
            expected="them with the designator of a type, or with a simulator's flights",
            mend="name the type, or leave the folder out",
        )
    density = as_density(simulator)
    parts = density.representation
    if parts.context is not None:
        # What flights were given is not among what is compared.
        raise ConfigError(
            "a simulator that is given a context", expected="one that is not", mend="fit it without data.context"
        )
    found = Simulator(parts.decoder.aircraft, density, parts, lambda: content_of(density), type(density).__name__)
    if isinstance(simulator, str | Path):
        path = Path(simulator)
        return replace(found, content=lambda: read_checkpoint(path), name=path.name)
    return found
