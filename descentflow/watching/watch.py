"""Watch a simulator by days of real flights: measure what is new, weigh the evidence, and name the change."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import polars as pl
import torch

from descentflow.core.arguments import Output, Within, checked_arguments
from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import whole_file
from descentflow.core.threads import one_thread
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs, Opened
from descentflow.diagnosis.sides.input_descriptions import fingerprint
from descentflow.diagnosis.sides.simulator import FLIGHTS, kind_of_simulator
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import FlightSource
from descentflow.watching.change_evidence import MIN_REFERENCE, Evidence, evidence
from descentflow.watching.changes import change_of
from descentflow.watching.day_record import day_record, means_of
from descentflow.watching.state import PAGE, State, WatchSettings
from descentflow.watching.watch_page import page
from descentflow.watching.watch_result import Watch

REFERENCE_DAYS = 30
FALSE_ALARMS = 0.05
DIAGNOSED_DAYS = 30
"""Days before and after a change whose flights are diagnosed, at most."""
Share = Annotated[float, Within(1e-4, 1.0)]
Reference = Annotated[int, Within(MIN_REFERENCE)]


@checked_arguments
def watch(
    simulator: Any,
    days: str | Path,
    *,
    state: Output,
    typecode: str | None = None,
    bada_dir: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    reference_days: Reference = REFERENCE_DAYS,
    false_alarms: Share = FALSE_ALARMS,
    accept: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Watch:
    """Measure new days of real flights beside a simulator, and say whether their difference has changed.

    The same days give the same state, in whatever order they come. A run that is killed leaves a whole state, and the
    next one goes on. No flight is kept.

    Args:
        simulator: A checkpoint, flights of any simulator, or the designator of a type.
        days: A file, or a folder with files of rows or of prepared descents, one or more days in each.
        state: Folder of the watch.
        typecode: Type whose coefficients carry the rate from one airspeed to another, for a simulator's flights.
        bada_dir: Folder of BADA files; the embedded open aircraft if absent.
        columns: Name in a row -> column of the rows' tables.
        reference_days: First days, between which the scatter is learnt and no change is sought.
        false_alarms: Rate of false alarms a year, over everything that is watched.
        accept: Take the change that stands as the new reference first.
        progress: Called with what is being done.

    Returns:
        New days, and the alarm that stands.

    Raises:
        ConfigError: If the folder watches another simulator, or there is nothing to accept.
        DataError: If there are no files, or another run holds the folder.

    Example:
        >>> watch("A320", "descents.parquet", state="watched-too").new_days[0]["day"]
        '2024-03-04'
    """
    say, folder = progress or (lambda _: None), State(state)
    if kind_of_simulator(simulator, bada_dir) == FLIGHTS:
        simulator = FlightSource(simulator).descents()
    with folder.locked(), one_thread():
        if accept:
            folder.accept()
        files, left_out, new = _files(Path(days)), {}, []
        known = {(line["file"], line["file_bytes"]) for line in folder.days().iter_rows(named=True)}
        settings = folder.settings
        for name, path in files.items():
            if (name, path.stat().st_size) in known:
                continue
            say(f"measuring {name}")
            try:
                opened = Inputs(path, simulator, typecode, bada_dir, columns=columns).open()
            except DataError as error:
                left_out[name] = str(error)
                continue
            settings = folder.begin(_settings(opened, reference_days, false_alarms))
            lines = list(_measured(opened, path, name, folder.days(), left_out))
            folder.add(lines)
            new += [line["day"] for line in lines]
        if settings is None:
            raise DataError(
                f"no day in {days} that can be used ({'; '.join(left_out.values())})",
                expected="files of rows or of prepared descents",
                mend="give such files",
            )
        return _judged(folder, settings, new, left_out, files, typecode, bada_dir, say)


def _files(days: Path) -> dict[str, Path]:
    """Files by their paths within the folder, for partitions have files of one name."""
    if not days.exists():
        raise DataError(f"no folder {days}", expected="files of rows or of prepared descents", mend="check the path")
    if days.is_file():
        return {days.name: days}
    paths = sorted(path for path in days.rglob("*") if path.is_file() and not path.name.startswith((".", "_")))
    return {path.relative_to(days).as_posix(): path for path in paths}


def _settings(opened: Opened, reference_days: int, false_alarms: float) -> WatchSettings:
    used, aircraft = opened.simulator_input, opened.simulator.aircraft
    return WatchSettings(used.name, used.fingerprint or "", aircraft.typecode, reference_days, false_alarms)


@torch.inference_mode()
def _measured(
    opened: Opened, path: Path, name: str, known: pl.DataFrame, left_out: dict[str, str]
) -> Iterator[dict[str, Any]]:
    """Lines of the days of a file that are new."""
    frame = opened.frame.with_columns(day=pl.col("timestamp").min().over("flight_id").dt.date().cast(pl.String))
    before = dict(zip(known["day"].to_list(), known["fingerprint"].to_list(), strict=True))
    for (day,), part in sorted(frame.partition_by("day", as_dict=True).items()):
        made = fingerprint(part)
        if day in before:
            if before[day] != made:
                left_out[f"{day} of {name}"] = "another file gave other flights of this day before"
            continue
        try:
            record = day_record(opened.simulator, part.drop("day"))
        except DataError as error:
            left_out[f"{day} of {name}"] = str(error)
            continue
        yield {"day": day, "file": name, "file_bytes": path.stat().st_size, "fingerprint": made, **record}


def _judged(
    folder: State,
    settings: WatchSettings,
    new: list[str],
    left_out: dict[str, str],
    files: dict[str, Path],
    typecode: str | None,
    bada_dir: str | Path | None,
    say: Callable[[str], None],
) -> Watch:
    """Evidence of all days, and the alarm: the one that stands, or a new one with its cause."""
    days = folder.days()
    counted = days.filter(pl.col("day") >= (settings.since or "")) if len(days) else days
    weighed = evidence(means_of(counted), settings.reference_days) if len(counted) else None
    stood, is_new = folder.alarm(), False
    first = None if weighed is None else weighed.first_alarm(settings.false_alarms)
    alarm = None if weighed is None or first is None else change_of(counted, weighed, first)
    if alarm is None or stood is None or {**stood, "cause": None} != {**alarm, "cause": None}:
        # Days may have come late: what stands follows from the days alone.
        if alarm is not None:
            say("seeking the cause")
            alarm["cause"] = _cause(alarm, counted, files, typecode, bada_dir)
        is_new = alarm is not None and stood is None
        folder.keep_alarm(alarm)
    else:
        alarm = stood
    lines = _lines(counted, weighed, settings, sorted(new))
    result = Watch(lines, left_out, alarm, is_new, settings, days)
    # Each time: a run that was killed may have left the page of the day before.
    with whole_file(folder.folder / PAGE) as temporary:
        temporary.write_text(page(result, counted, weighed), encoding="utf-8")
    return result


def _lines(
    days: pl.DataFrame, weighed: Evidence | None, settings: WatchSettings, new: list[str]
) -> list[dict[str, Any]]:
    """Day, flights and evidence of each new day."""
    lines = []
    for i, line in enumerate(days.iter_rows(named=True)):
        if line["day"] in new and weighed is not None:
            log_e = float(weighed.log_e[i])
            lines.append(
                {
                    "day": line["day"],
                    "flights": line["flights"],
                    "log_e": round(log_e, 3),
                    "alarm": bool(log_e >= -np.log(settings.false_alarms)),
                }
            )
    return lines


def _cause(
    alarm: dict[str, Any], days: pl.DataFrame, files: dict[str, Path], typecode: str | None, bada_dir: str | Path | None
) -> dict[str, Any]:
    """The diagnosis of flights after the change against those before it, where their files are still there."""
    last_before, first_after = alarm["change"]["before"], alarm["change"]["after"]
    sides = []
    for part in (
        days.filter(pl.col("day") >= first_after).head(DIAGNOSED_DAYS),
        days.filter(pl.col("day") <= last_before).tail(DIAGNOSED_DAYS),
    ):
        paths = [files[name] for name in part["file"].unique(maintain_order=True) if name in files]
        if not paths:
            return {"verdict": "unknown", "why": "the files of the days before or after are no longer there"}
        descents = FlightSource(paths).descents()
        day = pl.col("timestamp").min().over("flight_id").dt.date().cast(pl.String)
        sides.append(Descents(descents.frame.filter(day.is_in(part["day"].implode())), descents.metadata))
    try:
        report = diagnose(sides[0], sides[1], typecode=typecode or _own_type(sides[0].frame), bada_dir=bada_dir)
    except (ConfigError, DataError) as error:
        return {"verdict": "unknown", "why": str(error)}
    return {
        "verdict": report.verdict,
        "effects": [cause.effect for cause in report.causes],
        "in_words": [f"{report.details.label(step.effect)}: {step.text}" for step in report.recipe],
        "only_the_weather": bool(report.causes) and all(cause.of_air for cause in report.causes),
    }


def _own_type(frame: pl.DataFrame) -> str | None:
    types = frame["typecode"].drop_nulls().unique().to_list()
    return str(types[0]) if len(types) == 1 else None
