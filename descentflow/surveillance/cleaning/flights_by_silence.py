"""Separation of flights of one name by silence, and legs of traces that a day's end cut joined again."""

import polars as pl

from descentflow.surveillance.rows.drop_report import DropReport

MADE_NAME = r"^(?:.*_)?([0-9a-f]{6})_\d{8}T\d{6}$"
"""Names that are made of an address and a time, of whole flights and of parts, look so."""
MADE_ALONE = r"^([0-9a-f]{6})_\d{8}T\d{6}$"
"""So do names of whole flights and of legs of traces, which no source has given."""
PART_OF = "_part_of"
"""Column with the source's name of the flight that a row's flight is a part of, null where it is the whole."""
PARTS = "flights separated by silence under a flight_id that comes again"
OVER_MIDNIGHT = "legs of traces that go on in the next day's trace, joined over 00:00 UTC"
"""Notes in the report."""


def told_apart(rows: pl.DataFrame, gap_s: float, report: DropReport | None = None) -> pl.DataFrame:
    """Rows in which a name stands for one flight: it ends with silence, as an address without a name does.

    A `flight_id` that comes again (a flight number that is flown every day, a number that begins anew in each file)
    gets the address and the time of each of its flights; so does one whose flight has a long gap.

    Args:
        rows: Sorted by aircraft and time.
        gap_s: Time without a row of the flight after which the same name is another flight.
        report: Takes the number of flights that were separated, and of legs that were joined.

    Returns:
        The same rows in the same order, with :data:`PART_OF` if any flight was separated.

    Example:
        >>> times = pl.from_epoch(pl.Series([0, 60, 86_400]))
        >>> rows = pl.DataFrame({"icao24": "4ca001", "flight_id": "AB12", "timestamp": times})
        >>> told_apart(rows, 900.0)["flight_id"].to_list()[1:]
        ['AB12_4ca001_19700101T000000', 'AB12_4ca001_19700102T000000']
    """
    if "flight_id" not in rows.columns or rows["flight_id"].null_count() == len(rows):
        return rows
    report = report or DropReport()
    begins = rows.select(_begins(gap_s)).to_series()
    stretches = _over_midnight(_stretches(rows, begins), gap_s, report)
    silent = (pl.col("first") - pl.col("last").shift()).over("icao24", "flight_id") > _micros(gap_s)
    # One window after the other: the lowest version of Polars knows none within another.
    stretches = stretches.with_columns(silent=silent.fill_null(False))
    stretches = stretches.with_columns(part=pl.col("silent").cum_sum().over("icao24", "flight_id"))
    several = (pl.col("part").max().over("icao24", "flight_id") > 0) & pl.col("flight_id").is_not_null()
    stretches = stretches.with_columns(
        name=pl.when(several).then(_name_of_part()).otherwise("flight_id"),
        part_of=pl.when(several).then("flight_id"),
    )
    parts = stretches.filter(pl.col("part_of").is_not_null())["name"].n_unique()
    report.note(PARTS, parts)
    if not parts and stretches["flight_id"].equals(stretches["given"]):
        return rows
    of_row = stretches[begins.cast(pl.UInt32).cum_sum() - 1]
    named = rows.with_columns(of_row["name"].alias("flight_id"))
    return named.with_columns(of_row["part_of"].alias(PART_OF)) if parts else named


def named_as_before(levels: pl.DataFrame, parts: pl.DataFrame) -> pl.DataFrame:
    """Levels in which a flight has the name that its source gave, if no other part of it has levels.

    A long gap of reception before a descent leaves it its name, then; two descents of one name keep those that tell
    them apart.

    Args:
        levels: Sorted by flight.
        parts: Pairs `flight_id` and :data:`PART_OF` of the parts of flights.

    Example:
        >>> parts = pl.DataFrame({"flight_id": ["a_1", "a_2"], PART_OF: ["a", "a"]})
        >>> named_as_before(pl.DataFrame({"flight_id": ["a_2", "b"]}), parts)["flight_id"].to_list()
        ['a', 'b']
    """
    left = parts.filter(pl.col("flight_id").is_in(levels["flight_id"].unique().implode()))
    alone = left.filter(~pl.col(PART_OF).is_duplicated())
    if alone.is_empty():
        return levels
    return levels.with_columns(pl.col("flight_id").replace(alone["flight_id"], alone[PART_OF])).sort(
        "flight_id", maintain_order=True
    )


def _micros(seconds: float) -> pl.Expr:
    return pl.lit(min(seconds * 1e6, 2.0**62)).cast(pl.Int64)


def _begins(gap_s: float) -> pl.Expr:
    """Mask of rows with which another aircraft or name begins, or the same again after silence."""
    other = [pl.col(name).ne_missing(pl.col(name).shift()) for name in ("icao24", "flight_id")]
    silent = pl.col("timestamp").diff().dt.total_microseconds() > _micros(gap_s)
    return pl.any_horizontal(*other, silent.fill_null(True))


def _stretches(rows: pl.DataFrame, begins: pl.Series) -> pl.DataFrame:
    """Address, name, and times in microseconds of the first and the last row of each stretch of rows."""
    starts = begins.arg_true()
    ends = (starts.shift(-1) - 1).fill_null(len(rows) - 1)
    micros = rows["timestamp"].dt.epoch("us")
    return pl.DataFrame(
        [rows["icao24"][starts], rows["flight_id"][starts], rows["flight_id"][starts].alias("given")]
    ).with_columns(micros[starts].alias("first"), micros[ends].alias("last"))


def _over_midnight(stretches: pl.DataFrame, gap_s: float, report: DropReport) -> pl.DataFrame:
    """Stretches in which a leg has the name that it had the day before: each day's trace names its first leg anew."""
    name, address = pl.col("flight_id"), pl.col("icao24")
    made = (name.str.extract(MADE_ALONE) == address).fill_null(False)
    day_s = 86_400 * 1_000_000
    goes_on = (
        made
        & made.shift()
        & (address == address.shift())
        & (name != name.shift())
        & (pl.col("first") - pl.col("last").shift() <= _micros(gap_s))
        & (pl.col("first") // day_s != pl.col("last").shift() // day_s)
    ).fill_null(False)
    found = stretches.select(goes_on).to_series()
    report.note(OVER_MIDNIGHT, int(found.sum()))
    if not found.any():
        return stretches
    return stretches.with_columns(name.first().over((~found).cum_sum()))


def _name_of_part() -> pl.Expr:
    """Name of the source, address and time of the first row of the part; the address once."""
    name, address = pl.col("flight_id"), pl.col("icao24")
    time = pl.from_epoch(pl.col("first").first().over("icao24", "flight_id", "part"), time_unit="us")
    alone = name.str.extract(MADE_ALONE) == address
    begin = pl.when(alone.fill_null(False)).then(address).when(name.str.ends_with("_" + address)).then(name)
    return begin.otherwise(name + "_" + address) + "_" + time.dt.strftime("%Y%m%dT%H%M%S")
