"""Origin of the flights of either side: names, days, versions, settings, and a fingerprint of the flights."""

import hashlib
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from torch import Tensor

from descentflow.core.errors import warn
from descentflow.diagnosis.findings.inputs_found import InputUsed
from descentflow.diagnosis.sides.simulator import Simulator, types_of
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.rows.airspeed_source import derived_flights

DERIVED = (
    "derived airspeeds: their TAS and Mach are not compared, and a wind or temperature among the causes is the error "
    "of the weather field that made them, or the simulator's"
)
"""Words on the page and in a warning."""

if TYPE_CHECKING:
    from descentflow.representation.representation import Representation


def input_of_flights(name: str, descents: Descents) -> InputUsed:
    """Origin of prepared descents, or of rows that have been cleaned to such: days, version, settings, fingerprint.

    Args:
        name: Of the file or folder that they were read from.
        descents: The descents.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> described = input_of_flights("descents.parquet", read_descents("descents.parquet"))
        >>> described.flights, described.aircraft, described.first, described.last, described.files
        (120, 24, '2024-03-04', '2024-03-08', ['rows.parquet'])
    """
    frame, metadata = descents.frame, descents.metadata
    first, last = frame.select(first=pl.min("timestamp"), last=pl.max("timestamp")).row(0)
    version = metadata.get("descentflow")
    derived = len(derived_flights(frame))
    return InputUsed(
        name=name,
        kind=_kind(name, "flights", derived),
        typecodes=types_of(frame),
        flights=frame["flight_id"].n_unique(),
        aircraft=frame["icao24"].n_unique(),
        first=None if first is None else first.date().isoformat(),
        last=None if last is None else last.date().isoformat(),
        version=version if isinstance(version, str) else None,
        settings=settings_in_text(descents.cleaning),
        files=[str(one.get("name")) for one in metadata.get("inputs", []) if isinstance(one, dict)],
        fingerprint=fingerprint(frame),
        derived=derived,
    )


def rows_dropped(descents: Descents, what: str = "rows") -> dict[str, int]:
    """Rows that preparation left out, by its step."""
    report = descents.metadata.get("report") or {}
    steps = report.get("steps", []) if isinstance(report, dict) else []
    return {f"{what}_{s['step']}": int(s["rows_dropped"]) for s in steps if s.get("rows_dropped")}


def settings_in_text(cleaning: Cleaning | None) -> dict[str, str]:
    """Cleaning settings by name; none where they are unknown."""
    return {} if cleaning is None else {name: str(value) for name, value in asdict(cleaning).items()}


def fingerprint(frame: pl.DataFrame) -> str:
    """SHA-256 of prepared descents: the same for the same flights, wherever they are read from.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> fingerprint(frame) == fingerprint(frame.sample(fraction=1.0, shuffle=True, seed=1))
        True
        >>> fingerprint(frame) == fingerprint(frame.head(-1))
        False
    """
    ordered = frame.select("flight_id", "level_fl", "time_s").sort("flight_id", "level_fl")
    digest = hashlib.sha256("\n".join(ordered["flight_id"].to_list()).encode())
    digest.update(ordered["level_fl"].to_numpy().astype(np.int64).tobytes())
    # To a thousandth of a second, so that a file in single precision holds the same flights.
    digest.update((ordered["time_s"].to_numpy() * 1000).round().astype(np.int64).tobytes())
    return digest.hexdigest()


def input_of_model(simulator: Simulator, parts: "Representation") -> InputUsed:
    """Origin of a model: its name, training flights, settings and a fingerprint of its weights.

    Example:
        >>> from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
        >>> trained = Inputs("descents.parquet", "best.ckpt").open().simulator_input
        >>> trained.flights, trained.aircraft, trained.first, trained.last
        (86, 24, '2024-03-04', '2024-03-08')
    """
    from descentflow.representation.read_checkpoint import SECTION

    provenance, seen, content = parts.provenance, parts.seen, simulator.content()
    derived = int(provenance.get("derived", 0))
    first, last = seen.training_days()
    version = content.get(SECTION, {}).get("version")
    tensors = {name: value for name, value in content.get("state_dict", {}).items() if isinstance(value, Tensor)}
    digest = hashlib.sha256()
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].detach().cpu().contiguous().numpy().tobytes())
    return InputUsed(
        name=simulator.name,
        kind=_kind(simulator.name, "checkpoint", derived),
        typecodes=[str(name) for name in provenance.get("typecodes") or [simulator.aircraft.typecode]],
        flights=len(parts.split.train),
        aircraft=seen.training_aircraft(),
        first=first,
        last=last,
        version=version if isinstance(version, str) else None,
        settings=settings_in_text(parts.cleaning),
        files=[str(provenance["descents"])] if provenance.get("descents") else [],
        fingerprint=digest.hexdigest() if tensors else None,
        derived=derived,
    )


def _kind(name: str, kind: str, derived: int) -> str:
    """The kind of an input; of one with derived airspeeds with a warning of it."""
    if derived:
        kind += f", {derived:,} of its flights with {DERIVED}"
        warn(f"{name}: {kind}")
    return kind
