"""A flight is of one type, whichever of its rows name it."""

import polars as pl
import pytest
from surveillance_toys import flight

from descentflow.core.errors import DescentflowWarning
from descentflow.surveillance.cleaning._flights import FILLED_TYPES, FLIGHTS_OF_SEVERAL_TYPES, one_type_each
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport

FLEET = pl.concat(flight("4ca001", start_s=day * 86_400.0) for day in range(2))
EVEN = pl.int_range(pl.len()) % 2 == 0


@pytest.mark.parametrize("without", [None, "UNKNOWN", "ZZZZ"])
def test_a_type_that_only_some_rows_name_is_that_of_all(without: str | None) -> None:
    rows = FLEET.with_columns(typecode=pl.when(EVEN).then("typecode").otherwise(pl.lit(without)))
    found = prepare(rows)
    assert found.frame.equals(prepare(FLEET).frame)
    assert found.report.notes[FILLED_TYPES] == len(FLEET) // 2
    first = pl.col("timestamp") < FLEET["timestamp"][-1] - pl.duration(hours=12)
    assert prepare(FLEET.with_columns(typecode=pl.when(first).then("typecode"))).flights == {"A320": 2}


def test_an_address_of_several_types_gives_none_to_other_flights() -> None:
    rows = pl.DataFrame({"flight_id": ["a", "b", "c"], "icao24": "4ca001", "typecode": ["A320", "A321", None]})
    assert one_type_each(rows, DropReport())["typecode"].to_list() == ["A320", "A321", None]


def test_two_types_within_a_flight_are_told_and_make_one_descent() -> None:
    with pytest.warns(DescentflowWarning, match="2 flights whose rows name several types.*correct the column typecode"):
        found = prepare(
            FLEET.with_columns(
                typecode=pl.when(pl.int_range(pl.len()) % 3 == 0).then(pl.lit("A321")).otherwise("typecode")
            )
        )
    assert found.flights == {"A320": 2}
    assert found.report.notes[FLIGHTS_OF_SEVERAL_TYPES] == 2
    assert found.frame.drop("typecode").equals(prepare(FLEET).frame.drop("typecode"))
