"""One aircraft by any spelling of its address, one type by any of its rows, and types without a row."""

from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import fleet, flight, written

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.surveillance.cleaning._flights import FILLED_TYPES, FLIGHTS_OF_SEVERAL_TYPES, one_type_each
from descentflow.surveillance.cleaning.drop_report_checks import NONE_OF
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows._addresses import KEPT_ADDRESSES, SPELT_ANEW, six_digits
from descentflow.surveillance.rows.drop_report import DropReport


def spelt(values: list[object], dtype: pl.DataType | None = None) -> list[str | None]:
    return six_digits(pl.Series(values, dtype=dtype), "rows.csv", DropReport()).to_list()


def test_every_spelling_of_an_address_is_the_same() -> None:
    assert spelt(["4CA001", " 0x4ca001", "~4ca001 ", "0X4CA001"]) == ["4ca001"] * 4
    assert spelt(["f91580", "8014", "a1"]) == ["f91580", "008014", "0000a1"], "zeros that a spreadsheet took"
    assert spelt([0xF91580, 0x008014, None]) == ["f91580", "008014", None]
    assert spelt([float(0xF91580), float(0x008014), None]) == ["f91580", "008014", None]
    assert spelt(["16323968", "32788"]) == spelt(["16323968.0", "32788.0"]) == ["f91580", "008014"]


def test_names_that_are_no_addresses_stay() -> None:
    assert spelt(["sample-000001", "plane 7", "0x", ""]) == ["sample-000001", "plane 7", "0x", None]
    assert spelt(["17092512000", "8"]) == ["17092512000", "000008"], "longer than any address"
    assert spelt([0.5, 1.5]) == ["0.5", "1.5"]


def test_what_may_be_digits_or_a_value_is_told() -> None:
    with pytest.warns(DescentflowWarning, match="8014 for 008014.*if they are decimal values.*8014 for 001f4e"):
        assert spelt([8014, 400123]) == ["008014", "400123"]
    assert spelt([2, 1, 3]) == ["000002", "000001", "000003"], "numbers of aircraft say nothing of addresses"
    assert spelt(["400123", "008014"]) == ["400123", "008014"]
    report = DropReport()
    with pytest.warns(DescentflowWarning, match="rows.csv: 2 rows have an icao24 of seven or eight digits .16323968."):
        mixed = six_digits(pl.Series(["4ca001", "16323968", "16323968", "8014"]), "rows.csv", report)
    assert mixed.to_list() == ["4ca001", "16323968", "16323968", "008014"]
    assert report.notes == {SPELT_ANEW: 1, KEPT_ADDRESSES: 2}


def test_types_are_found_by_every_spelling_and_in_every_container() -> None:
    rows = pl.concat(flight(address) for address in ("f91580", "008014")).drop("typecode")
    types = {"F91580": "A320", "8014": "A321"}
    pandas = pytest.importorskip("pandas")
    table = pl.DataFrame({"icao24": list(types), "typecode": list(types.values())})
    for given in (
        types,
        table,
        table.lazy(),
        pandas.DataFrame({name: table[name].to_list() for name in table.columns}),
    ):
        assert prepare(rows, types=given).flights == {"A320": 1, "A321": 1}  # type: ignore[arg-type]
    with pytest.raises(DataError, match="names the type of no row"):
        prepare(rows, types={})
    with pytest.raises(ConfigError, match=r"types of type list; expected .* a dictionary address -> type"):
        prepare(rows, types=["A320"])  # type: ignore[arg-type]


FLEET = pl.concat(flight("4ca001", start_s=day * 86_400.0) for day in range(2))
EVEN = pl.int_range(pl.len()) % 2 == 0


@pytest.mark.parametrize("without", [None, "UNKNOWN", "ZZZZ"])
def test_a_type_that_only_some_rows_name_is_that_of_all(without: str | None) -> None:
    rows = FLEET.with_columns(typecode=pl.when(EVEN).then("typecode").otherwise(pl.lit(without)))
    prepared = prepare(rows)
    assert prepared.frame.equals(prepare(FLEET).frame)
    assert prepared.report.notes[FILLED_TYPES] == len(FLEET) // 2
    first = pl.col("timestamp") < FLEET["timestamp"][-1] - pl.duration(hours=12)
    assert prepare(FLEET.with_columns(typecode=pl.when(first).then("typecode"))).flights == {"A320": 2}


def test_an_address_of_several_types_gives_none_to_other_flights() -> None:
    rows = pl.DataFrame({"flight_id": ["a", "b", "c"], "icao24": "4ca001", "typecode": ["A320", "A321", None]})
    assert one_type_each(rows, DropReport())["typecode"].to_list() == ["A320", "A321", None]


def test_two_types_within_a_flight_are_told_and_make_one_descent() -> None:
    with pytest.warns(DescentflowWarning, match="2 flights whose rows name several types.*correct the column typecode"):
        prepared = prepare(
            FLEET.with_columns(
                typecode=pl.when(pl.int_range(pl.len()) % 3 == 0).then(pl.lit("A321")).otherwise("typecode")
            )
        )
    assert prepared.flights == {"A320": 2}
    assert prepared.report.notes[FLIGHTS_OF_SEVERAL_TYPES] == 2
    assert prepared.frame.drop("typecode").equals(prepare(FLEET).frame.drop("typecode"))


def test_a_part_of_the_types_that_matches_nothing_is_in_the_report(tmp_path: Path) -> None:
    rows = written(fleet(2), tmp_path / "rows.parquet")
    for out in (None, tmp_path / "store"):
        prepared = prepare(rows, typecode="a320, B737-800,A321", out=out)
        assert prepared.flights == {"A320": 2}
        assert prepared.report.notes[f"{NONE_OF}B737-800, A321"] == 2
    with pytest.raises(DataError, match="no row of type B737-800; expected one of A320"):
        prepare(rows, typecode="B737-800")
