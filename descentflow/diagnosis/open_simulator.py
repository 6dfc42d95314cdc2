"""A model that a caller means: a checkpoint, a density or a fitted model; and the real flights as it has them.

That a model descends as flights do from which it learnt is no proof of it: such flights are counted. One that knows the
air of its flights is compared in standard air.
"""

import hashlib
import warnings
from dataclasses import replace
from pathlib import Path

import polars as pl
from torch import Tensor

from descentflow.air.standard_air import in_standard_air
from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.densities.checkpoint import as_density, content_of
from descentflow.diagnosis.findings.findings import SEEN
from descentflow.diagnosis.findings.inputs_found import InputUsed
from descentflow.diagnosis.input_descriptions import settings_in_text
from descentflow.diagnosis.simulator import Simulator
from descentflow.representation.own_air import AirSource, airs_as_kept, check_air_asked
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint
from descentflow.representation.representation import Representation
from descentflow.representation.seen_flights import SeenFlights


def open_simulator(model: object) -> Simulator:
    """The simulator of a model.

    Args:
        model: Path of a checkpoint, a density, or a fitted model of :mod:`descentflow.training.models`.

    Raises:
        CheckpointError: If the path is no checkpoint that can be used.
        ConfigError: If it is none of these, has not been fitted, is corrected already, or its density needs a context.

    Example:
        >>> open_simulator("best.ckpt").name
        'best.ckpt'
    """
    density = as_density(model)
    parts = density.representation
    found = Simulator(parts.decoder.aircraft, density, parts, lambda: content_of(density), type(density).__name__)
    if isinstance(model, str | Path):
        path = Path(model)
        found = replace(found, content=lambda: read_checkpoint(path), name=path.name)
    if parts.context is not None:
        # What flights were given is not among what is compared.
        raise ConfigError(
            "a simulator that is given a context", expected="one that is not", mend="fit it without data.context"
        )
    if parts.correction is not None:
        raise ConfigError(
            f"{found.name}, a simulator that is corrected already: the flights that it carries are those before",
            expected="the checkpoint that `descentflow fit` wrote, or flights",
            mend="diagnose what it flies: corrected.parquet beside it, or samples (descentflow sample) as --simulator",
        )
    return found


def without_weather(
    frame: pl.DataFrame, parts: Representation, air: AirSource | None = None
) -> tuple[pl.DataFrame, int]:
    """Real flights in standard air, and how many were left out because nothing is known of their air.

    The training flights that a checkpoint carries were brought there likewise, each by its own temperature and wind:
    the comparison is the one of the simulator flown in the real flights' own airs.

    Args:
        frame: Prepared descents.
        parts: Of a model; of drag in standard air, nothing is changed.
        air: Where the flights' air is known from, see :func:`~descentflow.representation.own_air.airs_as_kept`.

    Raises:
        ConfigError: If the model's air came from a weather field and none is given, or one is given to a model of drag
            in standard air.
        DataError: If nothing is known of the air of any flight.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> frame = pl.read_parquet("descents.parquet")
        >>> without_weather(frame, load_representation("best.ckpt"))[1]
        0
    """
    check_air_asked(parts, air)
    if parts.air is None:
        return frame, 0
    levels_fl = parts.decoder.levels_fl.cpu()
    airs = airs_as_kept(frame, levels_fl, parts.air, air)
    found = in_standard_air(frame, parts.decoder.aircraft, airs, levels_fl)
    if found.is_empty():
        raise DataError(
            f"none of {airs.without} flights reports its air",
            expected="flights with TAS and groundspeed, for a model of drag in measured air",
            mend="give such flights, or diagnose a model that was fitted with data.air=standard",
        )
    return found, airs.without


def own_flights(real: pl.DataFrame, name: str, seen: SeenFlights) -> dict[str, int]:
    """Count the real flights that a checkpoint was trained or validated on; they are compared all the same.

    Recognised by aircraft and time: flights of a simulator that flew the same traffic again are not the real ones,
    though both may have the same identifiers.

    Args:
        real: Prepared real descents.
        name: The checkpoint's.
        seen: The flights that it has seen.

    Returns:
        Their number by name; nothing if there are none.

    Warns:
        DescentflowWarning: If they are most of the real flights.

    Example:
        >>> import warnings
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> frame = pl.read_parquet("descents.parquet")
        >>> with warnings.catch_warnings(record=True) as told:
        ...     warnings.simplefilter("always")
        ...     own_flights(frame, "best.ckpt", load_representation("best.ckpt").seen)
        {'flights_that_the_simulator_has_seen': 96}
        >>> print(told[0].message)
        96 of the 120 real flights are some that best.ckpt was trained or validated on, and are no test of it; ...
    """
    count, total = len(seen.among(real)), real["flight_id"].n_unique()
    if 2 * count > total:
        warnings.warn(
            f"{count:,} of the {total:,} real flights are some that {name} was trained or validated on, and are no "
            "test of it; to learn how it descends beside flights that it has not seen, pass others",
            DescentflowWarning,
            stacklevel=4,
        )
    return {SEEN: count} if count else {}


def input_of_model(simulator: Simulator) -> InputUsed:
    """Origin of a model: its name, training flights, settings and a fingerprint of its weights.

    Example:
        >>> trained = input_of_model(open_simulator("best.ckpt"))
        >>> trained.flights, trained.aircraft, trained.first, trained.last
        (86, 24, '2024-03-04', '2024-03-08')
    """
    parts = simulator.representation
    assert parts is not None
    provenance, seen = parts.provenance, parts.seen
    first, last = (None, None) if seen is None else seen.training_days()
    return InputUsed(
        name=simulator.name,
        kind="checkpoint",
        typecodes=[str(name) for name in provenance.get("typecodes") or [simulator.aircraft.typecode]],
        flights=len(parts.split.train),
        aircraft=None if seen is None else seen.training_aircraft(),
        first=first,
        last=last,
        version=_version_of(simulator),
        settings=settings_in_text(parts.cleaning),
        files=[str(provenance["descents"])] if provenance.get("descents") else [],
        fingerprint=_of_weights(simulator),
    )


def _version_of(simulator: Simulator) -> str | None:
    """Version of descentflow that wrote a checkpoint; None where it does not say."""
    section = {} if simulator.content is None else simulator.content().get(SECTION, {})
    version = section.get("version") if isinstance(section, dict) else None
    return version if isinstance(version, str) else None


def _of_weights(simulator: Simulator) -> str | None:
    """SHA-256 of the weights in a checkpoint; None where it holds none."""
    weights = {} if simulator.content is None else simulator.content().get("state_dict", {})
    tensors = {name: value for name, value in weights.items() if isinstance(value, Tensor)}
    if not tensors:
        return None
    digest = hashlib.sha256()
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()
