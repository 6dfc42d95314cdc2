"""Opens flights and simulators, then runs the diagnosis (:mod:`descentflow.diagnosis.procedure`)."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from descentflow.aircraft_types.registry import aircraft as find_aircraft
from descentflow.core.errors import ConfigError
from descentflow.diagnosis.open_simulator import open_simulator
from descentflow.diagnosis.procedure import Settings, run
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.simulator import Simulator
from descentflow.effects import EFFECTS, Effect, checked_catalogue
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.representation.comparable_descents import comparable_descents
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import open_descents


def diagnose(
    real: Any,
    simulator: Any = None,
    *,
    typecode: str | None = None,
    bada_dir: Path | None = None,
    channels: Sequence[str] | None = None,
    catalogue: Mapping[str, Effect] | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> GapReport:
    """Say where a simulator and real descents differ, which unmodelled effect causes it, and how far it shrinks.

    Rows are cleaned with the settings of the simulator's own training descents: other settings would show as a gap.

    Args:
        real: Path of rows or of prepared descents (file, folder or store), several such paths, descents as
            :func:`descentflow.surveillance.prepare.prepare` returns them, or a table (Polars or pandas) of them.
        simulator: Path of a checkpoint, a density, or a fitted model; the designator of a type (``"A320"``) or its
            coefficients, for nominal BADA at each flight's own speed.
        typecode: Designator of a type in place of ``simulator``.
        bada_dir: Folder of BADA files for a designator; the embedded open aircraft if absent.
        channels: Channels to use, see :data:`descentflow.measurements.quantity_registry.CHANNELS`; all that the
            flights have if absent.
        catalogue: Effects that may be named; :data:`descentflow.effects.EFFECTS` if absent.
        seed: Of permutations, bootstrap and samples: the same seed gives the same answer.
        out: Folder for `gap.json`, `gap.html` and `corrected.ckpt`; nothing is written if absent.
        progress: Called with what is being done.

    Returns:
        The report: printed, it is the answer in a few lines.

    Raises:
        AircraftError: If the type is not known.
        CheckpointError: If the checkpoint cannot be read.
        ConfigError: If no simulator is named, the catalogue cannot be used, or a channel does not exist.
        DataError: If the flights cannot be used, are too few, or share no level with the simulator.

    Warns:
        DescentflowWarning: If prepared descents were cleaned with other settings than the simulator's, or the settings
            of either are unknown.

    Example:
        >>> print(diagnose("rows.parquet", "best.ckpt"))
        The flights do not differ from the simulator's by more than chance would (p = ...).
        No effect is named.
        The gap of 0.0... spreads is what two samples of one population show (0.1...).
        >>> diagnose("descents.parquet", "A320").causes[0].parameters["relative_change"].unit  # lighter than nominal
        '1'
    """
    say = progress or (lambda _: None)
    if (simulator is None) == (typecode is None):
        raise ConfigError(
            "neither a simulator nor a type" if simulator is None else "a simulator and a type",
            expected="one of them",
            mend="pass a checkpoint or a model, or the designator of a type for nominal BADA",
        )
    wanted = _channels(channels)
    effects = checked_catalogue(EFFECTS if catalogue is None else catalogue)
    found = open_simulator(simulator, bada_dir) if typecode is None else Simulator(find_aircraft(typecode, bada_dir))
    say("reading flights")
    parts = found.representation
    descents = open_descents(real, progress=say) if parts is None else comparable_descents(real, parts, progress=say)
    report = run(descents.frame, Settings(found, effects, wanted, seed, say), _dropped(descents))
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


def _dropped(descents: Descents) -> dict[str, int]:
    report = descents.metadata.get("report") or {}
    steps = report.get("steps", []) if isinstance(report, dict) else []
    return {f"rows_{s['step']}": int(s["rows_dropped"]) for s in steps if s.get("rows_dropped")}
