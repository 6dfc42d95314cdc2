"""Times of rows: from the begin of a flight, cell by cell, and by two clocks."""

from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import fleet, flight, written

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.cleaning._flights import BEFORE_1990
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows._times import timestamps
from descentflow.surveillance.rows.drop_report import DropReport

SECONDS = (pl.col("timestamp") - pl.col("timestamp").min()).dt.total_microseconds() / 1e6


def flights(number: int) -> list[pl.DataFrame]:
    return [flight(start_s=86_400.0 * day).with_columns(timestamp=SECONDS + 0.25 * day) for day in range(number)]


def test_a_file_a_flight_with_seconds_from_its_begin_is_refused(tmp_path: Path) -> None:
    for number, rows in enumerate(flights(3)):
        written(rows, tmp_path / f"flight_{number}.csv")
    with pytest.raises(
        DataError, match=r"begin anew 2 times within the rows of one icao24 .the first: 4ca001.: they count"
    ):
        prepare(tmp_path)
    with pytest.raises(DataError, match=r"they count from the begin of something; .* to mend it, add"):
        prepare(flights(2))


def test_flights_under_each_other_in_one_table_are_refused_too() -> None:
    with pytest.raises(DataError, match="begin anew 2 times within the rows of one icao24"):
        prepare(pl.concat(flights(3)))
    rows = pl.concat(rows.with_columns(flight_id=pl.lit(f"F{number}")) for number, rows in enumerate(flights(2)))
    assert prepare(rows).flights == {"A320": 2}, "flights that are named are distinguished"


def test_one_clock_for_all_rows_is_taken_in_any_order(tmp_path: Path) -> None:
    rows = pl.concat(flight(start_s=7200.0 * number) for number in range(2)).with_columns(timestamp=SECONDS)
    assert prepare(rows).flights == prepare(rows.sample(fraction=1.0, shuffle=True, seed=0)).flights == {"A320": 2}
    half = len(rows) // 2
    paths = [written(part, tmp_path / f"{name}.csv") for name, part in (("a", rows[:half]), ("b", rows[half:]))]
    assert prepare(paths).flights == {"A320": 2}, "files of one recording"


@pytest.mark.parametrize("begin_s", [0.0, 468_000.0, 600_000_000.0], ids=["start", "GPS week", "1989"])
def test_a_clock_without_a_date_is_read_and_said(begin_s: float) -> None:
    rows = flight().with_columns(timestamp=SECONDS + begin_s)
    prepared = prepare(rows)
    assert prepared.flights == {"A320": 1}
    assert prepared.report.notes[BEFORE_1990] == len(rows)
    assert BEFORE_1990 not in prepare(flight()).report.notes


@pytest.mark.parametrize("name", ["gps_time", "GPS_seconds", "gps_week_s", "tow", "time_of_week"])
def test_gps_time_is_refused_by_its_name(name: str) -> None:
    rows = flight().with_columns(timestamp=SECONDS + 1_393_200_018.0).rename({"timestamp": name})
    with pytest.raises(DataError, match=r"no column timestamp .* GPS time .1980-01-06, without leap seconds. plus"):
        prepare(rows)
    unix = pl.col(name) + 315_964_782.0
    assert prepare(rows.select(pl.exclude(name), timestamp=unix)).flights == {"A320": 1}


DATES = [f"2024-03-01T10:00:{second:02d}Z" for second in range(10)]
FIRST_S = 1_709_287_200


@pytest.mark.parametrize("odd", ["0", "nan", "inf", "-inf", "17", "N/A", ""])
def test_one_odd_cell_among_dates_is_missing_and_the_others_are_read(odd: str) -> None:
    seconds = timestamps(pl.Series([*DATES, odd])).dt.epoch("s").to_list()
    assert seconds == [*range(FIRST_S, FIRST_S + 10), None]


def test_dates_and_seconds_in_one_column_are_both_read() -> None:
    cells = [date if number % 2 else str(FIRST_S + number) for number, date in enumerate(DATES)]
    assert timestamps(pl.Series(cells)).dt.epoch("s").to_list() == list(range(FIRST_S, FIRST_S + 10))


def test_seconds_of_a_simulator_are_read_beside_blanks() -> None:
    assert timestamps(pl.Series(["0", "4", "", "8", "", "", ""])).dt.epoch("s").to_list()[:4] == [0, 4, None, 8]


def test_dates_of_years_that_python_has_not_are_refused_with_the_first_as_a_number() -> None:
    far = fleet(2).with_columns(timestamp=pl.lit(-7 * 10**18).cast(pl.Datetime("us", "UTC")))
    with pytest.raises(DataError, match=r"values of timestamp cannot be read \(the first: -7000000000000000000\)"):
        read_rows([far], DropReport())


def of_another_receiver(rows: pl.DataFrame, hours: float) -> pl.DataFrame:
    """The same flights by another clock, two seconds and an encoder's step apart."""
    shift = pl.duration(seconds=int(3600 * hours) + 2)
    return rows.with_columns(pl.col("timestamp") + shift, pl.col("altitude") + 25)


@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize("hours", [0.5, 1, 2, 5.5, -1])
def test_each_flight_is_kept_once_and_the_shift_is_named(hours: float, rates: bool) -> None:
    rows = fleet(5).drop(() if rates else "vertical_rate")
    once = prepare(rows)
    with pytest.warns(DescentflowWarning, match=rf"rows that come again {abs(hours):g} h later, of another clock"):
        both = prepare(pl.concat([rows, of_another_receiver(rows, hours)]))
    assert both.flights == once.flights
    step = next(each for each in both.report.steps if each.step == "other_clock")
    assert step.rows_dropped == len(rows)
    if hours > 0:
        assert both.frame["time_s"].to_list() == once.frame["time_s"].to_list()


def test_flights_longer_than_the_shift_are_separated_row_by_row() -> None:
    """Both clocks' rows of one flight lie in each other: half an hour of level flight before the descent."""
    ahead = flight().head(1)
    level = [ahead.with_columns(pl.col("timestamp") - pl.duration(seconds=5 * k)) for k in range(600, 0, -1)]
    rows = pl.concat([*level, flight()])
    with pytest.warns(DescentflowWarning, match=r"come again 0.5 h later"):
        both = prepare(pl.concat([rows, of_another_receiver(rows, 0.5)]))
    assert both.flights == {"A320": 1}
    # Its own level rows half an hour before may stand for a copy: only the first levels depend on them.
    assert len(both.frame) == pytest.approx(len(prepare(rows).frame), abs=10)


def test_alike_flights_of_an_aircraft_an_hour_apart_are_all_kept(recwarn: pytest.WarningsRecorder) -> None:
    other = flight(top_ft=34_000.0, start_s=3600.0).with_columns(pl.col("altitude") * 0.99)
    prepared = prepare(pl.concat([flight(), other]))
    assert prepared.flights == {"A320": 2}
    assert not recwarn.list


def test_flights_at_other_speeds_on_the_hour_are_all_kept(recwarn: pytest.WarningsRecorder) -> None:
    """They pass the same levels at the same times past the hour, as flights of a simulated day may."""
    faster = flight(start_s=3600.0).with_columns(pl.col("IAS") + 6.0)
    assert prepare(pl.concat([flight(), faster])).flights == {"A320": 2}
    assert not recwarn.list
