"""Values that are none of their column: another column's to the digit, or one number that stands for none.

Both leap. Where some rows have another column's values the column leaps to these and back, and a number that stands for
none comes again and again among others. They are set to missing, counted and named.
"""

from collections.abc import Iterator

import numpy as np
import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.rows._readings import MIN_AIRCRAFT
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.rows.schema import MIN_CHECKED_VALUES

TAKEN_FOR_MISSING = ", taken for missing"
"""End of the notes in the report."""
ALIKE = (("IAS", "groundspeed"), ("IAS", "TAS"))
"""Columns that never agree to the digit through a descent; TAS and groundspeed do in still air."""
NEAR_KT = 2.0
"""Distance of two airspeeds that pass each other: each one up to it is then as frequent as none."""
MAX_EQUAL_SHARE = 0.9
"""Share of a column's values that are another column's, above which the whole column is that one."""
LEAPS = {"vertical_rate": 500.0, "IAS": 30.0, "Mach": 0.08, "TAS": 40.0, "groundspeed": 40.0}
"""Column -> leap to a value and back, in one direction, that no aircraft makes within a minute."""
LONGEST_LEAP_S = 60.0
MIN_SHARE_OF_LEAPS = 0.3
"""Share of all such leaps that lead to one value, from which it stands for none: spikes have values of all kinds."""
MAX_OFF_CHANGE, WITHIN_FT = 0.3, 100.0
"""Part of a rate's leap within which altitude changes by the rates around it, as in a level-off between two reports it
does not, and distance of its altitude from those around it."""


def without_placeholder_values(rows: pl.DataFrame, source: str, report: DropReport) -> pl.DataFrame:
    """Rows in which such values are missing.

    Args:
        rows: In our names and units.
        source: Begin of the message.
        report: Takes the counts.

    Raises:
        DataError: If nearly all values of a column of few aircraft are another column's.

    Example:
        >>> rows, report = pl.read_parquet("rows.parquet"), DropReport()
        >>> often = rows.with_columns(pl.when(pl.int_range(pl.len()) % 4 > 0).then("IAS").otherwise(333.0))
        >>> _ = without_placeholder_values(often, "rows.parquet", report)
        >>> list(report.notes)
        ['values of IAS that are 333 among others, taken for missing']
    """
    for name, other in ALIKE:
        if {name, other} <= set(rows.columns):
            rows = _without_alike(rows, name, other, source, report)
    for name in LEAPS:
        if name in rows.columns:
            for value in leapt_to(rows, name):
                is_value = rows[name] == value
                report.note(f"values of {name} that are {value:g} among others{TAKEN_FOR_MISSING}", int(is_value.sum()))
                rows = rows.with_columns(pl.when(~is_value).then(name).alias(name))
    return rows


def _without_alike(rows: pl.DataFrame, name: str, other: str, source: str, report: DropReport) -> pl.DataFrame:
    apart = (pl.col(name) - pl.col(other)).abs()
    # Airspeeds that pass each other, as whole knots do, are near each other at more altitudes than they are equal.
    level, passing = pl.col("altitude") // WITHIN_FT, (apart == 0, apart.is_between(0, NEAR_KT, closed="right"))
    equal, near = (level.filter(where).n_unique().cast(pl.Int64) for where in passing)
    excess = pl.max_horizontal(equal - near, (equal - near).over("icao24"))
    is_alike = rows.select((apart == 0) & (excess >= MIN_CHECKED_VALUES)).to_series().fill_null(False)
    number = int(is_alike.sum())
    if not number:
        return rows
    words = f"values of {name} that equal {other} to the digit"
    if number > MAX_EQUAL_SHARE * rows[name].count():
        if rows["icao24"].n_unique() >= MIN_AIRCRAFT:
            return rows  # the columns' physics shows which of both is wrong
        raise DataError(
            f"{source}: {number:,} of {rows[name].count():,} {words}",
            expected=f"{name} and {other} as they were reported, each by itself",
            mend=f"take {name} from its own field (the indicated airspeed is in BDS 6,0), or leave {other} out",
        )
    ordered = rows.with_columns(is_alike.alias("_alike")).sort("icao24", "timestamp", maintain_order=True)
    changes = (pl.col("_alike") != pl.col("_alike").shift()) & (pl.col("icao24") == pl.col("icao24").shift())
    leaps = {one: ordered.select(pl.col(one).diff().abs().filter(changes).sum()).item() for one in (name, other)}
    if leaps[other] > leaps[name]:
        words, name = f"values of {other} that equal {name} to the digit", other
    report.note(words + TAKEN_FOR_MISSING, number)
    return rows.with_columns(pl.when(~is_alike).then(name).alias(name))


def leapt_to(rows: pl.DataFrame, name: str) -> Iterator[float]:
    """Values to which a column leaps and back so often that they stand for none.

    Args:
        rows: Of aircraft, in any order.
        name: Column of :data:`LEAPS`.
    """
    columns = pl.col("icao24", "timestamp", "altitude", name)
    ordered = rows.select(columns).drop_nulls().sort("icao24", "timestamp", maintain_order=True)
    if len(ordered) < MIN_CHECKED_VALUES:
        return
    who = ordered["icao24"].rle_id().to_numpy().astype(np.int64)
    seconds, values = ordered["timestamp"].dt.epoch("us").to_numpy() / 1e6, ordered[name].to_numpy()
    begins = np.flatnonzero((np.diff(who, prepend=-1) != 0) | (np.diff(values, prepend=np.nan) != 0))
    ends = np.append(begins[1:], len(values)) - 1
    last, first = ends[:-2], begins[2:]  # the rows before and after each run of one value
    run = values[begins][1:-1]
    before, after = values[last] - run, values[first] - run
    took_s = seconds[first] - seconds[last]
    leap = np.where(np.sign(before) == np.sign(after), np.minimum(np.abs(before), np.abs(after)), 0.0)
    leaps = (leap > LEAPS[name]) & (who[last] == who[first]) & (took_s <= LONGEST_LEAP_S)
    # Rows of two clocks or aircraft lie in each other, each at altitudes of its own.
    altitude_ft = ordered["altitude"].to_numpy()
    low, high = (edge(altitude_ft[last], altitude_ft[first]) for edge in (np.minimum, np.maximum))
    at_ft = altitude_ft[begins][1:-1]
    leaps &= (at_ft > low - WITHIN_FT) & (at_ft < high + WITHIN_FT)
    if name == "vertical_rate":
        with np.errstate(all="ignore"):
            change_fpm = (altitude_ft[first] - altitude_ft[last]) / took_s * 60
            leaps &= np.abs((change_fpm - run) / ((before + after) / 2) - 1) < MAX_OFF_CHANGE
    reached, counts = np.unique(run[leaps], return_counts=True)
    often = (counts >= MIN_CHECKED_VALUES) & (counts >= MIN_SHARE_OF_LEAPS * leaps.sum())
    yield from map(float, reached[often])
