"""From files of rows to prepared descents: every step in its order, every drop counted, memory bounded."""

import json
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import check_output, whole_file
from descentflow.core.version import __version__
from descentflow.core.workers import Engine, LocalEngine
from descentflow.surveillance.cleaning.chain import Outcome, clean
from descentflow.surveillance.cleaning.drop_reasons import some_flights
from descentflow.surveillance.cleaning.flights import check_left
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents import store
from descentflow.surveillance.descents.prepared_descents import KEY, SCHEMA_VERSION, Descents, top_levels
from descentflow.surveillance.formats.readers import files_of
from descentflow.surveillance.out_of_core.batches import Partition, clean_partition
from descentflow.surveillance.out_of_core.finish import Prepared, finished
from descentflow.surveillance.out_of_core.intake import Group, Intake, groups_of, read_again, read_group, take_in
from descentflow.surveillance.out_of_core.job import PARTS, ROWS, fingerprint, job_folder, work_folder
from descentflow.surveillance.out_of_core.request import Request
from descentflow.surveillance.out_of_core.spill import Memory, Spill, joined, partitions
from descentflow.surveillance.rows.drop_report import DropReport

__all__ = ["MEMORY_BYTES", "Cleaning", "Prepared", "Request", "prepare", "prepare_to"]

MEMORY_BYTES = 2_000_000_000
Say = Callable[[str], None]


def prepare(
    paths: Sequence[str | Path],
    *,
    types: pl.DataFrame | None = None,
    typecodes: Sequence[str] | None = None,
    cleaning: Cleaning | None = None,
    format: str | None = None,
    progress: Say | None = None,
) -> tuple[Descents, DropReport]:
    """Read rows, clean them to free descents and put those on flight levels (paper, section 3), all in memory.

    Args:
        paths: Files or folders of rows.
        types: Table `icao24,typecode` for rows that do not name their type.
        typecodes: Types to keep; all if absent.
        cleaning: Thresholds.
        format: What the files are; found from their content if absent.
        progress: Called with what is being done, at every stage and part.

    Returns:
        Descents, and the report of everything dropped.

    Raises:
        DataError: If the rows cannot be used, or no descent is left.

    Example:
        >>> descents, report = prepare([Path("rows.parquet")], typecodes=["A320"])
        >>> print(report)
    """
    request = Request(paths, types, typecodes, cleaning or Cleaning(), format)
    say = progress or (lambda _: None)
    files = files_of(paths)
    say("reading rows")
    intake = take_in(files, format, Spill(Path(), 2**62))
    outcome = _in_memory(intake, request, os.cpu_count() or 1, say)
    metadata = _metadata(request.facts(files), intake.report, outcome.levels)
    return Descents(outcome.levels, metadata), intake.report


def prepare_to(
    out: Path,
    request: Request,
    *,
    memory_bytes: int = MEMORY_BYTES,
    engine: Engine | None = None,
    progress: Say | None = None,
) -> Prepared:
    """As :func:`prepare`, but to a file (a name that ends in .parquet) or a store (any other), of any size.

    Rows that do not fit are spread over partitions of whole aircraft on disk, in a folder beside the output. What is
    done of a run that was killed stays there, and the same call goes on from it. The descents do not depend on memory,
    engine, partitions or interruptions.

    Args:
        out: File or folder.
        request: What is to be prepared.
        memory_bytes: Bound on this process, and on each worker.
        engine: Where partitions are worked on; threads of this process by default.
        progress: Called with what is being done.

    Raises:
        DataError: If the rows cannot be used, or no descent is left.
        ConfigError: If the output cannot be written or belongs to another run.
    """
    say = progress or (lambda _: None)
    engine = engine or LocalEngine(os.cpu_count() or 1)
    # Of an output inside a folder of inputs, what an earlier run left is no input.
    own = (out.resolve(), work_folder(out).resolve())
    files = [path for path in files_of(request.paths) if not any(path.resolve().is_relative_to(one) for one in own)]
    say("hashing inputs")
    facts = request.facts(files)
    is_store = out.suffix != ".parquet"
    if is_store and (before := finished(out, facts)):
        if request.shown:
            raise ConfigError(
                f"{out} is finished, and flights are shown while they are cleaned",
                expected="a store that is not there yet",
                mend="choose another --out",
            )
        return before
    if not (is_store and out.is_dir()):
        check_output(out)
    try:
        with job_folder(out, facts) as folder:
            return _run(out, request, files, facts, folder, Memory(memory_bytes), engine, say)
    except OSError as error:
        raise DataError(
            f"{out}: {error}", expected="room and permission to write", mend="free or choose a disk"
        ) from error


def _run(
    out: Path,
    request: Request,
    files: Sequence[Path],
    facts: dict[str, Any],
    folder: Path,
    memory: Memory,
    engine: Engine,
    say: Say,
) -> Prepared:
    say("reading rows")
    intake = _read(request, files, folder, memory, engine, say)
    if intake.buckets is None:
        outcome = _in_memory(intake, request, engine.workers, say)
        parts, report = store.Parts.of([outcome.levels.lazy()]), intake.report
        fates = [] if outcome.fates is None else [outcome.fates]
    else:
        if not intake.report.steps[-1].rows_left:
            check_left(intake.report, request.typecodes, {})
        tasks = _clean_partitions(request, intake, folder, memory, engine, say)
        parts, report = store.Parts.of([pl.scan_parquet(task.target) for task in tasks]), intake.report
        _account(request, report, [_described(task.target) for task in tasks])
        fates = [pl.read_parquet(task.fates) for task in tasks if request.shown and task.fates.exists()]
    if parts.flights.is_empty():
        raise _nothing_left(request.cleaning, report)
    metadata = _metadata(facts, report, parts.flights)
    say("writing descents")
    if out.suffix == ".parquet":
        store.write_file(parts, metadata, out)
    else:
        made = folder / "store"
        shutil.rmtree(made, ignore_errors=True)
        store.write_store(parts, {**metadata, "fingerprint": fingerprint(facts)}, made)
        made.replace(out)
    numbers = dict(parts.flights["typecode"].value_counts().sort("typecode").iter_rows())
    return Prepared(metadata, report, numbers, some_flights(pl.concat(fates), request.shown) if fates else None)


def _read(request: Request, files: Sequence[Path], folder: Path, memory: Memory, engine: Engine, say: Say) -> Intake:
    """Rows in memory if they are few, else in buckets."""
    groups = groups_of(files)
    rows = folder / ROWS
    local = isinstance(engine, LocalEngine)
    tasks = [
        Group(group, request.format, rows / f"group-{number:05d}", memory, len(groups) == 1)
        for number, group in enumerate(groups)
    ]
    if local and len(tasks) == 1 and not tasks[0].folder.exists():
        held = read_group(tasks[0], always=False)
        if held is not None:
            return held
    # Readers hold blocks of their own, and Polars reads with all processors: one group at a time on this machine.
    for number, _ in enumerate((LocalEngine(1) if local else engine).run(read_group, tasks, True), 1):
        say(f"reading rows, group {number} of {len(tasks)}")
    intakes = [read_again(task.folder) for task in tasks]
    report = DropReport()
    report.extend([intake.report for intake in intakes])
    return Intake(
        tuple(dict.fromkeys(name for intake in intakes for name in intake.columns)),
        report,
        pl.concat([intake.names for intake in intakes]).unique(),
        [],
        joined([intake.buckets or [] for intake in intakes]),
    )


def _clean_partitions(
    request: Request, intake: Intake, folder: Path, memory: Memory, engine: Engine, say: Say
) -> list[Partition]:
    """Clean partition after partition into files of levels."""
    (folder / PARTS).mkdir(exist_ok=True)
    size = memory.partition_bytes(engine.workers)
    planned = _plan(intake, folder, size, memory)
    tasks = [Partition(files, folder / PARTS / f"{number:05d}.parquet") for number, (files, _) in enumerate(planned)]
    work = request.work(intake)
    large = [task for task, (_, in_memory) in zip(tasks, planned, strict=True) if in_memory > size]
    small = [task for task in tasks if task not in large]
    number = 0
    for runner, some in ((engine, small), (LocalEngine(1) if isinstance(engine, LocalEngine) else engine, large)):
        waiting = [task for task in some if not task.target.exists()]
        number += len(some) - len(waiting)
        if len(waiting) < len(some):
            say(f"going on after {number} of {len(tasks)} parts")
        for _ in runner.run(clean_partition, waiting, work):
            number += 1
            say(f"cleaning rows, part {number} of {len(tasks)}")
    return tasks


def _plan(intake: Intake, folder: Path, size: int, memory: Memory) -> list[tuple[tuple[Path, ...], int]]:
    """Files and size in memory of each partition; as planned before if this is a rerun, whatever the memory now."""
    path = folder / "partitions.json"
    if not path.exists():
        shutil.rmtree(folder / "again", ignore_errors=True)
        planned = [
            {"files": [file.relative_to(folder).as_posix() for file in bucket.files], "bytes": bucket.bytes}
            for bucket in partitions(intake.buckets or [], folder / "again", size, memory.rows_bytes)
        ]
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(planned))
    return [(tuple(folder / name for name in part["files"]), part["bytes"]) for part in json.loads(path.read_text())]


def _in_memory(intake: Intake, request: Request, threads: int, say: Say) -> Outcome:
    """Clean rows that fit in memory, and complete the report."""
    say("telling flights apart")
    rows = pl.concat(intake.held, how="diagonal")
    intake.held.clear()
    outcome = clean(rows, request.work(intake), threads=threads, say=say)
    _account(request, intake.report, [(outcome.report, outcome.present)])
    if outcome.levels.is_empty():
        raise _nothing_left(request.cleaning, intake.report)
    return outcome


def _account(request: Request, report: DropReport, parts: Sequence[tuple[DropReport, dict[str, int]]]) -> None:
    """Add the parts' reports, and refuse rows of which nothing is left."""
    report.extend([part for part, _ in parts])
    present: dict[str, int] = {}
    for _, some in parts:
        for name, number in some.items():
            present[name] = present.get(name, 0) + number
    check_left(report, request.typecodes, present)


def _described(path: Path) -> tuple[DropReport, dict[str, int]]:
    found = json.loads(pl.read_parquet_metadata(path)[KEY])
    return DropReport.from_dict(found["report"]), found["present"]


def _nothing_left(rules: Cleaning, report: DropReport) -> DataError:
    return DataError(
        f"no free descent of {rules.fewest_levels} levels above FL{rules.bottom_fl} is left\n{report}",
        expected="descents of airliners with IAS, Mach and a rate of 500 ft/min or more",
        mend="see which step dropped the rows; a lower --bottom-fl keeps lower descents",
    )


def _metadata(facts: dict[str, Any], report: DropReport, levels: pl.DataFrame) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "descentflow": __version__,
        "bottom_fl": facts["settings"]["bottom_fl"],
        "top_fl": top_levels(levels),
        "settings": facts["settings"],
        "typecodes": facts["typecodes"],
        "inputs": facts["inputs"],
        "report": report.as_dict(),
    }
