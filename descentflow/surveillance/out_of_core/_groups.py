"""Files in groups, each read into a folder of buckets on disk; rows that fit in memory are held."""

import itertools
import json
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.workers import Engine
from descentflow.surveillance._intake import Intake, take_in
from descentflow.surveillance._request import PreparationRequest
from descentflow.surveillance.out_of_core._job import ROWS
from descentflow.surveillance.out_of_core.spill import Bucket, Memory, Spill, joined
from descentflow.surveillance.rows.drop_report import DropReport

GROUP_BYTES = 256_000_000
"""Size of the files that are read as one group: what a worker reads at a time, and what a rerun reads again."""


@dataclass(frozen=True)
class _Group:
    """Files that are read together into a folder of buckets."""

    files: tuple[Path, ...]
    folder: Path
    request: PreparationRequest
    memory: Memory
    alone: bool
    """True if it is the only group: then it is an error if it has no row."""


def groups_of(files: Sequence[Path]) -> list[tuple[Path, ...]]:
    """Neighbouring files in groups of about equal size.

    A small file is not a group of its own: in a group a damaged file is counted, alone it would be an error.

    Example:
        >>> [len(group) for group in groups_of([Path("rows.parquet"), Path("descents.parquet")])]
        [2]
    """
    ends = itertools.accumulate(path.stat().st_size for path in files)
    numbered = itertools.groupby(zip(ends, files, strict=True), key=lambda numbered: numbered[0] // GROUP_BYTES)
    groups = [[path for _, path in some] for _, some in numbered]
    together: list[list[Path]] = []
    for group in groups:
        if together and len(group) == 1 and group[0].stat().st_size < GROUP_BYTES // 2:
            together[-1] += group
        else:
            together.append(group)
    return [tuple(group) for group in together]


def _read_group(group: _Group, always: bool) -> tuple[Intake, list[pl.DataFrame]] | None:
    """Read a group of files into its folder, which appears whole or not at all; nothing if it is there already.

    Args:
        group: Files and folder.
        always: Make the folder even of rows that fit in memory.

    Returns:
        The rows, if they fit and no folder was made of them.
    """
    if group.folder.exists():
        return None
    group.folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=group.folder.parent, prefix=f".{group.folder.name}-"))
    try:
        spill = Spill(temporary, group.memory.rows_bytes, always=always)
        intake = take_in(group.files, group.request, spill.add, group.memory.block_rows, group.alone)
        spill.finish()
        if not spill.spilled:
            return intake, spill.held
        intake.names.write_parquet(temporary / "names.parquet")
        description = {
            "columns": intake.columns,
            "report": intake.report.as_dict(),
            "buckets": [
                {"files": [path.name for path in b.files], "rows": b.rows, "bytes": b.bytes} for b in spill.buckets
            ],
        }
        (temporary / "group.json").write_text(json.dumps(description))
        if not group.folder.exists():  # another worker may have been as fast
            temporary.rename(group.folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return None


def read_groups(
    request: PreparationRequest,
    files: Sequence[Path],
    folder: Path,
    memory: Memory,
    engine: Engine,
    progress: Callable[[str], None],
) -> tuple[Intake, list[pl.DataFrame], list[Bucket]]:
    """Read all files, group by group.

    Args:
        request: What is to be prepared.
        files: What to read.
        folder: Where buckets go; groups that an earlier run has read are not read again.
        memory: Bound on what is held.
        engine: Where groups are read.
        progress: Progress callback.

    Returns:
        Facts of the rows, and these: held in memory if they are few, else in buckets.

    Raises:
        DataError: As :func:`~descentflow.surveillance.read_rows.row_blocks`.

    Example:
        >>> files, memory, engine = [Path("rows.parquet")], Memory(4_000_000), Engine()
        >>> request, folder = PreparationRequest([]), Path("groups.work")
        >>> _, _, buckets = read_groups(request, files, folder, memory, engine, lambda stage: None)
        >>> sum(bucket.rows for bucket in buckets)
        23216
    """
    groups = groups_of(files)
    tasks = [
        _Group(group, folder / ROWS / f"group-{number:05d}", request, memory, len(groups) == 1)
        for number, group in enumerate(groups)
    ]
    if engine.shares_memory and len(tasks) == 1 and not tasks[0].folder.exists():
        held = _read_group(tasks[0], always=False)
        if held is not None:
            return *held, []
    # Readers hold blocks of their own, and Polars reads with all processors: one group at a time on this machine.
    one_by_one = Engine() if engine.shares_memory else engine
    for number, _ in enumerate(one_by_one.run(_read_group, tasks, True, progress), 1):
        progress(f"reading rows, group {number} of {len(tasks)}")
    intakes, buckets = zip(*(_read_again(task.folder) for task in tasks), strict=True)
    report = DropReport()
    report.extend([intake.report for intake in intakes])
    columns = tuple(dict.fromkeys(name for intake in intakes for name in intake.columns))
    return Intake(columns, report, pl.concat([intake.names for intake in intakes]).unique()), [], joined(buckets)


def _read_again(folder: Path) -> tuple[Intake, list[Bucket]]:
    """Result that :func:`_read_group` left in a folder."""
    left = json.loads((folder / "group.json").read_text())
    buckets = [Bucket([folder / name for name in b["files"]], b["rows"], b["bytes"]) for b in left["buckets"]]
    names = pl.read_parquet(folder / "names.parquet")
    return Intake(tuple(left["columns"]), DropReport.from_dict(left["report"]), names), buckets
