"""One type for each flight, of its rows, of its address, or of a table of types."""

from collections.abc import Sequence

import polars as pl

from descentflow.surveillance.rows.addresses import named_types
from descentflow.surveillance.rows.drop_report import DropReport

NO_TYPES = ("ZZZZ", "XXXX", "UNKN", "UNKNOWN", "NONE", "NULL", "NAN", "N/A", "NA", "-", "?")
"""Spellings of no type: ZZZZ is ICAO's (Doc 8643) for one without a designator."""


def with_types(rows: pl.DataFrame, types: pl.DataFrame | None, report: DropReport | None = None) -> pl.DataFrame:
    """Join a table of types (`icao24,typecode`); a type in the rows themselves has precedence.

    What stands for no type (`ZZZZ`, `XXXX`) is none. A flight has one type
    (:func:`~descentflow.surveillance.cleaning.types_of_flights.one_type_each`).
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
    """Keep rows of known type, and of the wanted types if there are any."""
    named = rows["typecode"].is_not_null()
    known = report.count("unknown_type", rows, rows if named.all() else rows.filter(named))
    if wanted is None:
        return known
    return report.count("other_type", known, known.filter(pl.col("typecode").is_in([t.upper() for t in wanted])))


def rows_by_address(rows: pl.DataFrame) -> dict[str, int]:
    """Number of rows of each address."""
    return dict(rows["icao24"].value_counts(sort=True).iter_rows())


FILLED = "rows without a typecode that got that of the flight's or the address's other rows"
SEVERAL = "flights whose rows name several types, taken for the most frequent"
"""Notes in the report."""


def one_type_each(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows of a flight with the type that most of them name; of a flight that names none, with that of the address.

    An address whose flights have several types gives none to others.
    """
    named, flight = pl.col("typecode"), pl.col("flight_id")
    differs = (named.ne_missing(named.shift()) & (flight == flight.shift())).any()
    if rows["typecode"].null_count() == len(rows) or not (rows["typecode"].has_nulls() or rows.select(differs).item()):
        return rows
    counts = rows.drop_nulls("typecode").group_by("flight_id", "icao24", "typecode").len()
    counts = counts.sort("len", "typecode", descending=[True, False])
    of_flight = counts.unique("flight_id", keep="first", maintain_order=True).select("flight_id", "icao24", "typecode")
    of_address = of_flight.select("icao24", "typecode").unique().filter(~pl.col("icao24").is_duplicated())
    report.note(SEVERAL, counts.filter(flight.is_duplicated())["flight_id"].n_unique())
    found = rows.drop("typecode").join(
        of_flight.select("flight_id", "typecode"), on="flight_id", how="left", maintain_order="left"
    )
    found = found.join(of_address.rename({"typecode": "_type"}), on="icao24", how="left", maintain_order="left")
    found = found.with_columns(pl.coalesce("typecode", "_type").alias("typecode"))
    report.note(FILLED, rows["typecode"].null_count() - found["typecode"].null_count())
    return found.select(rows.columns)
