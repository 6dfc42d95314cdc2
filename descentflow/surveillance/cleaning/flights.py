"""Rows in order, without duplicates or impossible values, each with its flight and type."""

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning.flights_by_silence import MADE_NAME, told_apart
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.cleaning.types_of_flights import one_type_each
from descentflow.surveillance.cleaning.windows import Index
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import POSSIBLE, REQUIRED, WITHOUT
from descentflow.surveillance.rows.types_table import named_types

NO_TYPES = ("ZZZZ", "XXXX", "UNKN", "UNKNOWN", "NONE", "NULL", "NAN", "N/A", "NA", "-", "?")
"""Spellings of no type: ZZZZ is ICAO's (Doc 8643) for one without a designator."""
MEASURED = ("altitude", "IAS", "Mach", "vertical_rate", "TAS", "groundspeed")
OTHER_VALUES = "rows with the address and time of another row but other values, left out as duplicates"
"""Note in the report."""


def usable(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Drop rows in which a required value is missing or impossible; each row is judged by itself.

    An impossible value of a channel that is not required is set to missing instead, and noted.

    Example:
        >>> from descentflow.surveillance.read_rows import read_rows
        >>> report = DropReport()
        >>> rows = read_rows(["rows.parquet"], DropReport()).with_columns(Mach=pl.lit(7.8))
        >>> usable(rows, report).height, report.steps[-1].step
        (0, 'impossible_Mach')
    """
    report.count("read", rows, rows)
    for name in REQUIRED:
        report.note(WITHOUT + name, rows[name].null_count())
    complete = report.count("missing_value", rows, rows.drop_nulls(list(REQUIRED)))
    for name in REQUIRED:
        if name in POSSIBLE:
            possible = complete[name].is_between(*POSSIBLE[name])
            left = complete if possible.all() else complete.filter(possible)
            complete = report.count(f"impossible_{name}", complete, left)
    for name in sorted(set(POSSIBLE) & set(complete.columns) - set(REQUIRED)):
        inside = pl.col(name).is_between(*POSSIBLE[name])
        wrong = complete.select((~inside).sum()).item()
        report.note(f"impossible values of {name} set to missing", wrong)
        if wrong:
            complete = complete.with_columns(pl.when(inside).then(pl.col(name)).alias(name))
    return complete


def in_order(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows sorted by address and time; of rows with the same address and time the first is kept.

    Those with other values than the one that is kept are counted by themselves: they are no copies.

    Example:
        >>> rows = pl.DataFrame({"icao24": ["b", "a", "b"], "timestamp": pl.from_epoch(pl.Series([5, 9, 5]))})
        >>> in_order(rows, DropReport())["icao24"].to_list()
        ['a', 'b']
    """
    names = rows["icao24"].unique().sort()
    address = rows["icao24"].cast(pl.Enum(names)).to_physical().cast(pl.Int64).to_numpy()
    time = rows["timestamp"].dt.epoch("us").to_numpy()
    order = _order(address, time - time.min(initial=2**62))
    same = np.diff(address[order], prepend=-1) == 0
    report.note("rows put into time order", int((same & (np.diff(order, prepend=-1) < 0)).sum()))
    repeated = same & (np.diff(time[order], prepend=0) == 0)
    if repeated.any():
        kept = order[np.maximum.accumulate(np.where(repeated, 0, np.arange(len(order))))][repeated]
        report.note(OTHER_VALUES, _differing(rows, order[repeated], kept))
    chosen = order[~repeated]
    ordered = rows if np.array_equal(chosen, np.arange(len(rows))) else rows[chosen]
    return report.count("duplicate", rows, ordered)


def _differing(rows: pl.DataFrame, one: Index, other: Index) -> int:
    """Number of pairs of rows that measure something differently."""
    measured = [rows[name] for name in MEASURED if name in rows.columns]
    differs = [(values[one] != values[other]).fill_null(False).to_numpy() for values in measured]
    return int(np.any(differs, axis=0).sum()) if differs else 0


def _order(address: Index, time: Index) -> Index:
    """(n,) order by address, time and position; a single key, where both fit in one, is several times faster."""
    span = int(time.max(initial=0)) + 1
    if (int(address.max(initial=0)) + 1) * span >= 2**63:
        return np.lexsort((time, address))
    keys = pl.DataFrame({"key": address * span + time}).with_row_index("row")
    return keys.sort("key", maintain_order=True)["row"].cast(pl.Int64).to_numpy()


def names_given(rows: pl.DataFrame) -> pl.DataFrame:
    """Pairs `flight_id icao24` of the source, each once.

    Example:
        >>> names_given(pl.DataFrame({"flight_id": ["AB12", "AB12"], "icao24": ["4ca001", "4ca001"]})).rows()
        [('AB12', '4ca001')]
    """
    if "flight_id" not in rows.columns:
        return pl.DataFrame(schema={"flight_id": pl.String, "icao24": pl.String})
    return rows.select("flight_id", "icao24").unique().drop_nulls()


def names_shared(pairs: pl.DataFrame) -> pl.Series:
    """Flight names that would mix the rows of two aircraft (for instance a flight number that is flown every day).

    A name that looks like one that is made (:func:`name_flights`) for another aircraft counts, too.

    Args:
        pairs: As :func:`names_given`, of all rows.

    Example:
        >>> names_shared(pl.DataFrame({"flight_id": ["AB12", "AB12"], "icao24": ["4ca001", "4ca002"]})).to_list()
        ['AB12']
    """
    made = pl.col("flight_id").str.extract(MADE_NAME)
    foreign = (made != pl.col("icao24")).fill_null(False)
    return pairs.unique().filter(pl.col("flight_id").is_duplicated() | foreign)["flight_id"].unique().sort()


def name_flights(
    rows: pl.DataFrame,
    gap_s: float = Cleaning.flight_gap_s,
    *,
    shared: pl.Series | None = None,
    report: DropReport | None = None,
) -> pl.DataFrame:
    """Fill `flight_id` where it is missing with the address and the time of the flight's first row.

    Silence ends a flight, with a name or without (:mod:`~descentflow.surveillance.cleaning.flights_by_silence`).

    Args:
        rows: Sorted by aircraft and time.
        gap_s: Time without a report that separates two flights of one address.
        shared: Names of the source to which the address is added; those of :func:`names_shared` in `rows` if None.
        report: Takes the number of flights that shared one name.

    Returns:
        Rows sorted by flight and time, with the column
        :data:`~descentflow.surveillance.cleaning.flights_by_silence.PART_OF` if flights shared a name.

    Example:
        >>> rows = pl.DataFrame({"icao24": "4ca001", "timestamp": pl.from_epoch(pl.Series([0, 60, 4000]))})
        >>> name_flights(rows)["flight_id"].unique().sort().to_list()
        ['4ca001_19700101T000000', '4ca001_19700101T010640']
    """
    shared = names_shared(names_given(rows)) if shared is None else shared
    named = rows
    if len(shared):
        own = pl.col("flight_id") + "_" + pl.col("icao24")
        named = named.with_columns(
            pl.when(pl.col("flight_id").is_in(shared.implode())).then(own).otherwise("flight_id").alias("flight_id")
        )
    named = told_apart(named, gap_s, report)
    if "flight_id" not in named.columns or named["flight_id"].null_count():
        silent = pl.col("timestamp").diff().dt.total_microseconds() / 1e6 > gap_s
        begins = ((pl.col("icao24") != pl.col("icao24").shift()) | silent).fill_null(True)
        name = pl.col("icao24") + "_" + pl.col("timestamp").dt.strftime("%Y%m%dT%H%M%S")
        made = named.filter(begins).select(name).to_series().gather(named.select(begins.cum_sum() - 1).to_series())
        given = [pl.col("flight_id")] if "flight_id" in named.columns else []
        named = named.with_columns(pl.coalesce(*given, made).alias("flight_id"))
    return _by_flight(named)


def _by_flight(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows sorted by flight, else in their order; much faster than a sort if the rows of a flight are neighbours."""
    runs = rows.select(pl.col("flight_id").rle()).unnest("flight_id")
    if runs["value"].is_sorted():
        return rows
    ends = runs["len"].cast(pl.Int64).cum_sum()
    blocks = runs.select("value", pl.col("len").cast(pl.Int64), (ends - pl.col("len")).alias("first"))
    blocks = blocks.sort("value", maintain_order=True)
    sizes, first = blocks["len"].to_numpy(), blocks["first"].to_numpy()
    starts = np.cumsum(sizes) - sizes
    return rows[np.repeat(first - starts, sizes) + np.arange(len(rows))]


def with_types(rows: pl.DataFrame, types: pl.DataFrame | None, report: DropReport | None = None) -> pl.DataFrame:
    """Join a table of types (`icao24,typecode`); a type in the rows themselves has precedence.

    What stands for no type (`ZZZZ`, `XXXX`) is none. A flight has one type
    (:func:`~descentflow.surveillance.cleaning.types_of_flights.one_type_each`).

    Raises:
        DataError: If the table lacks a column.

    Example:
        >>> types = pl.DataFrame({"icao24": ["4CA001"], "typecode": ["a320"]})
        >>> with_types(pl.DataFrame({"icao24": ["4ca001", "4ca002"]}), types)["typecode"].to_list()
        ['A320', None]
    """
    if "typecode" not in rows.columns:
        rows = rows.with_columns(pl.lit(None, pl.String).alias("typecode"))
    typecode = pl.col("typecode").str.to_uppercase()
    rows = rows.with_columns(pl.when(~typecode.is_in(NO_TYPES)).then(typecode).alias("typecode"))
    if "flight_id" in rows.columns:
        rows = one_type_each(rows, report or DropReport())
    if types is not None:
        types = named_types(types, "a types table")
        table = types.select(
            "icao24",
            pl.col("typecode").cast(pl.String).str.strip_chars().alias("_type"),
        ).unique("icao24", keep="first", maintain_order=True)
        rows = rows.join(table, on="icao24", how="left", maintain_order="left")
        rows = rows.with_columns(pl.coalesce("typecode", "_type").alias("typecode")).drop("_type")
    return rows.with_columns(pl.col("typecode").str.to_uppercase())


def of_types(rows: pl.DataFrame, wanted: Sequence[str] | None, report: DropReport) -> pl.DataFrame:
    """Keep rows of known type, and of the wanted types if there are any.

    Example:
        >>> rows = pl.DataFrame({"typecode": ["A320", "B738", None]})
        >>> of_types(rows, ["a320"], DropReport())["typecode"].to_list()
        ['A320']
    """
    named = rows["typecode"].is_not_null()
    known = report.count("unknown_type", rows, rows if named.all() else rows.filter(named))
    if wanted is None:
        return known
    return report.count("other_type", known, known.filter(pl.col("typecode").is_in([t.upper() for t in wanted])))


def rows_by_address(rows: pl.DataFrame) -> dict[str, int]:
    """Number of rows of each address.

    Example:
        >>> rows_by_address(pl.DataFrame({"icao24": ["4ca001", "4ca001"]}))
        {'4ca001': 2}
    """
    return dict(rows["icao24"].value_counts(sort=True).iter_rows())


def check_left(
    report: DropReport,
    wanted: Sequence[str] | None,
    present: Mapping[str, int],
    types: pl.DataFrame | None = None,
    untyped: Mapping[str, int] | None = None,
) -> None:
    """Refuse rows of which none is left before cleaning, and say why.

    Args:
        report: Of all rows.
        wanted: Types to keep.
        present: Number of rows per known type.
        types: Table `icao24,typecode`, if there is one.
        untyped: Number of rows per address, where it names none of them.

    Raises:
        DataError: If no row is of known type, or of a wanted type. If none was usable before that, nothing is said:
            :func:`~descentflow.surveillance.nothing_left.nothing_left` has the words for it.

    Example:
        >>> report = DropReport()
        >>> for step, left in {"duplicate": 9, "unknown_type": 9, "other_type": 0}.items():
        ...     _ = report.count(step, pl.DataFrame({"IAS": [270.0] * 9}), pl.DataFrame({"IAS": [270.0] * left}))
        >>> check_left(report, ["B738"], {"A320": 9})
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: no row of type B738...
    """
    if not report.left("duplicate"):
        return
    if not report.left("unknown_type") and types is not None and untyped:
        raise _no_address_named(types, untyped)
    if not report.left("unknown_type"):
        raise DataError(
            f"rows without any typecode ({', '.join(NO_TYPES[:2])} and the like are none)",
            expected="a column typecode, or a types table",
            mend="pass --types TABLE.csv with columns icao24,typecode, or add a column typecode; --typecode gives "
            "rows no type, it only selects among those that they have",
        )
    if wanted is not None and not report.left("other_type"):
        often = sorted(present, key=lambda name: (-present[name], name))[:12]
        raise DataError(
            f"no row of type {', '.join(wanted)}", expected=f"one of {', '.join(often)}", mend="change --typecode"
        )


def _no_address_named(types: pl.DataFrame, untyped: Mapping[str, int]) -> DataError:
    """The error where a table of types and the rows have no address in common, with what each of them has."""
    listed = named_types(types, "a types table")["icao24"].drop_nulls().unique().sort()
    shared = sum(address in untyped for address in listed)
    busiest = sorted(untyped, key=lambda address: (-untyped[address], address))[:5]
    often = ", ".join(f"{address} ({untyped[address]:,} rows)" for address in busiest)
    blank = ", without a type" if shared else ""
    return DataError(
        f"a types table that names the type of no row: {shared:,} of its {len(listed):,} addresses "
        f"({', '.join(listed[:3])}) are among the {len(untyped):,} of the {sum(untyped.values()):,} rows{blank}",
        expected=f"lines icao24,typecode with addresses of the rows, the busiest of which are {often}",
        mend="check that icao24 holds the 24-bit address as the rows have it, and typecode a type such as A320",
    )
