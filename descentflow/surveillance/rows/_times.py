"""Times of rows: read from dates and numbers, and refused where they count from something else."""

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.schema import MIN_CHECKED_VALUES, TIMESTAMP

DATE_FORMATS = (
    "%+",
    "%Y-%m-%d %H:%M:%S%.f%:z",
    "%Y-%m-%d %H:%M:%S%.f%#z",
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y-%m-%dT%H:%M",
    "%Y-%m-%d %H:%M",
)
"""Written dates: RFC 3339, `traffic`'s CSV, and the same without a zone (taken as UTC)."""


LAST_TIME_S = 10_000_000_000
"""Seconds since 1970 up to which a number is a time, November 2286."""
PER_SECOND = {"ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
"""Unit of a datetime -> how many are a second."""


def where_fits(column: pl.Series, fits: pl.Series) -> pl.Series:
    """A column whose values are missing where they do not fit."""
    return column if fits.all() else pl.select(pl.when(fits).then(column).alias(column.name)).to_series()


def timestamps(column: pl.Series) -> pl.Series:
    """Datetimes in UTC of datetimes, written dates, or seconds (also milliseconds) since 1970.

    Texts are read cell by cell, so that dates and numbers may stand in one column. What is neither is missing.

    Example:
        >>> timestamps(pl.Series(["2024-03-01T12:00:00Z"])).dt.hour().to_list()
        [12]
    """
    if isinstance(column.dtype, pl.Datetime):
        is_zoned = column.dtype.time_zone is not None
        column = _in_time(column)
        zoned = column if is_zoned else column.dt.replace_time_zone("UTC")
        return zoned.dt.convert_time_zone("UTC").cast(TIMESTAMP)
    if column.dtype != pl.String:
        return _from_epoch(column.cast(pl.Float64, strict=False))
    column = column.str.strip_chars()
    seconds = column.cast(pl.Float64, strict=False)
    times = pl.repeat(None, len(column), dtype=TIMESTAMP, eager=True)
    for form in DATE_FORMATS:
        # Reading dates costs more than anything else: only those that no earlier form fits are read again.
        left = (times.is_null() & seconds.is_null() & column.is_not_null()).arg_true()
        if left.is_empty():
            break
        times = _parsed(column, form) if len(left) == len(column) else times.scatter(left, _parsed(column[left], form))
    if times.count() > seconds.count():  # among dates, a number such as 0 stands for a missing time
        seconds = where_fits(seconds, seconds >= FIRST_TIME_S)
    return times.fill_null(_from_epoch(seconds))


def _in_time(column: pl.Series) -> pl.Series:
    """Datetimes of 1970 and up to 2286, as for numbers; what is outside is missing: libraries give up on year 10000."""
    per_second = PER_SECOND[column.dtype.time_unit]  # type: ignore[attr-defined]
    return where_fits(
        column, column.to_physical().is_between(0, min(LAST_TIME_S * per_second, 2**63 - 1)).fill_null(True)
    )


def _parsed(column: pl.Series, form: str) -> pl.Series:
    zoned = "z" in form or form == "%+"
    parsed = _in_time(column.str.to_datetime(form, time_unit="us", strict=False))
    return (parsed.dt.convert_time_zone("UTC") if zoned else parsed.dt.replace_time_zone("UTC")).cast(TIMESTAMP)


def in_seconds(s: pl.Expr) -> pl.Expr:
    """Seconds; also of milli-, micro- or nanoseconds where a number can only be these (up to the year 5138)."""
    return pl.when(s > 1e17).then(s / 1e9).when(s > 1e14).then(s / 1e6).when(s > 1e11).then(s / 1e3).otherwise(s)


def _from_epoch(seconds: pl.Series) -> pl.Series:
    read = in_seconds(pl.col("s"))
    valid = pl.when(read.is_finite() & read.is_between(0, LAST_TIME_S)).then(read)
    micro = (valid * 1e6).round().cast(pl.Int64)
    return (
        seconds.alias("s")
        .to_frame()
        .select(pl.from_epoch(micro, time_unit="us").dt.replace_time_zone("UTC"))
        .to_series()
    )


DAYS_FROM, DAYS_TO = 20_000.0, 80_000.0
"""Days since 1899-12-30, in 1954 and 2119: what spreadsheets call a date."""
MAX_REPEATED_SHARE = 0.1
"""Share of rows with the address and time of another, at another altitude, above which times are cut."""
MAX_STEP_DAYS = 0.01
"""Between two rows of an aircraft, a quarter of an hour in days; no source reports every hundredth of a second."""


def check_numbers_of_days(rows: pl.DataFrame, source: str) -> None:
    """Refuse times that are numbers of days, as spreadsheets write dates: as seconds, all lie on one day of 1970."""
    seconds = rows["timestamp"].drop_nulls().dt.epoch("us") / 1e6
    if len(seconds) < MIN_CHECKED_VALUES or not DAYS_FROM < float(seconds.median() or 0.0) < DAYS_TO:  # type: ignore[arg-type]
        return
    clock = rows.select("icao24", pl.col("timestamp").dt.epoch("us") / 1e6).drop_nulls().sort("icao24", "timestamp")
    steps = clock.select(pl.col("timestamp").diff().filter(pl.col("icao24") == pl.col("icao24").shift())).to_series()
    steps = steps.filter(steps > 0)
    if len(steps) >= MIN_CHECKED_VALUES // 2 and float(steps.median() or 0.0) < MAX_STEP_DAYS:  # type: ignore[arg-type]
        raise DataError(
            f"{source}: timestamp seems to be in days since 1899-12-30, as spreadsheets count (the first: "
            f"{seconds[0]:.6f}); read as seconds, all rows lie within moments of 1970",
            expected="dates with time, or seconds since 1970",
            mend="subtract 25569 from the column timestamp and multiply by 86400",
        )


def check_whole_minutes(rows: pl.DataFrame, source: str) -> None:
    """Refuse times that are cut to the minute: rows of one aircraft and time at several altitudes."""
    known = rows.select("icao24", "timestamp", "altitude").drop_nulls()
    if len(known) < MIN_CHECKED_VALUES or (known["timestamp"].dt.epoch("us") % 60_000_000 != 0).any():
        return
    repeated = known.n_unique() - known.n_unique(["icao24", "timestamp"])
    if repeated > MAX_REPEATED_SHARE * len(known):
        raise DataError(
            f"{source}: times are cut to the minute: {repeated:,} of {len(known):,} rows have the address and the time "
            "of another row at another altitude",
            expected="times with seconds",
            mend="write the table again with seconds, which spreadsheets leave out where a cell's format has none",
        )


FIRST_TIME_S = 631_152_000.0
"""1990-01-01: before it there was no Mode S enhanced surveillance, so that such times count from something else."""
