"""From files of rows to prepared descents: every step in its order, every drop counted."""

import hashlib
import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import polars as pl

from descentflow import __version__
from descentflow.errors import DataError
from descentflow.surveillance import filters
from descentflow.surveillance.descents import SCHEMA_VERSION, Descents, top_levels
from descentflow.surveillance.flights import FLIGHT_GAP_S, name_flights, of_types, tidy, with_types
from descentflow.surveillance.free_rate import FreeRate
from descentflow.surveillance.grid import to_levels
from descentflow.surveillance.rates import with_rate
from descentflow.surveillance.readers import files_of, read_rows
from descentflow.surveillance.report import DropReport

BATCH_ROWS = 250_000
"""Rows that are cleaned at a time: their arrays stay in the processor's cache."""


@dataclass(frozen=True)
class Cleaning:
    """Thresholds of the cleaning; each filter's docstring gives its reason."""

    bottom_fl: int = 150
    """Lowest level of the grid; below FL150 arrivals are procedural (paper, section 2.2)."""
    flight_gap_s: float = FLIGHT_GAP_S
    slowest_fpm: float = 500.0
    transient_s: float = 20.0
    constant_rate_s: float = 50.0
    constant_rate_alone_s: float = 180.0
    constant_rate_jump_fpm: float = 150.0
    constant_rate_drift_fpm: float = 80.0
    constant_rate_scatter_fpm: float = 64.0
    longest_gap_s: float = 60.0
    """Neighbouring rows further apart leave the levels between them open..."""
    highest_gap_ft: float = 3000.0
    """...and so do rows further apart in altitude."""
    fewest_levels: int = 20
    """A descent with fewer levels on the grid is dropped."""

    def filters(self) -> filters.Chain:
        """The cleaning of rows, in order."""
        return (
            filters.Despike("vertical_rate", 1500.0, fastest=100.0)
            | filters.Descending(self.slowest_fpm)
            | filters.SteadyDescent(self.transient_s)
            | FreeRate(
                seconds=self.constant_rate_s,
                seconds_alone=self.constant_rate_alone_s,
                jump_fpm=self.constant_rate_jump_fpm,
                drift_fpm=self.constant_rate_drift_fpm,
                scatter_fpm=self.constant_rate_scatter_fpm,
                longest_gap_s=self.longest_gap_s,
            )
            | filters.LargestDescent()
            | filters.Falling()
        )


DESPIKE = (
    filters.Despike("altitude", 300.0, fastest=100.0)
    | filters.Despike("IAS", 15.0, fastest=2.0)
    | filters.Despike("Mach", 0.03, fastest=0.003)
)
"""Before anything is derived; then IAS is held against Mach."""


def prepare(
    paths: Sequence[Path],
    *,
    types: pl.DataFrame | None = None,
    typecodes: Sequence[str] | None = None,
    cleaning: Cleaning | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[Descents, DropReport]:
    """Read rows, clean them to free descents and put those on flight levels (paper, section 3).

    Args:
        paths: Files or folders of rows.
        types: Table `icao24,typecode` for rows that do not name their type.
        typecodes: Types to keep; all if absent.
        cleaning: Thresholds.
        progress: Called with what is being done, at every stage and part.

    Returns:
        Descents, and the report of everything dropped.

    Raises:
        DataError: If the rows cannot be used, or no descent is left.

    Example:
        >>> descents, report = prepare([Path("rows.parquet")], typecodes=["A320"])
        >>> print(report)
    """
    rules = cleaning or Cleaning()
    report = DropReport()
    say = progress or (lambda _: None)
    say("reading rows")
    read = read_rows(paths, report)
    say("telling flights apart")
    rows = name_flights(tidy(read, report), rules.flight_gap_s)
    del read
    report.by_flight = True
    report.count("flights_told_apart", rows, rows)
    rows = of_types(with_types(rows, types), typecodes, report)
    levels = _descents(rows, rules, report, say)
    if levels.is_empty():
        raise DataError(
            f"no free descent of {rules.fewest_levels} levels above FL{rules.bottom_fl} is left\n{report}",
            expected="descents of airliners with IAS, Mach and a rate of 500 ft/min or more",
            mend="see which step dropped the rows; a lower --bottom-fl keeps lower descents",
        )
    metadata = {
        "schema_version": SCHEMA_VERSION,
        "descentflow": __version__,
        "bottom_fl": rules.bottom_fl,
        "top_fl": top_levels(levels),
        "settings": asdict(rules),
        "inputs": [_provenance(path) for path in files_of(paths)],
        "report": report.as_dict(),
    }
    return Descents(levels, metadata), report


def _descents(rows: pl.DataFrame, rules: Cleaning, report: DropReport, say: Callable[[str], None]) -> pl.DataFrame:
    """Clean and grid whole flights, batch by batch: flights know nothing of one another.

    Batches keep the arrays in work small, and as many as there are processors are worked on at once (Polars and NumPy
    let others run while they compute).
    """
    name = rows["flight_id"]
    begins = np.append((name != name.shift()).fill_null(True).arg_true().to_numpy(), len(rows))
    # The first flight that begins at or after every multiple of the size.
    bounds = np.unique(
        begins[np.searchsorted(begins, np.arange(0, len(rows) + BATCH_ROWS, BATCH_ROWS).clip(0, len(rows)))]
    )
    batches = [rows.slice(start, stop - start) for start, stop in itertools.pairwise(bounds.tolist())]
    parts = [DropReport(by_flight=True) for _ in batches]
    levels = []
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        for part in pool.map(lambda batch, part: _batch(batch, rules, part), batches, parts):
            levels.append(part)
            say(f"cleaning rows, part {len(levels)} of {len(batches)}")
    report.extend(parts)
    return pl.concat(levels)


def _batch(rows: pl.DataFrame, rules: Cleaning, report: DropReport) -> pl.DataFrame:
    """Levels of the descents of some flights."""
    cleaned = _cleaned(rows, rules, report)
    levels = to_levels(
        cleaned,
        rules.bottom_fl,
        longest_gap_s=rules.longest_gap_s,
        highest_gap_ft=rules.highest_gap_ft,
        slowest_fpm=rules.slowest_fpm,
    )
    long = levels.filter(pl.len().over("flight_id") >= rules.fewest_levels)
    kept = cleaned.filter(pl.col("flight_id").is_in(long["flight_id"].unique().implode()))
    report.count("too_few_levels", cleaned, kept)
    report.note("levels of the kept descents", len(long))
    report.note("levels of descents too short to keep", len(levels) - len(long))
    return long


def _cleaned(rows: pl.DataFrame, rules: Cleaning, report: DropReport) -> pl.DataFrame:
    """Rows of free descent; only the columns that filters look at go through them, the others follow at the end."""
    needed = [
        name for name in ("flight_id", "timestamp", "altitude", "vertical_rate", "IAS", "Mach") if name in rows.columns
    ]
    # Numbers are compared faster than names.
    narrow = rows.select(needed).with_columns(pl.col("flight_id").rle_id()).with_row_index("_row")
    narrow = (DESPIKE | filters.AirspeedsAgree())(narrow, report)
    narrow = rules.filters()(with_rate(narrow), report)
    others = rows.drop(set(needed) - {"flight_id"})[narrow["_row"]]
    return pl.concat([narrow.drop("_row", "flight_id"), others], how="horizontal")


def _provenance(path: Path) -> dict[str, object]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"name": path.name, "bytes": path.stat().st_size, "sha256": digest}
