"""Rows that fit in memory: cleaned at once, without a folder of work."""

from collections.abc import Callable

import polars as pl

from descentflow.surveillance.cleaning.chain import Outcome, clean
from descentflow.surveillance.cleaning.report_checks import nothing_left
from descentflow.surveillance.out_of_core.intake import Intake
from descentflow.surveillance.request import Request


def clean_held(intake: Intake, request: Request, threads: int, progress: Callable[[str], None]) -> Outcome:
    """Clean rows that are held in memory, and complete the report of the intake.

    Args:
        intake: What was read; its rows are released as soon as they are put together.
        request: What is to be prepared.
        threads: Batches of flights that are cleaned at the same time.
        progress: Progress callback.

    Raises:
        DataError: If no row is usable, or no descent is left.

    Example:
        >>> from descentflow.surveillance.out_of_core.intake import take_in
        >>> from descentflow.surveillance.out_of_core.spill import Spill
        >>> request = Request(["rows.parquet"])
        >>> intake = take_in(request.files(), None, Spill.unbounded())
        >>> clean_held(intake, request, 1, lambda stage: None).levels["flight_id"].n_unique()
        120
    """
    progress("telling flights apart")
    rows = pl.concat(intake.held, how="diagonal")
    intake.held.clear()
    outcome = clean(rows, request.work(intake.columns, intake.names), threads=threads, progress=progress)
    request.account(intake.report, [(outcome.report, outcome.present, outcome.untyped)])
    if outcome.levels.is_empty():
        raise nothing_left(intake.report, request.cleaning)
    return outcome
