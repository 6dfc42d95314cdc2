"""Read rows of every known kind of file, told apart by content, in blocks that fit in memory."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import polars as pl

from descentflow.errors import DataError
from descentflow.surveillance.normalise import normalise
from descentflow.surveillance.report import DropReport
from descentflow.surveillance.sources.formats import ACCEPTED, FORMATS, check_format, read
from descentflow.surveillance.sources.streams import opened
from descentflow.surveillance.units_check import check_units

__all__ = ["FORMATS", "files_of", "read_rows", "read_table", "row_blocks"]

FEWEST_IN_LATER_PARTS = 1000
"""Rows from which units are looked at again in a later part of a file: the first may say nothing, a small one errs."""


def row_blocks(
    paths: Sequence[Path], report: DropReport, *, format: str | None = None, block_rows: int = 500_000
) -> Iterator[pl.DataFrame]:
    """Read files, or all files of folders, one after the other, as rows of the schema.

    Args:
        paths: Files and folders.
        report: Takes the counts of values and files that could not be read.
        format: Name in :data:`FORMATS` of what all the files are; found for each from its content if absent.
        block_rows: About the most rows in a block; memory is bounded by a few times this number.

    Yields:
        Rows with those columns of :data:`descentflow.surveillance.schema.COLUMNS` that the block's files have.

    Raises:
        ConfigError: If there is no such format.
        DataError: If a file cannot be read, is of no known kind, lacks a required column, holds one in a wrong unit,
            or if there is no row.

    Example:
        >>> sum(len(block) for block in row_blocks([embedded_rows()], DropReport()))
        12759
    """
    check_format(format)
    empty = True
    parts = (part for path in files_of(paths) for part in _parts(path, report, format, block_rows))
    for block in _blocks(parts, block_rows):
        empty = False
        yield block
    if empty:
        raise DataError(
            f"no row in {', '.join(str(p) for p in paths)}", expected="surveillance rows", mend="pass other files"
        )


def read_rows(paths: Sequence[Path], report: DropReport, *, format: str | None = None) -> pl.DataFrame:
    """All rows at once; arguments and errors as :func:`row_blocks`."""
    return pl.concat(row_blocks(paths, report, format=format), how="diagonal")


def read_table(path: Path) -> pl.DataFrame:
    """Read one file as it is, with its own column names (snapshots become one row an aircraft)."""
    return pl.concat(_tables(path, DropReport(), None, 1 << 22), how="diagonal")


def _blocks(parts: Iterator[pl.DataFrame], rows: int) -> Iterator[pl.DataFrame]:
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


def _parts(path: Path, report: DropReport, format: str | None, rows: int) -> Iterator[pl.DataFrame]:
    """Normalised rows of one file."""
    for number, table in enumerate(_tables(path, report, format, rows)):
        part = normalise(table, path, report)
        if not number or len(part) >= FEWEST_IN_LATER_PARTS:
            check_units(part, str(path))
        yield part


def _tables(path: Path, report: DropReport, format: str | None, rows: int) -> Iterator[pl.DataFrame]:
    """Tables of one file; what readers do not foresee ends as a DataError that names it."""
    try:
        with opened([path], str(path)) as source:
            yield from read(source, report, format, rows)
    except (pl.exceptions.PolarsError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"{path}: {reason}", expected="a whole, readable file", mend="copy it again") from error


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Files given, and all files of folders given, hidden ones aside."""
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files += sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
        elif path.is_file():
            files.append(path)
        else:
            raise DataError(f"no file or folder {path}", expected=ACCEPTED, mend="check the path")
    if not files:
        raise DataError("no file in the folders given", expected=ACCEPTED, mend="pass files, or folders that hold some")
    return files
