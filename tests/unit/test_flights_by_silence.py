"""A name stands for one flight: it ends with silence, and a trace's end of day ends none."""

from datetime import UTC, datetime
from pathlib import Path

import polars as pl
from source_toys import packed, trace_of
from surveillance_toys import START, flight, rows_at

from descentflow.surveillance.cleaning._flights import (
    OVER_MIDNIGHT,
    PART_OF,
    SEPARATED_FLIGHTS,
    name_flights,
    names_given,
    names_shared,
    separated,
)
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport

DAY_S = 86_400.0


def named(rows: pl.DataFrame, gap_s: float = 900.0) -> pl.DataFrame:
    return name_flights(rows, gap_s, names_shared(names_given(rows)), DropReport())


def test_a_name_that_comes_again_gives_as_many_descents_as_no_name() -> None:
    days = pl.concat(flight(address, start_s=day * DAY_S) for address in ("4ca001", "4ca002") for day in range(3))
    without = prepare(days)
    for again in (pl.lit("F1"), pl.col("icao24"), pl.col("callsign")):
        named = prepare(days.with_columns(flight_id=again))
        assert named.flights == without.flights == {"A320": 6}
        assert named.frame.drop("flight_id").equals(without.frame.drop("flight_id"))
        assert named.report.notes[SEPARATED_FLIGHTS] == 6
        dropped = {step.step: step.rows_dropped for step in named.report.steps}
        assert dropped["second_descent"] == 0, "the report says what became of the flights"


def test_names_of_parts_are_made_of_name_address_and_time_and_are_shared_with_nobody() -> None:
    rows = rows_at([0.0, 900.0, 1801.0], "AB1", altitude=[3.0, 2.0, 1.0])
    first, part = "AB1_4ca001_20240301T100000", "AB1_4ca001_20240301T103001"
    assert named(rows)["flight_id"].to_list() == [first, first, part]
    own = rows.with_columns(flight_id=pl.lit("4ca001_20240301T090000"))
    assert named(own)["flight_id"].to_list() == [part.removeprefix("AB1_").replace("103001", "100000")] * 2 + [
        part.removeprefix("AB1_")
    ]
    elsewhere = rows.with_columns(flight_id=pl.lit(part), icao24=pl.lit("4ca002"))
    assert names_shared(names_given(elsewhere)).to_list() == [part], (
        "another aircraft's flight may be called so already"
    )
    assert PART_OF not in separated(rows, 1e9, DropReport()).columns


def test_a_flight_with_a_long_gap_before_its_descent_keeps_its_name() -> None:
    descent = flight(start_s=2000.0)
    cruise = descent.head(3).with_columns(timestamp=pl.col("timestamp") - pl.duration(seconds=1500))
    rows = pl.concat([cruise, descent]).with_columns(flight_id=pl.lit("AB1"))
    assert prepare(rows).frame["flight_id"].unique().to_list() == ["AB1"]


def test_a_flight_over_midnight_is_one_in_the_traces_of_two_days(tmp_path: Path) -> None:
    until_midnight_s = (datetime(2024, 3, 2, tzinfo=UTC) - START).total_seconds()
    whole = flight(start_s=until_midnight_s - 600.0)
    midnight = pl.col("timestamp") < pl.lit(datetime(2024, 3, 2, tzinfo=UTC))
    for day, rows in enumerate((whole.filter(midnight), whole.filter(~midnight))):
        folder = tmp_path / f"2024-03-0{day + 1}" / "01"
        folder.mkdir(parents=True)
        (folder / "trace_full_4ca001.json").write_bytes(packed(trace_of(rows)))
    single = tmp_path / "one"
    single.mkdir()
    (single / "trace_full_4ca001.json").write_bytes(packed(trace_of(whole)))
    expected = prepare(single).frame
    prepared = prepare([tmp_path / "2024-03-01", tmp_path / "2024-03-02"])
    assert prepared.frame["flight_id"].unique().to_list() == expected["flight_id"].unique().to_list()
    assert prepared.frame["level_fl"].equals(expected["level_fl"])
    assert prepared.report.notes[OVER_MIDNIGHT] == 1


def test_legs_of_one_day_and_after_silence_stay_apart() -> None:
    report = DropReport()
    times = [
        (datetime(2024, 3, 2, tzinfo=UTC) - START).total_seconds() + seconds for seconds in (-300, -200, 700.1, 800)
    ]
    legs = ["4ca001_20240301T235500", "4ca001_20240301T235640", "4ca001_20240302T001140", "4ca001_20240302T001320"]
    rows = rows_at(times, altitude=[4.0, 3.0, 2.0, 1.0]).with_columns(flight_id=pl.Series(legs))
    assert separated(rows, 900.0, report)["flight_id"].to_list() == legs
    assert report.notes == {}
