"""Values of other rows of an aircraft near a row in time: registers of Mode S come one by one, in rows of their own."""

from typing import Any, Literal

import polars as pl

from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import COLUMNS

BETWEEN_S = 5.0
"""Largest distance of values between which is interpolated: altitudes change at most as much as steps of 25 ft hide."""
NEAR_S = 5.0
"""Largest distance in time of other values from a row; radars ask for registers every 4 to 12 s."""
OF_OTHER_ROWS = ("TAS", "groundspeed", "track", "roll", "latitude", "longitude", "geoaltitude")
"""Values of BDS 5,0 and ADS-B next to IAS and Mach of BDS 6,0."""
MAX_SHARE_TOGETHER = 0.01
"""Share of the rows with IAS that have a value, up to which it is taken for one that comes in rows of its own."""
LEAPING_COLUMNS = ("track", "longitude")
"""Not interpolated: they leap."""
JOINED_VALUES = "values of {name} from rows without IAS within 5 s, for they come in rows of their own"
VALUES_APART = "rows with {name} but without IAS, where no row with IAS has it, nor another within 5 s"
"""Notes in the report."""
JOIN_MEND = (
    "values of {name} stand in other rows than IAS: put into each row with IAS the value of the same aircraft that is "
    "nearest in time, for instance by merge_asof of pandas or join_asof of polars"
)
"""Advice on these in messages."""


def with_values_of_other_rows(rows: pl.DataFrame, report: DropReport) -> pl.DataFrame:
    """Rows in which IAS has with it what the table holds in rows of its own, where these are near in time.

    Nothing is done with a column that has a value in more than :data:`MAX_SHARE_TOGETHER` of the rows with IAS.
    """
    if "IAS" not in rows.columns or not rows["IAS"].count():
        return rows
    measured = rows.filter(pl.col("IAS").is_not_null())
    names = [name for name in ("altitude", *OF_OTHER_ROWS) if name in rows.columns and _is_apart(name, rows, measured)]
    if not names:
        return rows
    time = (pl.col("timestamp").dt.epoch("us") / 1e6).alias("time")
    ordered = rows.with_columns(time).with_row_index("_row").drop_nulls(["time", "icao24"]).sort("time", "_row")
    reports = ordered.filter(pl.col("IAS").is_not_null()).select("_row", "time", "icao24", *names)
    for name in names:
        others = ordered.filter(pl.col("IAS").is_null()).select("time", "icao24", name).drop_nulls()
        reports = reports if name in LEAPING_COLUMNS else between(reports, others, name)
        if name != "altitude":
            beside = near(reports.drop(name), others, NEAR_S)
            reports = reports.with_columns(pl.coalesce(name, beside[name]).alias(name))
        number = reports[name].count() - measured[name].count()
        report.note(JOINED_VALUES.format(name=name), number)
        if not number:
            report.note(VALUES_APART.format(name=name), len(others))
    joined = rows.with_row_index("_row").join(reports.select("_row", *names), on="_row", how="left", suffix="_beside")
    joined = joined.sort("_row").with_columns(pl.coalesce(name, f"{name}_beside").alias(name) for name in names)
    return joined.select(name for name in COLUMNS if name in rows.columns)


def _is_apart(name: str, rows: pl.DataFrame, measured: pl.DataFrame) -> bool:
    beside = measured[name].count()
    return beside <= MAX_SHARE_TOGETHER * len(measured) and rows[name].count() > beside


def between(reports: pl.DataFrame, others: pl.DataFrame, name: str = "altitude") -> pl.DataFrame:
    """Fill in values between the one before and the one after."""
    values = others.select("icao24", "time", name).drop_nulls(name)
    sides = reports
    sided: tuple[tuple[str, Any], ...] = (("before", "backward"), ("after", "forward"))
    for side, strategy in sided:
        named = values.select("icao24", "time", pl.col("time").alias(f"t_{side}"), pl.col(name).alias(side))
        sides = sides.join_asof(
            named, on="time", by="icao24", strategy=strategy, tolerance=BETWEEN_S, check_sortedness=False
        )
    span = pl.col("t_after") - pl.col("t_before")
    share = pl.when(span > 0).then((pl.col("time") - pl.col("t_before")) / span).otherwise(0.0)
    made = pl.col("before") + share * (pl.col("after") - pl.col("before"))
    return sides.with_columns(pl.coalesce(name, made).alias(name)).drop("before", "after", "t_before", "t_after")


def near(
    reports: pl.DataFrame, others: pl.DataFrame, within_s: float, strategy: Literal["nearest", "backward"] = "nearest"
) -> pl.DataFrame:
    """Add the nearest report of another kind."""
    return reports.join_asof(
        others, on="time", by="icao24", strategy=strategy, tolerance=within_s, check_sortedness=False
    )
