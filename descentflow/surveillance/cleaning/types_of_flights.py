"""One type for each flight, where only some of its rows name it or they name several."""

import polars as pl

from descentflow.surveillance.rows.drop_report import DropReport

FILLED = "rows without a typecode that got that of the flight's or the address's other rows"
SEVERAL = "flights whose rows name several types, taken for the most frequent"
"""Notes in the report."""


def one_type_each(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows of a flight with the type that most of them name; of a flight that names none, with that of the address.

    An address whose flights have several types gives none to others.

    Args:
        rows: Sorted by flight, with a typecode or null.
        report: Takes the number of types that were filled in, and of flights with several.

    Example:
        >>> rows = pl.DataFrame({"flight_id": ["a", "a", "b"], "icao24": "4ca001", "typecode": ["A320", None, None]})
        >>> one_type_each(rows, DropReport())["typecode"].to_list()
        ['A320', 'A320', 'A320']
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
