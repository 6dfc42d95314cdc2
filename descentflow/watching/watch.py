"""Watch a simulator by days of real flights: measure what is new, weigh the evidence, and name the change."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
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
from descentflow.watching._changes import change_of
from descentflow.watching._watch_page import page
from descentflow.watching.change_evidence import MIN_REFERENCE, Evidence, evidence
from descentflow.watching.day_record import day_record, means_of
from descentflow.watching.state import PAGE, State, WatchSettings
from descentflow.watching.watch_result import Watch

REFERENCE_DAYS = 30
FALSE_ALARMS = 0.05
DIAGNOSED_DAYS = 30
"""Last days of either side of a change whose flights are diagnosed, at most."""
Share = Annotated[float, Within(1e-4, 1.0)]
Change = dict[str, Any]
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
    """Measure new days of real flights next to a simulator, and say whether their difference has changed.

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
            used, code = opened.simulator_input, opened.simulator.aircraft.typecode
            asked = WatchSettings(used.name, used.fingerprint or "", code, reference_days, false_alarms)
            settings = folder.begin(asked)
            lines = list(_measured(opened, path, name, folder.days(), left_out))
            folder.add(lines)
            new += [line["day"] for line in lines]
        if settings is None:
            raise DataError(
                f"no day in {days} that can be used ({'; '.join(left_out.values())})",
                expected="files of rows or of prepared descents",
                mend="give such files",
            )
        cause = partial(_cause, files=files, columns=columns, typecode=settings.typecode, bada_dir=bada_dir)
        return _judged(folder, settings, new, left_out, cause, say)


def _files(days: Path) -> dict[str, Path]:
    """Files by their paths within the folder, for partitions have files of one name."""
    if not days.exists():
        raise DataError(f"no folder {days}", expected="files of rows or of prepared descents", mend="check the path")
    if days.is_file():
        return {days.name: days}
    paths = sorted(path for path in days.rglob("*") if path.is_file() and not path.name.startswith((".", "_")))
    return {path.relative_to(days).as_posix(): path for path in paths}


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
    cause: Callable[..., Change],
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
            alarm["cause"] = cause(alarm, counted)
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
    if weighed is None:
        return []
    known = zip(days["day"], days["flights"], weighed.log_e.tolist(), strict=True)
    over = -np.log(settings.false_alarms)
    return [
        {"day": day, "flights": flights, "log_e": round(log_e, 3), "alarm": bool(log_e >= over)}
        for day, flights, log_e in known
        if day in new
    ]


def _cause(
    alarm: Change, days: pl.DataFrame, *, files: dict[str, Path], columns: Any, typecode: str, bada_dir: Any
) -> Change:
    """The diagnosis of flights from the change to the alarm against those before, where their files are still there.

    What comes after the alarm is left out, so that the cause is the same in whatever order days come.
    """
    change, sides = alarm["change"], []
    after = pl.col("day").is_between(pl.lit(change["day"]), pl.lit(alarm["raised"]))
    try:
        for kept in (after, pl.col("day") <= change["before"]):
            part = days.filter(kept).tail(DIAGNOSED_DAYS)
            names = part["file"].unique(maintain_order=True).to_list()
            there = [files[name] for name in names if name in files] or [Path(names[0])]
            descents = FlightSource(there, columns).descents()
            day = pl.col("timestamp").min().over("flight_id").dt.date().cast(pl.String)
            frame = descents.frame.filter(day.is_in(part["day"].implode()))
            of_type = pl.col("typecode").fill_null(typecode) == typecode
            sides.append(Descents(frame.filter(of_type) if typecode in frame["typecode"] else frame, descents.metadata))
        report = diagnose(sides[0], sides[1], typecode=typecode, bada_dir=bada_dir)
    except (ConfigError, DataError) as error:
        return {"verdict": "unknown", "why": str(error)}
    weather = {cause.effect for cause in report.causes if cause.of_air}
    words = [(f"{report.details.label(step.effect)}: {step.text}", step.effect in weather) for step in report.recipe]
    return {
        "verdict": report.verdict,
        "effects": [cause.effect for cause in report.causes],
        "in_words": [text for text, of_weather in words if not of_weather],
        "weather": [text for text, of_weather in words if of_weather],
        "only_the_weather": bool(report.causes) and all(cause.of_air for cause in report.causes),
    }
