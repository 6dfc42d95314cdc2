"""Rows of any source to usable ones, block by block; and those that are held in memory, to descents."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import polars as pl

from descentflow.core.errors import NoRowsError
from descentflow.surveillance._request import PreparationRequest
from descentflow.surveillance.cleaning._flights import names_given, usable
from descentflow.surveillance.cleaning.chain import Outcome, clean
from descentflow.surveillance.cleaning.drop_report_checks import nothing_left
from descentflow.surveillance.read_rows import Source, row_blocks
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import COLUMNS, REQUIRED

Item = TypeVar("Item")


@dataclass
class Intake:
    """Facts of rows that were read.

    Attributes:
        columns: Of all rows, in the order of their first appearance.
        report: Of reading and of unusable rows.
        names: Flight names of the source (``names_given``).

    Example:
        >>> intake = take_in(["rows.parquet"], PreparationRequest([]), [].append)
        >>> intake.columns[:2], intake.names.height
        (('timestamp', 'icao24'), 120)
    """

    columns: tuple[str, ...]
    report: DropReport
    names: pl.DataFrame


def take_in(
    sources: Sequence[Source],
    request: PreparationRequest,
    keep: Callable[[pl.DataFrame], None],
    block_rows: int = 500_000,
    alone: bool = True,
) -> Intake:
    """Read rows, drop unusable ones, and hand on the rest.

    Args:
        sources: Files, and tables in memory.
        request: What is to be prepared.
        keep: Takes usable rows, block by block.
        block_rows: Rows that are read at a time.
        alone: Whether there are no other files, so that files without a row are an error.

    Raises:
        DataError: As :func:`~descentflow.surveillance.read_rows.row_blocks`.

    Example:
        >>> held = []
        >>> _ = take_in(["rows.parquet"], PreparationRequest([]), held.append, block_rows=10_000)
        >>> [len(block) for block in held]
        [10000, 10000, 3216]
    """
    read = DropReport()
    types: dict[str, None] = {}
    names: list[pl.DataFrame] = []
    parts: list[DropReport] = []
    for block in _ahead(_blocks(sources, read, request, block_rows, alone)):
        types |= dict.fromkeys(block.columns)
        parts.append(DropReport())
        good = usable(block, parts[-1], request.airspeeds.needed if request.airspeeds else ())
        names.append(names_given(good))
        if len(names) > 16:
            names = [pl.concat(names).unique()]
        keep(good)
    read.extend(parts)
    return Intake(tuple(types), read, pl.concat(names).unique())


def clean_held(
    held: list[pl.DataFrame], intake: Intake, request: PreparationRequest, threads: int, progress: Callable[[str], None]
) -> Outcome:
    """Clean rows that are held in memory, and complete the report of the intake.

    Args:
        held: Usable rows; they are released as soon as they are put together.
        intake: Facts of them.
        request: What is to be prepared.
        threads: Batches of flights that are cleaned at the same time.
        progress: Progress callback.

    Raises:
        DataError: If no row is usable, or no descent is left.

    Example:
        >>> request, held = PreparationRequest(["rows.parquet"]), []
        >>> intake = take_in(request.files(), request, held.append)
        >>> clean_held(held, intake, request, 1, lambda stage: None).levels["flight_id"].n_unique()
        120
    """
    progress("telling flights apart")
    rows = pl.concat(held, how="diagonal")
    held.clear()
    outcome = clean(rows, request.work(intake.columns, intake.names, [rows]), threads=threads, progress=progress)
    request.account(intake.report, [(outcome.report, outcome.present, outcome.untyped)])
    if outcome.levels.is_empty():
        raise nothing_left(intake.report, request.cleaning)
    return outcome


def _blocks(
    sources: Sequence[Source], report: DropReport, request: PreparationRequest, block_rows: int, alone: bool
) -> Iterator[pl.DataFrame]:
    """Blocks of rows; an empty one for a group without rows that is one of several."""
    try:
        yield from row_blocks(
            sources,
            report,
            format=request.format,
            block_rows=block_rows,
            columns=request.columns,
            derived=request.airspeeds is not None,
        )
    except NoRowsError:
        if alone:
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
