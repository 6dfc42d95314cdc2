"""Read rows of every known kind of file, told apart by content, in blocks that fit in memory."""

import gc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tarfile import TarError

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.formats.archives import COMPANION, is_tar, members, with_parts
from descentflow.surveillance.formats.detection import (
    ACCEPTED,
    FORMATS,
    OF_ANYBODY,
    Rows,
    belongs,
    check_format,
    put_together,
    recognised,
)
from descentflow.surveillance.formats.streams import Input, opened, unpacked
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.normalise import normalise
from descentflow.surveillance.rows.units_check import check_units

__all__ = ["FORMATS", "files_of", "read_rows", "read_table", "row_blocks"]

FEWEST_IN_LATER_PARTS = 1000
"""Rows from which units are looked at again in a later part of a file: the first may say nothing, a small one errs."""


def row_blocks(
    paths: Sequence[str | Path], report: DropReport, *, format: str | None = None, block_rows: int = 500_000
) -> Iterator[pl.DataFrame]:
    """Read files, archives, or all files of folders, one after the other, as rows of the schema.

    Args:
        paths: Files and folders.
        report: Takes the counts of values and files that could not be read.
        format: Name in :data:`FORMATS` of what all the files are; found for each from its content if absent.
        block_rows: About the most rows in a block; memory is bounded by a few times this number.

    Yields:
        Rows with those columns of :data:`descentflow.surveillance.rows.schema.COLUMNS` that the block's files have.

    Raises:
        ConfigError: If there is no such format.
        DataError: If a file cannot be read, is of no known kind, lacks a required column, holds one in a wrong unit,
            or if there is no row. Among the members of archives and in trees of traces a file that cannot be read is
            counted instead, as long as there is one that can.

    Example:
        >>> sum(len(block) for block in row_blocks([embedded_rows()], DropReport()))
        12759
    """
    check_format(format)
    if block_rows < 1:
        raise ConfigError(f"blocks of {block_rows} rows", expected="1 or more", mend="pass another number")
    reading = _Reading(report, format, block_rows)
    empty = True
    for block in _without_cycle_search(_joined(reading.parts(paths), block_rows)):
        empty = False
        yield block
    if empty:
        raise reading.first_error or DataError(
            f"no row in {', '.join(str(p) for p in paths)}", expected="surveillance rows", mend="pass other files"
        )


def read_rows(paths: Sequence[str | Path], report: DropReport, *, format: str | None = None) -> pl.DataFrame:
    """All rows at once; arguments and errors as :func:`row_blocks`."""
    return pl.concat(row_blocks(paths, report, format=format), how="diagonal")


def read_table(path: Path) -> pl.DataFrame:
    """Read one file as it is, with its own column names (snapshots become one row an aircraft)."""
    reading = _Reading(DropReport(), None, 1 << 22)
    with opened([path], str(path)) as source:
        tables = [put_together([part], reading.report) for _, part in reading.tables(source)]
    return pl.concat(tables, how="diagonal")


@dataclass
class _Reading:
    """What reading of one set of paths shares."""

    report: DropReport
    format: str | None
    rows: int
    first_error: DataError | None = None
    _waiting: list[Rows] = field(default_factory=list)
    _label: str = ""

    def parts(self, paths: Sequence[str | Path]) -> Iterator[pl.DataFrame]:
        """Normalised rows.

        Names and units of tables are looked at file by file. Those of other formats are laid down, and their files are
        small and many: they are put together first.
        """
        for source in self._inputs(paths):
            for number, (kind, part) in enumerate(self.tables(source)):
                if kind in OF_ANYBODY or not belongs(part, self._waiting, self.rows):
                    yield from self._of_waiting()
                if kind in OF_ANYBODY:
                    yield self._checked(put_together([part], self.report), source.label, later=number > 0)
                else:
                    self._label = self._label or source.label
                    self._waiting.append(part)
        yield from self._of_waiting()

    def _of_waiting(self) -> Iterator[pl.DataFrame]:
        if self._waiting:
            table, label = put_together(self._waiting, self.report), self._label
            self._waiting, self._label = [], ""
            yield normalise(table, label, self.report)

    def _checked(self, table: pl.DataFrame, label: str, *, later: bool) -> pl.DataFrame:
        rows = normalise(table, label, self.report)
        if not later or len(rows) >= FEWEST_IN_LATER_PARTS:
            check_units(rows, label)
        return rows

    def tables(self, source: Input) -> Iterator[tuple[str, Rows]]:
        """Format and tables of one file; what readers do not foresee ends as a DataError that names it."""
        try:
            try:
                kind, found = recognised(unpacked(source), self.report, self.format, self.rows)
                for table in found:
                    yield kind, table
            except (pl.exceptions.PolarsError, OSError, TarError) as error:
                raise _unreadable(source.label, error) from error
            except BaseException as error:
                # Polars and the decoder of Mode S panic on some damage; this is no Exception.
                if type(error).__name__ != "PanicException":
                    raise
                raise _unreadable(source.label, error) from error
        except DataError as error:
            self._count(error, source)

    def _count(self, error: DataError, source: Input) -> None:
        """Count a file that cannot be read as long as it is one of many."""
        if not source.one_of_many:
            raise error
        self.first_error = self.first_error or error
        self.report.note("traces and members of archives that could not be read", 1)

    def _inputs(self, paths: Sequence[str | Path]) -> Iterator[Input]:
        """Files, and the members of those that are archives."""
        files = with_parts(files_of(paths))
        for label, parts in files:
            with opened(parts, label) as source:
                of_tree = len(files) > 1 and parts[0].name.startswith("trace_full_")
                source = replace(source, one_of_many=of_tree)
                try:
                    head, whole = unpacked(source).head()
                except DataError as error:
                    self._count(error, source)
                    continue
                if is_tar(head):
                    yield from members(whole, self.report)
                else:
                    yield whole


def _unreadable(label: str, error: BaseException) -> DataError:
    reason = (str(error).splitlines() or [type(error).__name__])[0][:300]
    return DataError(f"{label}: {reason}", expected="a whole, readable file", mend="copy it again")


def _without_cycle_search(blocks: Iterator[pl.DataFrame]) -> Iterator[pl.DataFrame]:
    """The same blocks; while one is made, Python does not look for cycles of references.

    JSON makes many objects and no cycles among them, and the search would take as long as the reading.
    """
    while True:
        before = gc.isenabled()
        gc.disable()
        try:
            block = next(blocks, None)
        finally:
            if before:
                gc.enable()
        if block is None:
            return
        yield block


def _joined(parts: Iterator[pl.DataFrame], rows: int) -> Iterator[pl.DataFrame]:
    """Parts joined where they are small and divided where they are large."""
    waiting: list[pl.DataFrame] = []
    count = 0
    for part in parts:
        for piece in part.iter_slices(rows):
            if count and count + len(piece) > rows:
                yield pl.concat(waiting, how="diagonal")
                waiting, count = [], 0
            waiting.append(piece)
            count += len(piece)
    if count:
        yield pl.concat(waiting, how="diagonal")


def files_of(paths: Sequence[str | Path]) -> list[Path]:
    """Files given, and all files of folders given, hidden ones and what published trees hold beside rows aside."""
    files: list[Path] = []
    # A single name is a sequence, too: of letters.
    for path in map(Path, [paths] if isinstance(paths, str) else paths):
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
            files += [p for p in inside if not COMPANION.search(p.relative_to(path).as_posix())]
        elif path.is_file():
            files.append(path)
        else:
            raise DataError(f"no file or folder {path}", expected=ACCEPTED, mend="check the path")
    if not files:
        raise DataError("no file in the folders given", expected=ACCEPTED, mend="pass files, or folders that hold some")
    return files
