"""From paths, or tables in memory, to blocks of rows in one schema: a row's way through reading, stage by stage."""

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, NoRowsError
from descentflow.core.tabular import held_table, is_pandas
from descentflow.surveillance.formats._known_formats import (
    ACCEPTED,
    RowBlock,
    check_format,
    held_parts,
    put_together,
    recognised,
)
from descentflow.surveillance.rows._column_names import note_unused, row_names, with_folders, with_named
from descentflow.surveillance.rows._normalise import is_list_of_types, normalise, wanted
from descentflow.surveillance.rows._placeholder_values import without_placeholder_values
from descentflow.surveillance.rows._units_check import check_ground_vector, check_units
from descentflow.surveillance.rows._values_of_other_rows import with_values_of_other_rows
from descentflow.surveillance.rows.air_data import MACH_MISSING, mach_reported, reports_airspeeds, with_ias, with_mach
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import AIRSPEEDS
from descentflow.surveillance.unpacking import Input, Unreadable, files_of, inputs, opened, unpacked

LISTS_OF_TYPES = "rows of lists of types (icao24, typecode), which are no surveillance rows"
"""Name in the report of tables that only list the types of aircraft."""
WITHOUT_ROWS = "tables without a row"
"""Name in the report of tables that have columns and no row."""
MIN_IN_LATER_PARTS = 1000
"""Rows from which units are checked again in a later part of a file: the first may say nothing, a small one errs."""

Source = str | Path | pl.DataFrame
"""A file, a folder, or a table in memory."""


def row_blocks(
    sources: Sequence[Source],
    report: DropReport,
    *,
    format: str | None = None,
    block_rows: int = 500_000,
    columns: Mapping[str, str] | None = None,
    derived: bool = False,
) -> Iterator[pl.DataFrame]:
    """Read files, archives, all files of folders, and tables in memory, one after the other, as rows of the schema.

    Args:
        sources: Files, folders and tables.
        report: Takes the counts of values and files that could not be read.
        format: Name in ``FORMATS`` of what all the files are;
            recognised for each from its content if None.
        block_rows: About the most rows in a block; memory is bounded by a few times this number.
        columns: Name in a row -> column of the tables, where it has another name there.
        derived: Whether rows may have groundspeed and track in place of airspeeds.

    Yields:
        Rows with those columns of :data:`descentflow.surveillance.rows.schema.COLUMNS` that the block's files have.

    Raises:
        ConfigError: If there is no such format.
        DataError: If a file cannot be read, is of no known format, lacks a required column, holds one in a wrong unit,
            or if there is no row. Among the members of archives and in trees of traces a file that cannot be read is
            counted instead, as long as there is one that can.

    Example:
        >>> sum(len(block) for block in row_blocks(["rows.parquet"], DropReport()))
        23216
    """
    check_format(format)
    if block_rows < 1:
        raise ConfigError(f"blocks of {block_rows} rows", expected="1 or more", mend="pass another number")
    unreadable = Unreadable(report)
    empty = True
    # Closed at the end, so that an error leaves no file open.
    with closing(_opened(sources, report, unreadable)) as opened_sources:
        named = (*(columns or {}).values(), *(AIRSPEEDS if derived else ()))
        parts = _parts(opened_sources, report, unreadable, format, block_rows, named)
        tables = put_together(parts, report, block_rows)
        rows = _normalised(tables, report, columns or {}, derived)
        for block in _even_blocks(rows, block_rows):
            empty = False
            yield block
    if empty:
        names = ", ".join(TABLE_IN_MEMORY if isinstance(source, pl.DataFrame) else str(source) for source in sources)
        lists = LISTS_OF_TYPES in report.notes
        raise unreadable.first_error or NoRowsError(
            f"no row in {names}" + (", but a list of types (icao24, typecode)" if lists else ""),
            expected="surveillance rows",
            mend="pass the rows, and the list as --types" if lists else "pass other files",
        )


def read_rows(sources: Sequence[Source], report: DropReport, *, format: str | None = None) -> pl.DataFrame:
    """All rows at once; arguments and errors as :func:`row_blocks`."""
    return pl.concat(row_blocks(sources, report, format=format), how="diagonal")


def read_table(path: Path) -> pl.DataFrame:
    """Read one file as it is, with its own column names (snapshots become one row per aircraft)."""
    report = DropReport()
    with opened(path) as source:
        parts = _parts(iter([source]), report, Unreadable(report), None, 1 << 22)
        tables: list[pl.DataFrame] = [table.rows for table in put_together(parts, report, 1)]
    return pl.concat(tables, how="diagonal")


def source_of(rows: Any) -> Source:
    """A path as it is, a table in memory as one of polars, and the rows of simulated flights.

    Raises:
        ConfigError: If it is neither.

    Example:
        >>> source_of(pl.DataFrame({"IAS": [250.0]}).lazy()).shape
        (1, 1)
    """
    if isinstance(rows, str | Path | pl.DataFrame):
        return rows
    # What descentflow.simulate returned has them as `rows`; this folder knows nothing of it.
    for table in (held_table(_with_times(rows)), getattr(rows, "rows", None)):
        if isinstance(table, pl.DataFrame):
            return table
    raise ConfigError(
        f"rows of type {type(rows).__name__}",
        expected="paths, tables of polars, pandas, Arrow or traffic, or what descentflow.simulate returned",
        mend="write the rows to a file, or make a table of them",
    )


def _with_times(table: Any) -> Any:
    """A table of pandas by nameless times, as `timestamp`, unless it has times as well; anything else as it is."""
    if not is_pandas(table) or table.index.name is not None or getattr(table.index.dtype, "kind", "") != "M":
        return table
    has_times = "timestamp" in row_names([str(name) for name in table.columns]).values()
    return table if has_times else table.rename_axis("timestamp")


TABLE_IN_MEMORY = "a table in memory"
"""Its name in messages."""


def _opened(
    sources: Sequence[Source], report: DropReport, unreadable: Unreadable
) -> Generator[Input | pl.DataFrame, None, None]:
    """Tables as they are, files and members of archives as streams."""
    yield from (source for source in sources if isinstance(source, pl.DataFrame))
    paths = [source for source in sources if not isinstance(source, pl.DataFrame)]
    if paths or not sources:
        yield from inputs(files_of(paths, ACCEPTED), report, unreadable)


def _parts(
    sources: Iterator[Input | pl.DataFrame],
    report: DropReport,
    unreadable: Unreadable,
    format: str | None,
    block_rows: int,
    named: tuple[str, ...] = (),
) -> Iterator[RowBlock]:
    """Rows of each source in its format, in parts; files that cannot be read are left to `unreadable`."""
    for source in sources:
        if isinstance(source, pl.DataFrame):
            known, parts = held_parts(source, TABLE_IN_MEMORY, report, block_rows, named)
            yield from (RowBlock(rows, known, TABLE_IN_MEMORY, number == 0) for number, rows in enumerate(parts))
            continue
        with unreadable.watch(source):
            known, parts = recognised(replace(unpacked(source), columns=named), report, format, block_rows)
            for number, rows in enumerate(parts):
                yield RowBlock(rows, known, source.label, number == 0)


def _normalised(
    tables: Iterator[RowBlock], report: DropReport, columns: Mapping[str, str], derived: bool
) -> Iterator[pl.DataFrame]:
    """Rows in our names, types and units; names and units of tables that anybody may have made are checked.

    A folder of rows often holds the list of their types (`--types`), which has none: it is counted and left out.
    """
    for table in tables:
        if not table.format.any_columns:
            rows = normalise(table.rows, table.label, report, derived)
            yield rows if "Mach" in rows.columns else with_mach(rows, report)
            continue
        given = with_named(with_folders(table.rows, table.label), columns, table.label, report)
        if is_list_of_types(given.columns):
            report.note(LISTS_OF_TYPES, len(given))
            continue
        used = wanted(given.columns, AIRSPEEDS if derived else ())
        note_unused([name for name in given.columns if name not in used], len(given), report)
        report.note(WITHOUT_ROWS, int(table.first and given.is_empty() and table.label != TABLE_IN_MEMORY))
        own = with_values_of_other_rows(normalise(given, table.label, report, derived), report)
        own = without_placeholder_values(own, table.label, report)
        if derived and not reports_airspeeds(own):
            if table.first or len(own) >= MIN_IN_LATER_PARTS:
                check_ground_vector(own, table.label)
            yield own
            continue
        rows = with_ias(own, report)
        computed = rows is not own
        reported = mach_reported(rows)
        # An empty column is none: IAS cannot be checked against it.
        rows = rows if reported else rows.drop("Mach", strict=False)
        if table.first or len(rows) >= MIN_IN_LATER_PARTS:
            # A computed IAS proves nothing of Mach.
            check_units(rows.drop("Mach", strict=False) if computed else rows, table.label)
        yield with_mach(rows, report) if derived or reported < MACH_MISSING else rows


def _even_blocks(tables: Iterator[pl.DataFrame], block_rows: int) -> Iterator[pl.DataFrame]:
    """Tables joined where they are small and divided where they are large."""
    waiting: list[pl.DataFrame] = []
    count = 0
    for table in tables:
        for piece in table.iter_slices(block_rows):
            if count and count + len(piece) > block_rows:
                yield pl.concat(waiting, how="diagonal")
                waiting, count = [], 0
            waiting.append(piece)
            count += len(piece)
    if count:
        yield pl.concat(waiting, how="diagonal")
