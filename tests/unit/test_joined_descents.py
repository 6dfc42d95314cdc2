"""Several prepared files are one set of descents, and say what was dropped of all of them."""

import polars as pl
from surveillance_toys import fleet

from descentflow.surveillance.descents.prepared_descents import join_descents
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport, Step


def test_files_prepared_with_and_without_a_type_are_joined() -> None:
    rows = fleet(4).with_columns(typecode=pl.lit("A320"))
    others = rows.with_columns(icao24=pl.col("icao24").str.replace("4ca", "fff"))
    both = [prepare(rows, typecode="A320"), prepare(others)]
    for parts in (both, both[::-1]):
        joined = join_descents(parts, ["one", "two"])
        assert sum(joined.flights.values()) == sum(sum(part.flights.values()) for part in parts)
        steps = {step.step: step for step in joined.report.steps}
        assert steps["read"].rows_left == len(rows) + len(others)
        assert steps["other_type"].rows_dropped == 0
        assert steps["other_type"].rows_left == steps["missing_value"].rows_left + steps["missing_value"].rows_dropped


def test_a_step_that_a_part_lacks_keeps_its_place_and_its_rows() -> None:
    alone = DropReport([Step("read", 1, None, 9, None), Step("twice", 2, 1, 7, 2), Step("late", 3, 1, 4, 1)])
    other = DropReport([Step("read", 0, None, 5, None), Step("late", 1, 0, 4, 3)])
    for parts in ([alone, other], [other, alone]):
        joined = DropReport()
        joined.extend(parts)
        assert joined.steps == [
            Step("read", 1, None, 14, None), Step("twice", 2, 1, 12, 2), Step("late", 4, 1, 8, 4)
        ]  # fmt: skip
