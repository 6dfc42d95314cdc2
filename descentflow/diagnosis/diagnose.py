"""Opens flights and simulators, measures both sides, and diagnoses them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import torch

from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.files import check_folder, check_separate
from descentflow.core.threads import one_thread
from descentflow.core.user_files import lines_named
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.findings.findings import FEW, Findings
from descentflow.diagnosis.gap._earlier_report import check_no_other_report
from descentflow.diagnosis.gap._what_is_left import left_out_channels
from descentflow.diagnosis.report.gap_report import FILES, GapReport
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.measured_sides import OWN_FLIGHTS, both_sides
from descentflow.diagnosis.sides.two_sides import compare
from descentflow.effects import EFFECTS, Effect, checked_catalogue
from descentflow.effects.user_catalogue import effects_of_file
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.surveillance.open_descents import paths_of


@checked_arguments
def diagnose(
    real: Any,
    simulator: Any = None,
    *,
    typecode: str | None = None,
    nearest_type: bool = False,
    bada_dir: str | Path | None = None,
    channels: Sequence[str] | None = None,
    catalogue: Mapping[str, Effect] | str | Path | None = None,
    previous: str | Path | None = None,
    seed: int = 0,
    out: Output | None = None,
    any_type: bool = False,
    air: str | Path | Sequence[str | Path] | None = None,
    columns: Mapping[str, str] | None = None,
    simulator_columns: Mapping[str, str] | None = None,
    simulator_name: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> GapReport:
    """Say where a simulator and real descents differ, which unmodelled effect causes it, and how far it shrinks.

    Both sides go through the same cleaning: rows are cleaned with the settings of a checkpoint's training descents, or
    with those of the other side's prepared descents. Other settings would show as a gap.

    Args:
        real: Path of rows or of prepared descents (file, folder or store), several such paths, descents as
            :func:`descentflow.surveillance.prepare.prepare` returns them, or a table (Polars or pandas) of them.
        simulator: Path of a checkpoint, a density, or a fitted model; flights of any simulator, in every form of
            ``real``; the designator of a type (``"A320"``), the name of a model of BADA 4, or coefficients, for
            nominal BADA at each flight's own speed. Files are recognised by their content. A checkpoint's flights are
            those that trained it, as measured at the fit: no sample is drawn.
        typecode: Designator of a type: in place of ``simulator``, its nominal descent; next to a simulator's flights,
            whose coefficients give the signatures of effects (the flights' own type if absent).
        nearest_type: Whether the nearest type may stand for flights whose type has no coefficients, see
            :func:`descentflow.aircraft_types.nearest_type.nearest_type`.
        bada_dir: Folder of BADA files for a designator or a simulator's flights; the embedded open aircraft if absent.
        channels: Channels to use, see :data:`descentflow.measurements.quantity_registry.CHANNELS`; all that both sides
            have if absent.
        catalogue: Effects that may be named; :data:`descentflow.effects.EFFECTS` if absent. A path is that of a Python
            file with effects next to those (:func:`descentflow.effects.user_catalogue.effects_of_file`): it is run.
        previous: `gap.json` of an earlier diagnosis of the same real flights, after which the simulator was changed:
            what it predicted is compared with what was achieved.
        seed: Of permutations, bootstrap and samples: the same seed gives the same answer.
        out: Folder for `gap.json`, `gap.html` and the corrected simulator; nothing is written if absent. One that holds
            the report of other flights or another simulator is refused; the same may be run again.
        any_type: Whether real flights of other types than a checkpoint's or a nominal descent's are taken too; if not,
            they are left out, counted and named.
        air: Where the real flights' air is known from, for a model that knows the air of its own: ``measured``, or a
            weather field; the former if absent, which a model fitted by a field refuses.
        columns: Name in a row -> column of the real rows' tables, for instance `{"altitude": "alt_ft"}`.
        simulator_columns: The same of the rows of a simulator's flights.
        simulator_name: Name of the simulator on the page and in the terminal; "the simulator" if absent.
        progress: Called with what is being done.

    Returns:
        The report: printed, it is the answer in a few lines.

    Raises:
        AircraftError: If the type is not known.
        CheckpointError: If the checkpoint cannot be read.
        ConfigError: If no simulator is named, the catalogue cannot be used, a channel does not exist, or the folder is
            that of flights.
        DataError: If the flights of either side cannot be used, are too few, or both have no type, no level or no
            needed channel in common; if the earlier diagnosis is of other flights, another type or version; or if the
            folder cannot be written or holds another report, before anything is computed.

    Warns:
        DescentflowWarning: If prepared descents were cleaned with other settings than the simulator's, or the settings
            of either are unknown; or if most of the real flights are some that a checkpoint was trained or validated
            on, which are compared all the same and counted.

    Example:
        >>> print(diagnose("rows.parquet", "best.ckpt"))
        No difference beyond chance between the simulator and the 120 real A320 flights (p = ...).
        ...
        96 of the 120 real flights are some that the simulator was trained or validated on. They are no test of it.
        ...
        >>> diagnose("descents.parquet", "A320").causes[0].parameters["relative_change"].unit  # lighter than nominal
        '1'
        >>> diagnose("rows.parquet", "descents.parquet").verdict  # flights of a simulator, here the same ones
        'none'
    """
    say = progress or (lambda _: None)
    if out is not None:
        check_folder(out, *FILES)
        # The corrected flights there would be taken for the simulator's the next time.
        check_separate([Path(out)], [path for side in (real, simulator) for path in paths_of(side) if path.exists()])
        check_no_other_report(out, previous)
    wanted = _channels(channels)
    effects, user_files = _catalogue(catalogue, say)
    opened = Inputs(
        real, simulator, typecode, bada_dir, nearest_type, any_type, air, columns, simulator_columns, say
    ).open()
    asked = {"seed": str(seed), "channels": ", ".join(wanted)}
    source = opened.simulator.aircraft.source
    asked |= {"coefficients": source} if source.startswith("BADA") else {}
    asked |= {} if bada_dir is None else {"bada_dir": Path(bada_dir).name}
    made = opened.provenance(asked, user_files)
    if out is not None:
        check_no_other_report(out, previous, made)
    diagnosed = replace(opened.simulator, name=simulator_name or opened.simulator.name)
    settings = Settings(diagnosed, effects, wanted, seed, say)
    if previous is not None:
        from descentflow.diagnosis.gap._previous_round import previous_round

        before = previous_round(previous, made, opened.simulator.aircraft.typecode)
        settings = replace(settings, previous=before, previous_name=str(previous))
    with one_thread(), lines_named(catalogue if isinstance(catalogue, str | Path) else None):
        findings = replace(diagnose_prepared(opened.frame, settings, opened.dropped), provenance=made)
        report = GapReport(**vars(findings))
        if out is not None:
            say("writing the report")
            report.write(out)
            report = replace(report, folder=str(out))
    return report


# Thousands of small steps: derivatives are not taken, and threads would wait for each other.
@one_thread()
@torch.inference_mode()
def diagnose_prepared(frame: pl.DataFrame, settings: Settings, dropped: Mapping[str, int]) -> Findings:
    """Diagnose a simulator by prepared descents: against its own flights, then for causes that both sides have.

    Args:
        frame: Prepared real descents.
        settings: What is diagnosed, and how.
        dropped: Rows that preparation left out, by reason.

    Raises:
        DataError: If too few flights show levels of the simulator's grid.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.diagnosis.sides.simulator import Simulator
        >>> from descentflow.effects import EFFECTS
        >>> frame = pl.read_parquet("descents.parquet")
        >>> asked = Settings(Simulator(aircraft("A320")), {"mass": EFFECTS["mass"]}, ["IAS", "vertical_rate"], 0, str)
        >>> diagnose_prepared(frame, asked, {}).verdict
        'effect'
    """
    simulator = settings.simulator
    settings.progress("measuring flights")
    sides = both_sides(simulator, frame, settings.channels)
    real, source, given = sides.real, sides.source, frame["flight_id"].n_unique()
    compared = compare(sides.simulated, real, simulator.aircraft)
    counts = {
        "flights_given": given,
        "flights_off_the_grid": given - len(real),
        "flights_compared": len(real),
        "simulator_flights": 0 if sides.simulated is None else len(sides.simulated),
        **({FEW: compared.short_of_causes} if compared.short_of_causes else {}),
        **dropped,
    }
    findings = diagnose_compared(compared, settings, source, counts, frame)
    findings = replace(findings, left_out_channels=left_out_channels(sides.lacked, settings.catalogue))
    if source == OWN_FLIGHTS:
        # Here and not above: a comparison of flights with flights must not pay for models.
        from descentflow.diagnosis._causes_of_both_sides import with_shared_effects

        findings = with_shared_effects(findings, real, settings)
    if settings.previous:
        from descentflow.diagnosis.gap._previous_round import held_against

        settings.progress("comparing with the round before")
        before = held_against(settings.previous, settings.previous_name, compared, settings.seed)
        findings = replace(findings, previous=before)
    return findings


def _catalogue(
    catalogue: Mapping[str, Effect] | str | Path | None, say: Callable[[str], None]
) -> tuple[Mapping[str, Effect], list[str]]:
    """Effects, and the files of the user's that were run for them."""
    if not isinstance(catalogue, str | Path):
        return checked_catalogue(EFFECTS if catalogue is None else catalogue), []
    say(f"running {catalogue}")
    own = effects_of_file(catalogue, frozenset(EFFECTS))
    with lines_named(catalogue):
        return checked_catalogue({**EFFECTS, **own}), [Path(catalogue).name]


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
