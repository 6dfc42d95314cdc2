"""Rows in order, flights separated, types joined, rates derived, questions asked flight by flight."""

import numpy as np
import polars as pl
import pytest
from surveillance_toys import flight, rows_at

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning._flights import (
    in_order,
    name_flights,
    names_given,
    names_shared,
    of_types,
    usable,
    with_types,
)
from descentflow.surveillance.cleaning.rates import local_slope, with_rate
from descentflow.surveillance.descents._check_descents import checked_descents
from descentflow.surveillance.rows._addresses import types_held
from descentflow.surveillance.rows.drop_report import DropReport


def named(rows: pl.DataFrame, gap_s: float = 900.0) -> pl.DataFrame:
    return name_flights(rows, gap_s, names_shared(names_given(rows)), DropReport())


def test_unusable_rows_and_duplicates_count_each_kind_of_bad_row_once() -> None:
    good = flight().head(20)
    index = pl.int_range(pl.len())
    bad = good.with_columns(
        IAS=pl.when(index == 1).then(None).when(index == 2).then(39.0).otherwise("IAS"),
        Mach=pl.when(index == 3).then(1.01).otherwise("Mach"),
        altitude=pl.when(index == 4).then(60_001.0).otherwise("altitude"),
        TAS=pl.when(index == 5).then(-3.0).otherwise(400.0),
        icao24=pl.when(index == 6).then(None).otherwise("icao24"),
    )
    report = DropReport()
    rows = in_order(usable(pl.concat([bad.slice(10), bad.head(10), bad.slice(8, 3)]), report), report)
    counts = {step.step: step.rows_dropped for step in report.steps}
    assert counts == {
        "read": 0,
        "missing_value": 2,
        "impossible_altitude": 1,
        "impossible_IAS": 1,
        "impossible_Mach": 1,
        "duplicate": 3,
    }
    assert rows["timestamp"].is_sorted()
    assert len(rows) == 15
    assert rows["TAS"].null_count() == 1
    assert report.notes["impossible values of TAS set to missing"] == 1
    # In time order row 9 comes before the second row 8 in the input, row 10 before row 9's, and row 11 before row 10's.
    assert report.notes["rows put into time order"] == 3


def test_flights_are_named_by_address_and_first_time_and_end_with_silence() -> None:
    rows = rows_at([0.0, 900.0, 1801.0], altitude=[1.0, 2.0, 3.0]).drop("flight_id")
    given = named(rows)
    assert given["flight_id"].to_list() == ["4ca001_20240301T100000"] * 2 + ["4ca001_20240301T103001"]
    assert named(rows, 1e9)["flight_id"].n_unique() == 1


def test_names_given_are_kept_missing_ones_made_and_shared_ones_parted() -> None:
    rows = pl.concat(
        [rows_at([0.0, 10.0], "AB1", altitude=[1.0, 2.0]), rows_at([5.0, 15.0], "AB1", altitude=[3.0, 4.0])]
    )
    rows = rows.with_columns(icao24=pl.Series(["4ca001", "4ca001", "4ca002", "4ca002"]))
    assert named(rows.head(2))["flight_id"].to_list() == ["AB1", "AB1"]
    assert named(rows)["flight_id"].to_list() == ["AB1_4ca001"] * 2 + ["AB1_4ca002"] * 2
    blank = rows.head(2).with_columns(flight_id=pl.lit(None, pl.String))
    assert named(blank)["flight_id"].n_unique() == 1


def test_types_of_the_rows_go_before_those_of_the_table() -> None:
    rows = pl.DataFrame({"icao24": ["00000a", "00000b", "00000c"], "typecode": ["b738", None, None]})
    rows = rows.with_columns(flight_id=pl.Series(["x", "y", "z"]))
    table = pl.DataFrame({"icao24": [" A", "B ", "b"], "typecode": ["A320", "a319 ", "A321"]})
    assert with_types(rows, types_held(table), DropReport())["typecode"].to_list() == ["B738", "A319", None]
    assert with_types(rows.drop("typecode"), None, DropReport())["typecode"].to_list() == [None] * 3
    with pytest.raises(DataError, match="without typecode"):
        types_held(table.drop("typecode"))


def test_types_wanted_are_kept_in_any_case_of_letters() -> None:
    rows = pl.DataFrame({"flight_id": list("xyz"), "icao24": ["a", "b", "c"], "typecode": ["B738", "A320", None]})
    report = DropReport(by_flight=True)
    assert of_types(rows, ["a320"], report)["icao24"].to_list() == ["b"]
    assert [(s.step, s.rows_dropped, s.flights_dropped) for s in report.steps] == [
        ("unknown_type", 1, 1),
        ("other_type", 1, 1),
    ]


def test_a_given_name_that_looks_made_for_another_aircraft_gets_its_address() -> None:
    rows = rows_at([0.0, 10.0], "4ca002_20240301T100000", altitude=[1.0, 2.0])
    assert names_shared(names_given(rows)).to_list() == ["4ca002_20240301T100000"]
    own = rows.with_columns(flight_id=pl.lit("4ca001_20240301T100000"))
    assert names_shared(names_given(own)).to_list() == []
    assert names_given(rows.drop("flight_id")).is_empty()


def test_rates_given_stay_and_missing_ones_are_the_slope() -> None:
    times = [2.0 * i for i in range(40)]
    rows = rows_at(times, altitude=[30_000 - 25 * t for t in times], vertical_rate=[-1.0] * 20 + [None] * 20)
    rates = with_rate(rows)["vertical_rate"].to_list()
    assert rates[:20] == [-1.0] * 20
    assert rates[20:] == pytest.approx([-1500.0] * 20, rel=1e-9)
    assert with_rate(rows.drop("vertical_rate"))["vertical_rate"].to_list() == pytest.approx([-1500.0] * 40, rel=1e-9)


def test_no_rate_is_made_from_too_few_rows_or_across_flights() -> None:
    # 25 ft of rounding make 50 ft/min of two reports 12.2 s apart, less of more or of reports further apart.
    assert np.isnan(local_slope(np.zeros(2), np.array([0.0, 12.2]), np.arange(2.0))).all()
    assert not np.isnan(local_slope(np.zeros(2), np.array([0.0, 12.3]), np.arange(2.0))).any()
    flights = np.repeat([0, 1, 2], 2)
    assert np.isnan(local_slope(flights, np.tile([0.0, 10.0], 3), np.arange(6.0))).all()
    assert np.isnan(local_slope(np.zeros(9), np.arange(9.0) * 90, np.arange(9.0))).all(), "90 s apart is too far"


@pytest.mark.parametrize("every_s", [0.1, 0.5, 1.0, 4.0, 12.0])
def test_a_quantised_ramp_gives_its_rate_within_a_bound(every_s: float) -> None:
    seconds = np.arange(0, 300, every_s)
    altitude = 25 * np.round((30_000 - 33.3 * seconds) / 25)
    slope = 60 * local_slope(np.zeros(len(seconds)), seconds, altitude)
    # Rounding's standard error is at most 50 ft/min, were it independent. It is not where reports are close; bounded by
    # 12.5 ft it tilts a line over a span T by at most 3/2 * 25 ft / T, and the shortest span is 10 s.
    assert np.nanmax(np.abs(slope + 1998)) <= 1.5 * 25 / 10 * 60
    assert np.median(np.abs(slope + 1998)) < 50
    assert not np.isnan(slope).any()


def test_a_level_twice_is_found_where_the_rows_of_a_flight_stand_apart() -> None:
    names, levels = ["a", "a", "b", "a"], [202, 201, 202, 200]
    apart = pl.DataFrame({"flight_id": names, "level_fl": levels, "time_s": [0.0, 2.0, 0.0, 4.0]})
    apart = apart.with_columns(pl.col("level_fl").cast(pl.Int32), icao24=pl.lit("4ca001"), IAS=270.0, Mach=0.55)
    begun = pl.datetime(2026, 1, 1, time_unit="us", time_zone="UTC")
    apart = apart.with_columns(begun.alias("timestamp"), typecode=pl.lit("A320"), vertical_rate=-3000.0)
    assert checked_descents(apart, "apart").equals(apart)
    with pytest.raises(DataError, match="has 1 levels twice in one flight"):
        checked_descents(pl.concat([apart, apart.head(1)]), "apart")
