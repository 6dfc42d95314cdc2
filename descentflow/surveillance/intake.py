"""The first pass: read rows block by block, drop what no descent can use, and put the rest where aircraft are found."""

import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import polars as pl

from descentflow.surveillance.flights import names_given, usable
from descentflow.surveillance.readers import row_blocks
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.spill import Bucket, Memory, Spill

Item = TypeVar("Item")

GROUP_BYTES = 256_000_000
"""Size of the files that are read as one group: what a worker reads at a time, and what a rerun reads again."""


@dataclass
class Intake:
    """Rows of some files.

    Attributes:
        columns: Of all rows, in the order in which they came up.
        report: Of reading and of unusable rows.
        names: Flight names that the source gives (:func:`~descentflow.surveillance.flights.names_given`).
        held: The rows, if they were few.
        buckets: The rows on disk, if they were many.
    """

    columns: tuple[str, ...]
    report: DropReport
    names: pl.DataFrame
    held: list[pl.DataFrame]
    buckets: list[Bucket] | None


@dataclass(frozen=True)
class Group:
    """Files that are read together into a folder of buckets."""

    files: tuple[Path, ...]
    format: str | None
    folder: Path
    memory: Memory


def groups_of(files: Sequence[Path]) -> list[tuple[Path, ...]]:
    """Neighbouring files in groups of about a size."""
    groups: list[list[Path]] = [[]]
    total = 0
    for path in files:
        if groups[-1] and total + path.stat().st_size > GROUP_BYTES:
            groups.append([])
            total = 0
        groups[-1].append(path)
        total += path.stat().st_size
    return [tuple(group) for group in groups]


def take_in(files: Sequence[Path], format: str | None, spill: Spill, block_rows: int = 500_000) -> Intake:
    """Read files into a spill.

    Raises:
        DataError: As :func:`~descentflow.surveillance.readers.row_blocks`.
    """
    read = DropReport()
    columns: dict[str, None] = {}
    names: list[pl.DataFrame] = []
    parts: list[DropReport] = []
    for block in _ahead(row_blocks(files, read, format=format, block_rows=block_rows)):
        columns |= dict.fromkeys(block.columns)
        parts.append(DropReport())
        good = usable(block, parts[-1])
        names.append(names_given(good))
        if len(names) > 16:
            names = [pl.concat(names).unique()]
        spill.add(good)
    spill.finish()
    read.extend(parts)
    buckets = spill.buckets if spill.spilled else None
    return Intake(tuple(columns), read, pl.concat(names).unique(), spill.held, buckets)


def read_group(group: Group, always: bool) -> Intake | None:
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
        intake = take_in(
            group.files, group.format, Spill(temporary, group.memory.rows_bytes, always=always), group.memory.block_rows
        )
        if intake.buckets is None:
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


def read_again(folder: Path) -> Intake:
    """What :func:`read_group` left in a folder."""
    found = json.loads((folder / "group.json").read_text())
    buckets = [Bucket([folder / name for name in b["files"]], b["rows"], b["bytes"]) for b in found["buckets"]]
    names = pl.read_parquet(folder / "names.parquet")
    return Intake(tuple(found["columns"]), DropReport.from_dict(found["report"]), names, [], buckets)


def _ahead(items: Iterator[Item]) -> Iterator[Item]:
    """The same items, the next made while one is worked on."""
    with ThreadPoolExecutor(max_workers=1) as pool:
        following = pool.submit(next, items, None)
        while (item := following.result()) is not None:
            following = pool.submit(next, items, None)
            yield item
