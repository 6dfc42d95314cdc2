"""Rows in order, without duplicates or impossible values, each with its flight and its type.

Silence separates flights of one name, and legs of traces that the end of a day cut are joined again.
"""

from collections.abc import Sequence

import numpy as np
import polars as pl

from descentflow.surveillance.cleaning.filters import Index
from descentflow.surveillance.rows._times import FIRST_TIME_S
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import AIRSPEEDS, COLUMNS, POSSIBLE, REQUIRED, ROWS_WITHOUT

MEASURED_COLUMNS = ("altitude", "IAS", "Mach", "vertical_rate", "TAS", "groundspeed")
OTHER_VALUES = "rows with the address and time of another row but other values, left out as duplicates"
"""Note in the report."""


BEFORE_1990 = "rows of times before 1990, which count from something else: their date is unknown"
"""Note in the report."""


def usable(rows: pl.DataFrame, report: DropReport, instead: Sequence[str] = ()) -> pl.DataFrame:
    """Drop rows in which a required value is missing or impossible; each row is judged by itself.

    An impossible value of a channel that is not required is set to missing instead, and noted.

    Args:
        rows: As read.
        report: Takes the counts.
        instead: Columns that a row must have in place of airspeeds, where these are derived; none where they are not.
    """
    report.count("read", rows, rows)
    absent = [name for name in (*AIRSPEEDS, *instead) if name not in rows.columns]
    rows = rows.with_columns(pl.lit(None, COLUMNS[name]).alias(name) for name in absent)
    for name in (*REQUIRED, *instead):
        report.note(ROWS_WITHOUT + name, rows[name].null_count())
    report.note(BEFORE_1990, int((rows["timestamp"].dt.epoch("us") < 1e6 * FIRST_TIME_S).sum()))
    either = [pl.all_horizontal(pl.col(some).is_not_null()) for some in (AIRSPEEDS, instead) if some]
    always = [pl.col(name).is_not_null() for name in REQUIRED if name not in AIRSPEEDS]
    complete = report.count("missing_value", rows, rows.filter(*always, pl.any_horizontal(either)))
    for name in REQUIRED:
        if name in POSSIBLE:
            possible = complete[name].is_between(*POSSIBLE[name]).fill_null(True)
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
    """
    names = rows["icao24"].unique().sort()
    address = rows["icao24"].cast(pl.Enum(names)).to_physical().cast(pl.Int64).to_numpy()
    time = rows["timestamp"].dt.epoch("us").to_numpy()
    order = np.lexsort((time, address))
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
    measured = [rows[name] for name in MEASURED_COLUMNS if name in rows.columns]
    differs = [(values[one] != values[other]).fill_null(False).to_numpy() for values in measured]
    return int(np.any(differs, axis=0).sum()) if differs else 0


def names_given(rows: pl.DataFrame) -> pl.DataFrame:
    """Pairs `flight_id icao24` of the source, each once."""
    if "flight_id" not in rows.columns:
        return pl.DataFrame(schema={"flight_id": pl.String, "icao24": pl.String})
    return rows.select("flight_id", "icao24").unique().drop_nulls()


def names_shared(pairs: pl.DataFrame) -> pl.Series:
    """Flight names that would mix the rows of two aircraft (for instance a flight number that is flown every day).

    A name that looks like one that is made (:func:`name_flights`) for another aircraft counts, too.
    """
    made = pl.col("flight_id").str.extract(MADE_NAME)
    foreign = (made != pl.col("icao24")).fill_null(False)
    return pairs.unique().filter(pl.col("flight_id").is_duplicated() | foreign)["flight_id"].unique().sort()


def name_flights(rows: pl.DataFrame, gap_s: float, shared: pl.Series, report: DropReport) -> pl.DataFrame:
    """Fill `flight_id` where it is missing with the address and the time of the flight's first row.

    Silence ends a flight, with a name or without (``_flights``).
    """
    named = rows
    if len(shared):
        own = pl.col("flight_id") + "_" + pl.col("icao24")
        named = named.with_columns(
            pl.when(pl.col("flight_id").is_in(shared.implode())).then(own).otherwise("flight_id").alias("flight_id")
        )
    named = separated(named, gap_s, report)
    if "flight_id" not in named.columns or named["flight_id"].null_count():
        silent = pl.col("timestamp").diff().dt.total_microseconds() / 1e6 > gap_s
        begins = ((pl.col("icao24") != pl.col("icao24").shift()) | silent).fill_null(True)
        name = pl.col("icao24") + "_" + pl.col("timestamp").dt.strftime("%Y%m%dT%H%M%S")
        made = named.filter(begins).select(name).to_series().gather(named.select(begins.cum_sum() - 1).to_series())
        given = [pl.col("flight_id")] if "flight_id" in named.columns else []
        named = named.with_columns(pl.coalesce(*given, made).alias("flight_id"))
    return named.sort("flight_id", maintain_order=True)


MADE_NAME = r"^(?:.*_)?([0-9a-f]{6})_\d{8}T\d{6}$"
"""Names that are made of an address and a time, of whole flights and of parts, look so."""
MADE_ALONE = r"^([0-9a-f]{6})_\d{8}T\d{6}$"
"""So do names of whole flights and of legs of traces, which no source has given."""
PART_OF = "_part_of"
"""Column with the source's name of the flight that a row's flight is a part of, null where it is the whole."""
SEPARATED_FLIGHTS = "flights separated by silence under a flight_id that comes again"
OVER_MIDNIGHT = "legs of traces that go on in the next day's trace, joined over 00:00 UTC"
"""Notes in the report."""


def separated(rows: pl.DataFrame, gap_s: float, report: DropReport) -> pl.DataFrame:
    """Rows in which a name stands for one flight: it ends with silence, as an address without a name does.

    A `flight_id` that comes again (a flight number that is flown every day, a number that begins anew in each file)
    gets the address and the time of each of its flights; so does one whose flight has a long gap.
    """
    if "flight_id" not in rows.columns or rows["flight_id"].null_count() == len(rows):
        return rows
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
    report.note(SEPARATED_FLIGHTS, parts)
    if not parts and stretches["flight_id"].equals(stretches["given"]):
        return rows
    of_row = stretches[begins.cast(pl.UInt32).cum_sum() - 1]
    named = rows.with_columns(of_row["name"].alias("flight_id"))
    return named.with_columns(of_row["part_of"].alias(PART_OF)) if parts else named


def named_as_before(levels: pl.DataFrame, parts: pl.DataFrame) -> pl.DataFrame:
    """Levels in which a flight has the name that its source gave, if no other part of it has levels.

    A long gap of reception before a descent leaves it its name, then; two descents of one name keep those that tell
    them apart.
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
    continued = stretches.select(goes_on).to_series()
    report.note(OVER_MIDNIGHT, int(continued.sum()))
    if not continued.any():
        return stretches
    return stretches.with_columns(name.first().over((~continued).cum_sum()))


def _name_of_part() -> pl.Expr:
    """Name of the source, address and time of the first row of the part; the address once."""
    name, address = pl.col("flight_id"), pl.col("icao24")
    time = pl.from_epoch(pl.col("first").first().over("icao24", "flight_id", "part"), time_unit="us")
    alone = name.str.extract(MADE_ALONE) == address
    begin = pl.when(alone.fill_null(False)).then(address).when(name.str.ends_with("_" + address)).then(name)
    return begin.otherwise(name + "_" + address) + "_" + time.dt.strftime("%Y%m%dT%H%M%S")


def typed_by_flight(rows: pl.DataFrame, types: pl.DataFrame) -> pl.DataFrame:
    """Rows with the types of a list of flights, by the names that the source gives them."""
    if "flight_id" not in rows.columns:
        return rows
    listed = types.select("flight_id", _type="typecode").unique("flight_id", keep="first", maintain_order=True)
    joined = rows.join(listed, on="flight_id", how="left", maintain_order="left")
    own = [pl.col("typecode")] if "typecode" in rows.columns else []
    return joined.with_columns(pl.coalesce(*own, "_type").alias("typecode")).drop("_type")


NO_TYPES = ("ZZZZ", "XXXX", "UNKN", "UNKNOWN", "NONE", "NULL", "NAN", "N/A", "NA", "-", "?")
"""Spellings of no type: ZZZZ is ICAO's (Doc 8643) for one without a designator."""


def with_types(rows: pl.DataFrame, types: pl.DataFrame | None, report: DropReport) -> pl.DataFrame:
    """Join a table of types (``named_types``); those of rows come first.

    What stands for no type (`ZZZZ`, `XXXX`) is none. A flight has one type
    (``one_type_each``).
    """
    if "typecode" not in rows.columns:
        rows = rows.with_columns(pl.lit(None, pl.String).alias("typecode"))
    typecode = pl.col("typecode").str.to_uppercase()
    rows = rows.with_columns(pl.when(~typecode.is_in(NO_TYPES)).then(typecode).alias("typecode"))
    rows = one_type_each(rows, report)
    if types is not None:
        table = types.select(
            "icao24",
            pl.col("typecode").cast(pl.String).str.strip_chars().alias("_type"),
        ).unique("icao24", keep="first", maintain_order=True)
        rows = rows.join(table, on="icao24", how="left", maintain_order="left")
        rows = rows.with_columns(pl.coalesce("typecode", "_type").alias("typecode")).drop("_type")
    return rows.with_columns(pl.col("typecode").str.to_uppercase())


def of_types(rows: pl.DataFrame, wanted: Sequence[str], report: DropReport) -> pl.DataFrame:
    """Keep rows of known type, and of the wanted types if there are any."""
    named = rows["typecode"].is_not_null()
    known = report.count("unknown_type", rows, rows if named.all() else rows.filter(named))
    if not wanted:
        return known
    return report.count("other_type", known, known.filter(pl.col("typecode").is_in([t.upper() for t in wanted])))


def rows_by_address(rows: pl.DataFrame) -> dict[str, int]:
    """Number of rows of each address."""
    return dict(rows["icao24"].value_counts(sort=True).iter_rows())


FILLED_TYPES = "rows without a typecode that got that of the flight's or the address's other rows"
FLIGHTS_OF_SEVERAL_TYPES = "flights whose rows name several types, taken for the most frequent"
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
    report.note(FLIGHTS_OF_SEVERAL_TYPES, counts.filter(flight.is_duplicated())["flight_id"].n_unique())
    typed = rows.drop("typecode").join(
        of_flight.select("flight_id", "typecode"), on="flight_id", how="left", maintain_order="left"
    )
    typed = typed.join(of_address.rename({"typecode": "_type"}), on="icao24", how="left", maintain_order="left")
    typed = typed.with_columns(pl.coalesce("typecode", "_type").alias("typecode"))
    report.note(FILLED_TYPES, rows["typecode"].null_count() - typed["typecode"].null_count())
    return typed.select(rows.columns)
