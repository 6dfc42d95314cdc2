"""Times that count from the begin of a flight are refused where they would shuffle flights into each other."""

from pathlib import Path

import polars as pl
import pytest
from surveillance_toys import flight, written

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning._flights import BEFORE_1990
from descentflow.surveillance.prepare import prepare

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
    assert prepare(rows).flights == {"A320": 2}, "flights that are named are told apart"


def test_one_clock_for_all_rows_is_taken_in_any_order(tmp_path: Path) -> None:
    rows = pl.concat(flight(start_s=7200.0 * number) for number in range(2)).with_columns(timestamp=SECONDS)
    assert prepare(rows).flights == prepare(rows.sample(fraction=1.0, shuffle=True, seed=0)).flights == {"A320": 2}
    half = len(rows) // 2
    paths = [written(part, tmp_path / f"{name}.csv") for name, part in (("a", rows[:half]), ("b", rows[half:]))]
    assert prepare(paths).flights == {"A320": 2}, "files of one recording"


@pytest.mark.parametrize("begin_s", [0.0, 468_000.0, 600_000_000.0], ids=["start", "GPS week", "1989"])
def test_a_clock_without_a_date_is_read_and_said(begin_s: float) -> None:
    rows = flight().with_columns(timestamp=SECONDS + begin_s)
    found = prepare(rows)
    assert found.flights == {"A320": 1}
    assert found.report.notes[BEFORE_1990] == len(rows)
    assert BEFORE_1990 not in prepare(flight()).report.notes


@pytest.mark.parametrize("name", ["gps_time", "GPS_seconds", "gps_week_s", "tow", "time_of_week"])
def test_gps_time_is_refused_by_its_name(name: str) -> None:
    rows = flight().with_columns(timestamp=SECONDS + 1_393_200_018.0).rename({"timestamp": name})
    with pytest.raises(DataError, match=r"no column timestamp .* GPS time .1980-01-06, without leap seconds. plus"):
        prepare(rows)
    unix = pl.col(name) + 315_964_782.0
    assert prepare(rows.select(pl.exclude(name), timestamp=unix)).flights == {"A320": 1}
