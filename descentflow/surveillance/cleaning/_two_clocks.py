"""Clocks of rows: those that begin anew with each flight, and rows that come again by another clock, as local times."""

import polars as pl

from descentflow.core.errors import CleaningError
from descentflow.surveillance.rows._times import FIRST_TIME_S
from descentflow.surveillance.rows.drop_report import DropReport

STEP_S, MAX_STEPS = 1800.0, 28
"""Clocks of time zones differ by multiples of half an hour, up to 14 h."""
WITHIN_S, WITHIN_FT, WITHIN_KT = 5.0, 100.0, 2.0
"""Largest difference in time of a row from its repetition, height of the levels that they share, and difference of IAS:
other flights of an aircraft may pass its levels on the hour, but hardly at the same speeds."""
FALLING_FPM = -800.0
"""Rows that descend faster are compared: level flight comes again at any time."""
MIN_ROWS, MIN_SHARE_AGAIN = 20, 0.9
"""Falling rows of a stretch, and share of them that come again, from which a clock is another one."""
SLOT_S, BAND_FT, BAND_EVERY_FT, MIN_SLOTS = 10.0, 200.0, 1000.0, 5
"""Times and altitudes by which shifts are looked for before rows are compared: one band in each thousand feet."""
BACKWARDS_S, MAX_BACKWARDS_SHARE = 60.0, 0.1
"""Step back in time within the rows of a flight that is no disorder of reports, and share of such steps up to which
rows are in order: a table in no order has a half of them."""
OTHER_CLOCK = "other_clock"
"""Its name in the report."""
ROWS_OF_OTHER_CLOCK = "rows that come again {hours:g} h later, of another clock"
"""Note in the report."""


def check_one_clock(rows: pl.DataFrame) -> None:
    """Refuse rows of before 1990 whose times begin anew: flights of an aircraft would be shuffled into each other.

    One clock for all rows, as a simulator's, is taken as it is, in any order.

    Args:
        rows: In the order in which they were read.
    """
    keys: list[str] = [name for name in ("icao24", "flight_id") if name in rows.columns]
    clock = rows.select(*keys, s=pl.col("timestamp").dt.epoch("us") / 1e6).filter(pl.col("s") < FIRST_TIME_S)
    step = pl.col("s").diff().over(keys)
    count, back = clock.select((step < 0).sum(), back=(step < -BACKWARDS_S).sum()).row(0)
    if not back or count > MAX_BACKWARDS_SHARE * len(clock):
        return
    run = (step < -BACKWARDS_S).fill_null(False).cum_sum().over(keys).alias("run")
    spans = clock.with_columns(run).group_by(*keys, "run").agg(begin=pl.col("s").min(), end=pl.col("s").max())
    meets = pl.col("begin") <= pl.col("end").shift().over(keys)
    if (anew := spans.sort(*keys, "begin").filter(meets)).height:
        raise CleaningError(
            f"times before 1990 that begin anew {len(anew):,} times within the rows of one {' and '.join(keys)} (the "
            f"first: {', '.join(map(str, anew.row(0)[: len(keys)]))}): they count from the begin of something",
            expected="dates with time, or seconds since 1970: an aircraft's rows are ordered by them",
            mend="add the time at which each count began to the column timestamp (for a simulator any day will do, "
            "another for each file, such as 1704067200 for 2024-01-01; of ASTERIX the day to each file's name, as "
            "2024-03-01_x.ast), or give each flight a flight_id and an icao24 of its own",
        )


def without_other_clocks(rows: pl.DataFrame, gap_s: float, report: DropReport) -> pl.DataFrame:
    """Rows without those that the same aircraft has shifted by whole half hours; the earlier of both are kept."""
    clock = _clock(rows, gap_s).filter(pl.col("s") >= FIRST_TIME_S)  # a simulator's clock has no time zone
    is_copy = pl.repeat(False, len(rows), eager=True)
    for (steps,), possible in _possible(clock).partition_by("steps", as_dict=True).items():
        own = clock.filter(pl.col("aircraft").is_in(possible["aircraft"].implode()))
        later, earlier = (_is_near(own, sign * steps * STEP_S) for sign in (-1, 1))
        falling = own.with_columns(again=later | earlier).filter("falling").group_by("stretch", "aircraft")
        sure = falling.agg(pl.len(), pl.col("again").mean()).filter(
            pl.col("len") >= MIN_ROWS, pl.col("again") >= MIN_SHARE_AGAIN
        )
        shifted = own.filter(later & pl.col("aircraft").is_in(sure["aircraft"].unique().implode()))["row"]
        report.note(ROWS_OF_OTHER_CLOCK.format(hours=steps * STEP_S / 3600), len(shifted))
        is_copy = is_copy.scatter(shifted, True)
    return report.count(OTHER_CLOCK, rows, rows.filter(~is_copy) if is_copy.any() else rows)


def _clock(rows: pl.DataFrame, gap_s: float) -> pl.DataFrame:
    """Seconds and altitude of rows, whether each falls, and numbers of its aircraft and its stretch without a gap."""
    seconds = pl.col("s").diff()
    other = (pl.col("icao24") != pl.col("icao24").shift()).fill_null(True)
    change = pl.when(~other & (seconds > 0) & (seconds <= 60)).then(pl.col("altitude").diff() / seconds * 60)
    reported = [pl.col("vertical_rate")] if "vertical_rate" in rows.columns else []
    clock = rows.select("icao24", "altitude", "IAS", *reported, (pl.col("timestamp").dt.epoch("us") / 1e6).alias("s"))
    return clock.with_row_index("row").select(
        "row",
        "s",
        "altitude",
        "IAS",
        other.cum_sum().alias("aircraft"),
        (other | (seconds > gap_s)).cum_sum().alias("stretch"),
        (pl.coalesce(*reported, change) <= FALLING_FPM).fill_null(False).alias("falling"),
    )


def _possible(clock: pl.DataFrame) -> pl.DataFrame:
    """Aircraft that often have an altitude again after the same number of steps."""
    in_band = pl.col("falling") & (pl.col("altitude") % BAND_EVERY_FT < BAND_FT)
    at: list[str | pl.Expr] = [
        "aircraft",
        (pl.col("altitude") // BAND_EVERY_FT).alias("band"),
        (pl.col("s") % STEP_S // SLOT_S).alias("slot"),
    ]
    passed = clock.filter(in_band).select(*at, (pl.col("s") // STEP_S).cast(pl.Int64).alias("steps")).unique()
    passed = passed.sort("aircraft", "band", "slot", "steps")
    same = pl.all_horizontal(pl.col(name) == pl.col(name).shift() for name in ("aircraft", "band", "slot"))
    again = passed.select("aircraft", pl.when(same).then(pl.col("steps").diff()).alias("steps"))
    often = again.filter(pl.col("steps") <= MAX_STEPS).group_by("aircraft", "steps").len()
    return often.filter(pl.col("len") >= MIN_SLOTS)


def _is_near(rows: pl.DataFrame, shift_s: float) -> pl.Series:
    """Mask of rows whose aircraft has a row at their time and a shift, of the same or the next hundred feet and IAS."""
    level = (pl.col("altitude") // WITHIN_FT).cast(pl.Int64).alias("level")
    own = rows.select("aircraft", "s", "IAS", level)
    # Nearest in time of those alone: rows of both clocks lie in each other where a flight is longer than the shift.
    there = rows.select("aircraft", pl.col("s") - shift_s, level, other="IAS")
    other = pl.concat([there.with_columns(pl.col("level") + beside) for beside in (-1, 0, 1)]).sort("s")
    at = (
        own.with_row_index("row")
        .sort("s")
        .join_asof(
            other, on="s", by=["aircraft", "level"], strategy="nearest", tolerance=WITHIN_S, check_sortedness=False
        )
    )
    return at.sort("row").select(((pl.col("IAS") - pl.col("other")).abs() <= WITHIN_KT).fill_null(False)).to_series()
