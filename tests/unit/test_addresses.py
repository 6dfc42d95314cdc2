"""However a table writes an address, it is one aircraft: in rows and in tables of types."""

import polars as pl
import pytest
from surveillance_toys import flight

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
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
