"""Rows of whole aircraft to levels of free descents: the filters in their order, on any part of the data."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from joblib import Parallel, delayed

from descentflow.core.workers import results_of
from descentflow.surveillance.cleaning import _descent_filters, _faulty_values, filters
from descentflow.surveillance.cleaning._derived_airspeeds import with_airspeeds
from descentflow.surveillance.cleaning._descent_filters import ClearedSpeed
from descentflow.surveillance.cleaning._faulty_values import Stale
from descentflow.surveillance.cleaning._flights import (
    PART_OF,
    in_order,
    name_flights,
    named_as_before,
    of_types,
    rows_by_address,
    typed_by_flight,
    with_types,
)
from descentflow.surveillance.cleaning._level_grid import to_levels
from descentflow.surveillance.cleaning._sparse_reports import with_values_between
from descentflow.surveillance.cleaning._two_clocks import check_one_clock, without_other_clocks
from descentflow.surveillance.cleaning.idle import IdleOnly, with_power
from descentflow.surveillance.cleaning.level_flight import SPEEDS, note_level_flight, stretches
from descentflow.surveillance.cleaning.rates import ConstantRate, with_rate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.airspeed_source import AirspeedSource
from descentflow.surveillance.rows.drop_report import ROW_NUMBER, DropReport, TracedReport, some_flights
from descentflow.surveillance.rows.schema import COLUMNS

BATCH_ROWS = 250_000
"""Rows that are cleaned at a time: their arrays stay in the processor's cache."""
COLUMNS_OF_ALL_FILTERS = ("flight_id", "timestamp", "altitude", "vertical_rate", "IAS", "Mach")
"""Columns that all filters use."""
DIFFERENCED = "rows whose vertical rate is differenced from altitude, for none is reported"
"""Note in the report."""


@dataclass(frozen=True)
class Work:
    """Work on the rows of any aircraft; known when all rows have been read.

    Attributes:
        rules: Thresholds.
        columns: Of all rows, in order; rows of some aircraft may lack some.
        shared: Flight names that several aircraft have.
        typecodes: Types to keep; all if empty.
        types: Table `icao24,typecode` for rows that do not name their type.
        shown: Number of random flights whose rows are wanted with the reason for which each was dropped; none if 0.
        airspeeds: Source of wind and temperature for rows without airspeeds, which else are not usable.
        seen: Observations of all aircraft, where these are the source.
    """

    rules: Cleaning
    columns: tuple[str, ...]
    shared: tuple[str, ...] = ()
    typecodes: tuple[str, ...] = ()
    types: pl.DataFrame | None = None
    shown: int = 0
    airspeeds: AirspeedSource | None = None
    seen: pl.DataFrame | None = None


@dataclass
class Outcome:
    """Levels of the descents of some aircraft, sorted by flight and falling level, and the drop report."""

    levels: pl.DataFrame
    report: DropReport
    present: dict[str, int] = field(default_factory=dict)
    """Number of rows per type, if only some types are kept."""
    untyped: dict[str, int] = field(default_factory=dict)
    """Number of rows per address, if a table of types names none of these."""
    dropped_rows: list[pl.DataFrame] = field(default_factory=list)
    """Rows of some flights with the reason for which each was dropped, where they are wanted: one table
    (:func:`~descentflow.surveillance.rows.drop_report.some_flights`)."""
    level_flight: pl.DataFrame = field(default_factory=pl.DataFrame)
    """Level flight and held rates in descents (:func:`~descentflow.surveillance.cleaning.level_flight.stretches`), with
    types."""


def clean(
    rows: pl.DataFrame, work: Work, *, threads: int = 1, progress: Callable[[str], None] | None = None
) -> Outcome:
    """Clean all rows of some aircraft (paper, section 3).

    Args:
        rows: Usable rows (``usable``) in any order.
        work: What is done with them.
        threads: Number of batches of flights cleaned at the same time (Polars and NumPy release the interpreter).
        progress: Progress callback, called after every batch.

    Example:
        >>> from descentflow.surveillance.read_rows import read_rows
        >>> rows = read_rows(["rows.parquet"], DropReport())
        >>> clean(rows, Work(Cleaning(), tuple(rows.columns))).levels["flight_id"].n_unique()
        120
    """
    report = DropReport()
    rows = rows.select(
        pl.col(name) if name in rows.columns else pl.lit(None, COLUMNS[name]).alias(name) for name in work.columns
    )
    check_one_clock(rows)
    shared = pl.Series(work.shared, dtype=pl.String)
    gap_s = work.rules.flight_gap_s
    rows = without_other_clocks(in_order(rows, report), gap_s, report)
    types = work.types
    if types is not None and "icao24" not in types.columns:
        rows, types = typed_by_flight(rows, types), None
    rows = name_flights(rows, gap_s, shared, report)
    silences = rows.select("flight_id", PART_OF).drop_nulls().unique() if PART_OF in rows.columns else None
    rows = rows.drop(PART_OF, strict=False)
    report.by_flight = True
    report.count("flights_separated", rows, rows)
    typed = with_types(rows, types, report)
    rows = of_types(typed, work.typecodes, report)
    present = dict(typed["typecode"].drop_nulls().value_counts().iter_rows()) if work.typecodes else {}
    untyped = rows_by_address(typed) if types is not None and not report.left("unknown_type") else {}
    del typed
    if work.airspeeds:
        rows = with_airspeeds(rows, work.airspeeds, report, work.seen)
    if work.rules.idle_only is not None:
        rows = with_power(rows, work.rules.slowest_fpm)
    batches = _batches(rows)
    del rows
    levels, dropped_rows, parts, level_flight = [], [], [], []
    parallel = Parallel(threads, backend="threading", batch_size=1, return_as="generator")
    for done in results_of(parallel, (delayed(_cleaned)(batch, work) for batch in batches)):
        levels.append(done.levels)
        parts.append(done.report)
        dropped_rows += done.dropped_rows
        level_flight.append(done.level_flight)
        if progress:
            progress(f"cleaning rows, part {len(levels)} of {len(batches)}")
    report.extend(parts)
    shown = [some_flights(pl.concat(dropped_rows), work.shown)] if dropped_rows else []
    both = [pl.concat(levels), pl.concat(level_flight)]
    found, level = both if silences is None else (named_as_before(table, silences) for table in both)
    return Outcome(found, report, present, untyped, shown, level)


def before_rates(rules: Cleaning) -> tuple[filters.Filter, ...]:
    """Filters of altitude, IAS, Mach and reported rate, applied before missing rates are computed from altitude."""
    stale = {"seconds": rules.stale_s, "longest_gap_s": rules.longest_gap_s}
    agreeing = {"agreeing_kt": rules.spike_agreeing_kt}
    return (
        _faulty_values.Despike("altitude", rules.spike_altitude_ft, fastest=rules.fastest_altitude_ftps),
        _faulty_values.Despike("IAS", rules.spike_ias_kt, fastest=rules.fastest_ias_ktps, **agreeing),
        _faulty_values.Despike("Mach", rules.spike_mach, fastest=rules.fastest_mach_ps, **agreeing),
        Stale("altitude", rules.stale_altitude_ft, **stale),
        Stale("IAS", rules.stale_ias_kt, **stale),
        Stale("Mach", rules.stale_mach, **stale),
        Stale("vertical_rate", rules.stale_altitude_ft, **stale),
        _faulty_values.AirspeedsAgree(rules.airspeeds_differ_kt),
    )


def after_rates(rules: Cleaning) -> tuple[filters.Filter, ...]:
    """Filters that keep free descent, in their order."""
    after_s, within_kt = rules.cleared_speed_after_s, rules.cleared_speed_within_kt
    return (
        _faulty_values.Despike("vertical_rate", rules.spike_rate_fpm, fastest=rules.fastest_rate_fpmps),
        _descent_filters.Descending(rules.slowest_fpm),
        _descent_filters.SteadyDescent(rules.transient_s),
        *([] if after_s is None else [ClearedSpeed(after_s, within_kt)]),
        ConstantRate(rules),
        *([] if rules.idle_only is None else [IdleOnly(rules.idle_only)]),
        _descent_filters.LargestDescent(rules.climb_back_ft),
        _descent_filters.Falling(),
    )


def _batches(rows: pl.DataFrame) -> list[pl.DataFrame]:
    """Rows in batches of whole flights, at least one; no filter compares flights."""
    if rows.is_empty():
        return [rows]
    name = rows["flight_id"]
    begins = np.append((name != name.shift()).fill_null(True).arg_true().to_numpy(), len(rows))
    # The first flight that begins at or after every multiple of the size.
    bounds = np.unique(
        begins[np.searchsorted(begins, np.arange(0, len(rows) + BATCH_ROWS, BATCH_ROWS).clip(0, len(rows)))]
    )
    return [rows.slice(start, stop - start) for start, stop in itertools.pairwise(bounds.tolist())]


def _cleaned(rows: pl.DataFrame, work: Work) -> Outcome:
    """Levels of the descents of some flights."""
    rules = work.rules
    report = TracedReport(by_flight=True, rows=len(rows)) if work.shown else DropReport(by_flight=True)
    kept, level = _free(with_values_between(rows, report), rules, report)
    levels = to_levels(kept, rules, report)
    long = levels.filter(pl.len().over("flight_id") >= rules.fewest_levels)
    left = kept.filter(pl.col("flight_id").is_in(long["flight_id"].unique().implode()))
    report.count("too_few_levels", kept, left)
    report.note("levels of the kept descents", len(long))
    report.note("levels of descents too short to keep", len(levels) - len(long))
    traced = [report.with_reasons(with_rate(rows), work.shown)] if isinstance(report, TracedReport) else []
    return Outcome(long, report, dropped_rows=traced, level_flight=level)


def _free(rows: pl.DataFrame, rules: Cleaning, report: DropReport) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Rows of free descent, and level flight; filters get the columns that they use, others are added at the end."""
    before, after = before_rates(rules), after_rates(rules)
    used = (*COLUMNS_OF_ALL_FILTERS, *(name for one in after for name in one.uses))
    needed = [name for name in used if name in rows.columns]
    # Numbers compare faster than names.
    narrow = rows.select(needed).with_columns(pl.col("flight_id").rle_id()).with_row_index(ROW_NUMBER)
    narrow = filters.filtered(narrow, before, report)
    absent = narrow["vertical_rate"].null_count() if "vertical_rate" in narrow.columns else len(narrow)
    report.note(DIFFERENCED, absent)
    rated = narrow = with_rate(narrow)
    held = np.zeros(len(rows), dtype=bool)
    for one in after:
        kept = one(narrow, report)
        if isinstance(one, ConstantRate):
            held[narrow[ROW_NUMBER]] = True
            held[kept[ROW_NUMBER]] = False
        narrow = kept
    level = _level_flight(rated, held, rows, report)
    others = rows.drop(set(needed) - {"flight_id"})[narrow[ROW_NUMBER]]
    return pl.concat([narrow.drop("flight_id"), others], how="horizontal"), level


def _level_flight(rated: pl.DataFrame, held: np.ndarray, rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Level flight in the descents of a batch, counted, with names and types of the flights."""
    at, others = rated[ROW_NUMBER], [name for name in SPEEDS if name in rows.columns and name not in rated.columns]
    with_speeds = rated.with_columns(rows[name][at] for name in others)
    segments = stretches(with_speeds, pl.Series(held[at.to_numpy()]))
    note_level_flight(segments, report)
    number = pl.col("flight_id").rle_id().alias("number")
    names = rows.select(number, "flight_id", "typecode").unique("number", keep="first")
    named = segments.rename({"flight_id": "number"}).join(names, on="number", maintain_order="left").drop("number")
    return named.select("flight_id", "typecode", pl.exclude("flight_id", "typecode"))
