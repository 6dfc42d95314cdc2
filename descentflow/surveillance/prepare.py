"""From rows to prepared descents: every step in its order, every dropped row counted, memory bounded."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.arguments import Count, Output, checked_arguments
from descentflow.core.threads import check_not_forked
from descentflow.core.workers import engine_of
from descentflow.surveillance._intake import clean_held, take_in
from descentflow.surveillance._request import PreparationRequest, description
from descentflow.surveillance.cleaning.thresholds import Cleaning, cleaning_of
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.out_of_core._resumable_run import prepare_to
from descentflow.surveillance.out_of_core.spill import Memory
from descentflow.surveillance.read_rows import read_table, source_of
from descentflow.surveillance.rows._addresses import named_types, types_held
from descentflow.surveillance.rows.airspeed_source import AirspeedSource

__all__ = ["MEMORY_BYTES", "Cleaning", "prepare"]

MEMORY_BYTES = 2_000_000_000


@checked_arguments
def prepare(
    rows: Any,
    *,
    typecode: str | Sequence[str] | None = None,
    types: Any = None,
    bottom_fl: int | None = None,
    cleaning: Cleaning | Mapping[str, Any] | None = None,
    out: Output | None = None,
    format: str | None = None,
    columns: Mapping[str, str] | None = None,
    airspeeds_from: Any = None,
    memory_bytes: Count = MEMORY_BYTES,
    engine: Any = None,
    workers: Count | None = None,
    shown: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Descents:
    """Read rows, clean them to free descents and interpolate those to flight levels (paper, section 3).

    Without `out` all rows and descents are held in memory. With it, memory is bounded whatever the number of rows, and
    a run that was killed is resumed by the same call; the table of the returned descents is read when it is first used.

    Args:
        rows: File, folder or table of rows, or several. A table is one of polars, pandas or Arrow, or flights of
            traffic, in the schema of rows (:data:`descentflow.surveillance.rows.schema.COLUMNS`, or its aliases), or
            what :func:`descentflow.simulation.world.simulate` returned.
        typecode: Type or types to keep, `"A320"`, `"A320,A321"` or `["A320", "A321"]`; all if None.
        types: Table `icao24,typecode`, or `flight_id,typecode`, of polars or pandas, a file of it, or a
            dictionary address -> type, for rows that do not name their type.
        bottom_fl: Lowest flight level of the grid; that of `cleaning` if None.
        cleaning: Thresholds, or some of them by name; the defaults if None.
        out: Parquet file to write (a name that ends in .parquet), or folder for a store of Parquet files by type.
        format: Name of the files' format; recognised from their content if None.
        columns: Name in a row -> column of the rows' tables, for instance `{"altitude": "alt_ft"}`.
        airspeeds_from: Source of wind and temperature, with which rows without IAS and Mach get these from groundspeed
            and track: files or a folder of a weather field on pressure levels (NetCDF, GRIB); or `"columns"` of the
            rows (`u_component_of_wind`, `v_component_of_wind` in m/s, `temperature` in K); or `"neighbours"`, the
            aircraft of the same rows that report theirs. None if rows must have them.
        memory_bytes: Bound on this process, and on each worker, if `out` is given.
        engine: Where partitions are cleaned if `out` is given: threads of this process by default; ``"dask"``, the
            address or the file of a Dask scheduler, or a `distributed.Client`
            (:func:`~descentflow.core.workers.engine_of`).
        workers: Threads, or Dask's workers on this machine; as many as there are processors if absent.
        shown: Number of random flights whose dropped rows are kept in `dropped_rows`; none if 0.
        progress: Progress callback, called with each stage and part.

    Returns:
        The descents with the report of everything dropped (`descents.report`), the thresholds (`descents.cleaning`)
        and level flight (`descents.level_flight`).

    Raises:
        DataError: If the rows cannot be used, or no descent is left.
        ConfigError: If there is no such format or threshold, or the output cannot be written or belongs to another run.

    Example:
        >>> descents = prepare("rows.parquet", typecode="A320")
        >>> print(descents.report)
        step  rows dropped  flights dropped  rows left  flights left
        read             0                         ...
        ...
        >>> prepare("rows.parquet", bottom_fl=200, cleaning={"transient_s": 30.0}).frame["level_fl"].min()
        200
        >>> import polars as pl
        >>> prepare(pl.read_parquet("rows.parquet"), typecode="A320").flights
        {'A320': 120}
    """
    check_not_forked()
    rules = cleaning if isinstance(cleaning, Cleaning) else cleaning_of(cleaning or {}, "cleaning")
    request = PreparationRequest(
        rows=[source_of(one) for one in (rows if isinstance(rows, Sequence) and not isinstance(rows, str) else [rows])],
        types=None if types is None else _types(types),
        typecodes=_typecodes(typecode),
        cleaning=rules if bottom_fl is None else replace(rules, bottom_fl=bottom_fl),
        format=format,
        shown=shown,
        columns=columns or {},
        airspeeds=None if airspeeds_from is None else AirspeedSource.of(airspeeds_from),
    )
    report_progress = progress or (lambda _: None)
    if out is not None:
        return prepare_to(Path(out), request, Memory(memory_bytes), engine_of(engine, workers), report_progress)
    files = request.files()
    report_progress("reading rows")
    held: list[pl.DataFrame] = []
    intake = take_in([*request.tables, *files], request, held.append)
    outcome = clean_held(held, intake, request, engine_of(None, workers).workers, report_progress)
    metadata = description(request.facts(files), intake.report, outcome.levels)
    shown_rows = next(iter(outcome.dropped_rows), None)
    return Descents(outcome.levels, metadata, dropped_rows=shown_rows, level_flight=outcome.level_flight)


def _types(types: Any) -> pl.DataFrame:
    return named_types(read_table(Path(types)), types) if isinstance(types, str | Path) else types_held(types)


def _typecodes(typecode: str | Sequence[str] | None) -> list[str]:
    """Types to keep, none for all."""
    names = typecode.split(",") if isinstance(typecode, str) else typecode or []
    return [name.strip() for name in names]
