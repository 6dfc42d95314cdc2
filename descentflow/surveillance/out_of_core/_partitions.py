"""Partitions of whole aircraft on disk: planned, and cleaned one by one on an engine into files of levels."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.files import whole_file, write_whole
from descentflow.core.workers import Engine
from descentflow.surveillance._intake import Intake
from descentflow.surveillance._request import PreparationRequest
from descentflow.surveillance.cleaning.chain import Work, clean
from descentflow.surveillance.descents.store import KEY, ROW_GROUP
from descentflow.surveillance.out_of_core._job import PARTS
from descentflow.surveillance.out_of_core.spill import Bucket, Memory, partitions
from descentflow.surveillance.rows.drop_report import DropReport

DROPPED_ROWS, LEVEL_FLIGHT = "dropped_rows", "level_flight"


@dataclass(frozen=True)
class Partition:
    """Rows of some aircraft in files, and the file that their descents go to.

    Example:
        >>> Partition((Path("rows/00.arrow"),), Path("work/parts/00000.parquet")).beside(DROPPED_ROWS)
        PosixPath('work/dropped_rows/00000.parquet')
    """

    files: tuple[Path, ...]
    target: Path

    def beside(self, kind: str) -> Path:
        """File of the rows of some flights with their reasons, where some are wanted, or of level flight."""
        return self.target.parent.parent / kind / self.target.name


@dataclass(frozen=True)
class Cleaned:
    """Levels of the descents of all rows, the complete report, flights that are shown, and level flight.

    Example:
        >>> cleaned = Cleaned([pl.scan_parquet("descents.parquet")], DropReport(), [], [])
        >>> pl.concat(cleaned.levels).select(pl.col("flight_id").n_unique()).collect().item()
        120
    """

    levels: Sequence[pl.LazyFrame]
    report: DropReport
    dropped_rows: list[pl.DataFrame]
    level_flight: list[pl.DataFrame]


def _clean_partition(partition: Partition, work: Work) -> None:
    """Clean the rows of some aircraft into a file that appears whole; nothing if it is there already.

    The file's metadata hold the report and the number of rows of each type, or of each address where none has a type.
    """
    if partition.target.exists():
        return
    rows = pl.concat([pl.read_ipc(path) for path in partition.files], how="diagonal")
    outcome = clean(rows, work)
    tables = [(DROPPED_ROWS, table) for table in outcome.dropped_rows]
    for kind, table in [*tables, (LEVEL_FLIGHT, outcome.level_flight)]:
        partition.beside(kind).parent.mkdir(exist_ok=True)
        with whole_file(partition.beside(kind)) as temporary:
            table.write_parquet(temporary)
    about = {"report": outcome.report.as_dict(), "present": outcome.present, "untyped": outcome.untyped}
    described = json.dumps(about)
    with whole_file(partition.target) as temporary:
        outcome.levels.write_parquet(temporary, metadata={KEY: described}, compression="lz4", row_group_size=ROW_GROUP)


def clean_partitions(
    request: PreparationRequest,
    intake: Intake,
    buckets: Sequence[Bucket],
    folder: Path,
    memory: Memory,
    engine: Engine,
    progress: Callable[[str], None],
) -> Cleaned:
    """Clean partition after partition into files of levels; those of an earlier run are kept.

    Args:
        request: What is to be prepared.
        intake: Facts of the rows; its report takes the steps of the cleaning.
        buckets: The rows on disk.
        folder: Folder of work.
        memory: Bound on what is held.
        engine: Where partitions are cleaned.
        progress: Progress callback.

    Raises:
        DataError: If one of the shares of aircraft has more rows than fit in memory, or no usable row was left.

    Example:
        >>> from descentflow.surveillance.out_of_core._groups import read_groups
        >>> request, memory, engine = PreparationRequest(["rows.parquet"]), Memory(4_000_000), Engine()
        >>> folder = Path("parts.work")
        >>> intake, _, buckets = read_groups(request, request.files(), folder, memory, engine, lambda stage: None)
        >>> cleaned = clean_partitions(request, intake, buckets, folder, memory, engine, lambda stage: None)
        >>> len(cleaned.levels) > 1, cleaned.report.steps[-1].flights_left
        (True, 120)
    """
    (folder / PARTS).mkdir(exist_ok=True)
    size = memory.partition_bytes(engine.workers)
    planned = _plan(buckets, folder, size, memory)
    tasks = [Partition(files, folder / PARTS / f"{number:05d}.parquet") for number, (files, _) in enumerate(planned)]
    work = request.work(
        intake.columns, intake.names, (pl.read_ipc(path) for bucket in buckets for path in bucket.files)
    )
    large = [task for task, (_, in_memory) in zip(tasks, planned, strict=True) if in_memory > size]
    small = [task for task in tasks if task not in large]
    number = 0
    for runner, some in ((engine, small), (Engine() if engine.shares_memory else engine, large)):
        waiting = [task for task in some if not task.target.exists()]
        number += len(some) - len(waiting)
        if len(waiting) < len(some):
            progress(f"going on after {number} of {len(tasks)} parts")
        for _ in runner.run(_clean_partition, waiting, work, progress):
            number += 1
            progress(f"cleaning rows, part {number} of {len(tasks)}")
    request.account(intake.report, [_described(task.target) for task in tasks])

    def beside(kind: str) -> list[pl.DataFrame]:
        return [pl.read_parquet(task.beside(kind)) for task in tasks if task.beside(kind).exists()]

    shown = beside(DROPPED_ROWS) if request.shown else []
    return Cleaned([pl.scan_parquet(task.target) for task in tasks], intake.report, shown, beside(LEVEL_FLIGHT))


def _plan(buckets: Sequence[Bucket], folder: Path, size: int, memory: Memory) -> list[tuple[tuple[Path, ...], int]]:
    """Files and size in memory of each partition; as planned before if this is a rerun, whatever the memory now."""
    path = folder / "partitions.json"
    if not path.exists():
        planned = [
            {"files": [file.relative_to(folder).as_posix() for file in bucket.files], "bytes": bucket.bytes}
            for bucket in partitions(buckets, size, memory.rows_bytes)
        ]
        write_whole(path, json.dumps(planned))
    return [(tuple(folder / name for name in part["files"]), part["bytes"]) for part in json.loads(path.read_text())]


def _described(path: Path) -> tuple[DropReport, dict[str, int], dict[str, int]]:
    description = json.loads(pl.read_parquet_metadata(path)[KEY])
    return DropReport.from_dict(description["report"]), description["present"], description.get("untyped", {})
