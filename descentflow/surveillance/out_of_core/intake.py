"""The first pass: read rows block by block, drop unusable ones, and hold the rest or spread it over buckets on disk."""

import itertools
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.workers import Engine
from descentflow.surveillance.cleaning.flights import names_given, usable
from descentflow.surveillance.out_of_core.job import ROWS
from descentflow.surveillance.out_of_core.spill import Bucket, Memory, Spill, joined
from descentflow.surveillance.read_rows import Source, row_blocks
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import COLUMNS, REQUIRED

Item = TypeVar("Item")

GROUP_BYTES = 256_000_000
"""Size of the files that are read as one group: what a worker reads at a time, and what a rerun reads again."""


@dataclass
class Intake:
    """Rows of some files.

    Attributes:
        columns: Of all rows, in the order of their first appearance.
        report: Of reading and of unusable rows.
        names: Flight names of the source (:func:`~descentflow.surveillance.cleaning.flights.names_given`).
        held: The rows, if they fit in memory.
        buckets: The rows on disk, if they do not; else empty.

    Example:
        >>> intake = take_in(["rows.parquet"], None, Spill.unbounded())
        >>> intake.columns[:2], intake.names.height, intake.buckets
        (('timestamp', 'icao24'), 120, [])
    """

    columns: tuple[str, ...]
    report: DropReport
    names: pl.DataFrame
    held: list[pl.DataFrame]
    buckets: list[Bucket]


@dataclass(frozen=True)
class _Group:
    """Files that are read together into a folder of buckets."""

    files: tuple[Path, ...]
    format: str | None
    folder: Path
    memory: Memory
    columns: Mapping[str, str] | None = None
    alone: bool = True
    """True if it is the only group: then it is an error if it has no row."""


def groups_of(files: Sequence[Path]) -> list[tuple[Path, ...]]:
    """Neighbouring files in groups of about equal size.

    A small file is not a group of its own: in a group a damaged file is counted, alone it would be an error.

    Example:
        >>> [len(group) for group in groups_of([Path("rows.parquet"), Path("descents.parquet")])]
        [2]
    """
    ends = itertools.accumulate(path.stat().st_size for path in files)
    numbered = itertools.groupby(zip(ends, files, strict=True), key=lambda one: one[0] // GROUP_BYTES)
    groups = [[path for _, path in some] for _, some in numbered]
    together: list[list[Path]] = []
    for group in groups:
        if together and len(group) == 1 and group[0].stat().st_size < GROUP_BYTES // 2:
            together[-1] += group
        else:
            together.append(group)
    return [tuple(group) for group in together]


def take_in(
    sources: Sequence[Source],
    format: str | None,
    spill: Spill,
    block_rows: int = 500_000,
    alone: bool = True,
    columns: Mapping[str, str] | None = None,
) -> Intake:
    """Read rows into a spill.

    Args:
        sources: Files, and tables in memory.
        format: Name of the files' format; recognised from their content if None.
        spill: Takes the rows.
        block_rows: Rows that are read at a time.
        alone: Whether there are no other files, so that files without a row are an error.
        columns: Name in a row -> column of the files, where it has another name there.

    Raises:
        DataError: As :func:`~descentflow.surveillance.read_rows.row_blocks`.

    Example:
        >>> intake = take_in(["rows.parquet"], None, Spill.unbounded(), block_rows=10_000)
        >>> [len(block) for block in intake.held]
        [10000, 10000, 3216]
    """
    read = DropReport()
    found: dict[str, None] = {}
    names: list[pl.DataFrame] = []
    parts: list[DropReport] = []
    for block in _ahead(_blocks(sources, read, format, block_rows, alone, columns)):
        found |= dict.fromkeys(block.columns)
        parts.append(DropReport())
        good = usable(block, parts[-1])
        names.append(names_given(good))
        if len(names) > 16:
            names = [pl.concat(names).unique()]
        spill.add(good)
    spill.finish()
    read.extend(parts)
    buckets = spill.buckets if spill.spilled else []
    return Intake(tuple(found), read, pl.concat(names).unique(), spill.held, buckets)


def _read_group(group: _Group, always: bool) -> Intake | None:
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
        intake = take_in(group.files, group.format, spill, group.memory.block_rows, group.alone, group.columns)
        if not intake.buckets:
            return intake
        intake.names.write_parquet(temporary / "names.parquet")
        description = {
            "columns": intake.columns,
            "report": intake.report.as_dict(),
            "buckets": [
                {"files": [path.name for path in b.files], "rows": b.rows, "bytes": b.bytes} for b in intake.buckets
            ],
        }
        (temporary / "group.json").write_text(json.dumps(description))
        if not group.folder.exists():  # another worker may have been as fast
            temporary.rename(group.folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return None


def read_groups(
    files: Sequence[Path],
    format: str | None,
    folder: Path,
    memory: Memory,
    engine: Engine,
    progress: Callable[[str], None],
    columns: Mapping[str, str] | None = None,
) -> Intake:
    """Read all files, group by group: into memory if the rows are few, else into buckets.

    Args:
        files: What to read.
        format: Name of their format; recognised from their content if None.
        folder: Where buckets go; groups that an earlier run has read are not read again.
        memory: Bound on what is held.
        engine: Where groups are read.
        progress: Progress callback.
        columns: Name in a row -> column of the files, where it has another name there.

    Raises:
        DataError: As :func:`~descentflow.surveillance.read_rows.row_blocks`.

    Example:
        >>> files, memory = [Path("rows.parquet")], Memory(4_000_000)
        >>> intake = read_groups(files, None, Path("groups.work"), memory, Engine(), lambda stage: None)
        >>> sum(bucket.rows for bucket in intake.buckets)
        23216
    """
    groups = groups_of(files)
    tasks = [
        _Group(group, format, folder / ROWS / f"group-{number:05d}", memory, columns, len(groups) == 1)
        for number, group in enumerate(groups)
    ]
    if engine.shares_memory and len(tasks) == 1 and not tasks[0].folder.exists():
        held = _read_group(tasks[0], always=False)
        if held is not None:
            return held
    # Readers hold blocks of their own, and Polars reads with all processors: one group at a time on this machine.
    one_by_one = Engine() if engine.shares_memory else engine
    for number, _ in enumerate(one_by_one.run(_read_group, tasks, True, progress), 1):
        progress(f"reading rows, group {number} of {len(tasks)}")
    intakes = [_read_again(task.folder) for task in tasks]
    report = DropReport()
    report.extend([intake.report for intake in intakes])
    return Intake(
        tuple(dict.fromkeys(name for intake in intakes for name in intake.columns)),
        report,
        pl.concat([intake.names for intake in intakes]).unique(),
        [],
        joined([intake.buckets for intake in intakes]),
    )


def _read_again(folder: Path) -> Intake:
    """Result that :func:`_read_group` left in a folder."""
    found = json.loads((folder / "group.json").read_text())
    buckets = [Bucket([folder / name for name in b["files"]], b["rows"], b["bytes"]) for b in found["buckets"]]
    names = pl.read_parquet(folder / "names.parquet")
    return Intake(tuple(found["columns"]), DropReport.from_dict(found["report"]), names, [], buckets)


def _blocks(
    sources: Sequence[Source],
    report: DropReport,
    format: str | None,
    block_rows: int,
    alone: bool,
    columns: Mapping[str, str] | None,
) -> Iterator[pl.DataFrame]:
    """Blocks of rows; an empty one for a group without rows that is one of several."""
    try:
        yield from row_blocks(sources, report, format=format, block_rows=block_rows, columns=columns)
    except DataError as error:
        if alone or not error.got.startswith("no row in "):
            raise
        report.note("groups of files without a row", 1)
        yield pl.DataFrame(schema={name: COLUMNS[name] for name in REQUIRED})


def _ahead(items: Iterator[Item]) -> Iterator[Item]:
    """The same items; the next is made in a thread while one is processed."""
    with ThreadPoolExecutor(max_workers=1) as pool:
        following = pool.submit(next, items, None)
        while (item := following.result()) is not None:
            following = pool.submit(next, items, None)
            yield item
