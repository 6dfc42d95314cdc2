"""Opens flights and simulators, then runs the diagnosis (:mod:`descentflow.diagnosis.procedure`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError, DataError
from descentflow.densities.checkpoint import content_of, load_model
from descentflow.densities.density import Density
from descentflow.diagnosis.procedure import Settings, run
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.simulator import Simulator
from descentflow.effects import EFFECTS, Effect, checked_catalogue
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.representation.checkpoint import read_checkpoint
from descentflow.representation.representation import Representation
from descentflow.surveillance.descents.description import KEY
from descentflow.surveillance.descents.prepared_descents import REQUIRED, Descents, read_descents
from descentflow.surveillance.prepare import prepare


@dataclass(frozen=True)
class NominalSimulator:
    """Nominal BADA, flown at each flight's own speed.

    Attributes:
        aircraft: Coefficients.

    Example:
        >>> diagnose("flights.parquet", NominalSimulator(aircraft("A320")))
    """

    aircraft: Aircraft


def diagnose(
    real: str | Path | pl.DataFrame | Descents,
    simulator: str | Path | Density | NominalSimulator | None = None,
    *,
    typecode: str | None = None,
    bada_dir: Path | None = None,
    channels: Sequence[str] | None = None,
    catalogue: Mapping[str, Effect] | None = None,
    seed: int = 0,
    out: Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> GapReport:
    """Say where a simulator and real descents differ, which unmodelled effect causes it, and how far it shrinks.

    Args:
        real: Rows (file, folder or table) or prepared descents.
        simulator: Checkpoint, model, or nominal simulator; None with ``typecode``.
        typecode: Nominal BADA of this type in place of a simulator.
        bada_dir: Folder of BADA files for ``typecode``; the embedded open aircraft if absent.
        channels: Channels to use, see :data:`descentflow.measurements.quantity_registry.CHANNELS`; all that the
            flights have if absent.
        catalogue: Effects that may be named; :data:`descentflow.effects.EFFECTS` if absent.
        seed: Of permutations, bootstrap and samples: the same seed gives the same answer.
        out: Folder for `gap.json`, `gap.html` and `corrected.ckpt`; nothing is written if absent.
        progress: Called with what is being done.

    Returns:
        The report.

    Raises:
        DataError: If the flights cannot be used, are too few, or share no level with the simulator.
        ConfigError: If no simulator is named, or a channel or effect does not exist.
        CheckpointError: If the checkpoint cannot be read.

    Example:
        >>> report = diagnose("flights.parquet", "best.ckpt", out=Path("gap"))
        >>> print(report)
    """
    say = progress or (lambda _: None)
    wanted = _channels(channels)
    found = _simulator(simulator, typecode, bada_dir)
    say("reading flights")
    descents, dropped = _descents(real, found, say)
    effects = checked_catalogue(EFFECTS if catalogue is None else catalogue)
    report = run(descents, Settings(found, effects, wanted, seed, say), dropped)
    if out is not None:
        say("writing the report")
        report.write(out)
    return report


def _channels(channels: Sequence[str] | None) -> tuple[str, ...]:
    if channels is None:
        return CHANNELS
    unknown = [c for c in channels if c not in CHANNELS]
    if unknown:
        raise ConfigError(
            f"channel {', '.join(map(repr, unknown))}", expected=f"some of {', '.join(CHANNELS)}", mend="correct it"
        )
    # Without speed and rate there is no descent to compare.
    return tuple(c for c in CHANNELS if c in channels or c in ("IAS", "vertical_rate"))


def _simulator(
    simulator: str | Path | Density | NominalSimulator | None, typecode: str | None, bada_dir: Path | None
) -> Simulator:
    if (simulator is None) == (typecode is None):
        raise ConfigError(
            "neither a simulator nor a type" if simulator is None else "a simulator and a type",
            expected="one of them",
            mend="pass a checkpoint, or typecode for nominal BADA",
        )
    if typecode is not None:
        return Simulator(find_aircraft(typecode, bada_dir))
    if isinstance(simulator, NominalSimulator):
        return Simulator(simulator.aircraft)
    if isinstance(simulator, Density):
        parts = _unconditional(simulator.representation)
        return Simulator(
            parts.decoder.aircraft, simulator, parts, lambda: content_of(simulator), type(simulator).__name__
        )
    path = Path(str(simulator))
    model = load_model(path)
    parts = _unconditional(model.representation)
    return Simulator(parts.decoder.aircraft, model, parts, lambda: read_checkpoint(path), path.name)


def _unconditional(parts: Representation) -> Representation:
    """The same, unless its density needs a context: what flights were given is not among what is compared."""
    if parts.context is not None:
        raise ConfigError(
            "a simulator that is given a context", expected="one that is not", mend="fit it without data.context"
        )
    return parts


def _descents(
    real: str | Path | pl.DataFrame | Descents, simulator: Simulator, say: Callable[[str], None]
) -> tuple[pl.DataFrame, dict[str, int]]:
    """Prepared table, and counts of what its preparation dropped (as far as known)."""
    if isinstance(real, Descents):
        return real.frame, _dropped(real)
    if isinstance(real, pl.DataFrame):
        if all(name in real.columns for name in REQUIRED):
            return real, {}
        raise DataError(
            f"a table with columns {', '.join(real.columns[:12])}",
            expected="prepared descents (columns " + ", ".join(REQUIRED) + ")",
            mend="write the rows to a file and pass its path: they are prepared then",
        )
    path = Path(real)
    if _is_prepared(path):
        descents = read_descents(path)
        return descents.frame, _dropped(descents)
    if not path.exists():
        raise DataError(f"no file {path}", expected="rows or prepared descents", mend="check the path")
    descents = prepare([path], cleaning=simulator.cleaning(), progress=say)
    return descents.frame, _dropped(descents)


def _is_prepared(path: Path) -> bool:
    if path.suffix != ".parquet" or not path.is_file():
        return False
    try:
        return KEY in pl.read_parquet_metadata(path)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise DataError(
            f"{path}: {str(error).splitlines()[0]}", expected="a whole Parquet file", mend="write it again"
        ) from error


def _dropped(descents: Descents) -> dict[str, int]:
    report = descents.metadata.get("report") or {}
    steps = report.get("steps", []) if isinstance(report, dict) else []
    return {f"rows_{s['step']}": int(s["rows_dropped"]) for s in steps if s.get("rows_dropped")}
