"""A column of times is read cell by cell: one odd cell, or two kinds of times, cost no other row."""

import polars as pl
import pytest
from surveillance_toys import fleet

from descentflow.core.errors import DataError
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._times import timestamps
from descentflow.surveillance.rows.drop_report import DropReport

DATES = [f"2024-03-01T10:00:{second:02d}Z" for second in range(10)]
FIRST_S = 1_709_287_200


@pytest.mark.parametrize("odd", ["0", "nan", "inf", "-inf", "17", "N/A", ""])
def test_one_odd_cell_among_dates_is_missing_and_the_others_are_read(odd: str) -> None:
    found = timestamps(pl.Series([*DATES, odd])).dt.epoch("s").to_list()
    assert found == [*range(FIRST_S, FIRST_S + 10), None]


def test_dates_and_seconds_in_one_column_are_both_read() -> None:
    cells = [date if number % 2 else str(FIRST_S + number) for number, date in enumerate(DATES)]
    assert timestamps(pl.Series(cells)).dt.epoch("s").to_list() == list(range(FIRST_S, FIRST_S + 10))


def test_seconds_of_a_simulator_are_read_beside_blanks() -> None:
    assert timestamps(pl.Series(["0", "4", "", "8", "", "", ""])).dt.epoch("s").to_list()[:4] == [0, 4, None, 8]


def test_dates_of_years_that_python_has_not_are_refused_with_the_first_as_a_number() -> None:
    far = fleet(2).with_columns(timestamp=pl.lit(-7 * 10**18).cast(pl.Datetime("us", "UTC")))
    with pytest.raises(DataError, match=r"values of timestamp cannot be read \(the first: -7000000000000000000\)"):
        read_rows([far], DropReport())
