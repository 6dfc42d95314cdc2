"""Levels: exact interpolation, bridged and open gaps, angles, and the table that is written."""

import json
from pathlib import Path

import polars as pl
import pytest
from refusals import refuses
from surveillance_toys import rows_at

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning._level_grid import to_levels
from descentflow.surveillance.cleaning.filters import SEGMENT
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, top_levels, write_descents
from descentflow.surveillance.rows.drop_report import DropReport


def grid(
    rows: pl.DataFrame, bottom_fl: int = 100, gap_s: float = 60.0, gap_ft: float = 3000.0, slowest_fpm: float = 0.0
) -> pl.DataFrame:
    rules = Cleaning(bottom_fl=bottom_fl, longest_gap_s=gap_s, highest_gap_ft=gap_ft, slowest_fpm=slowest_fpm)
    return to_levels(rows, rules, DropReport())


def test_rows_on_levels_count_once_each_and_need_no_value_of_their_neighbours() -> None:
    levels = grid(
        rows_at([0.0, 10.0, 20.0, 30.0], altitude=[20_000.0, 19_900.0, 19_850.0, 19_800.0], roll=[1.0, 2.0, None, 4.0])
    )
    assert levels["level_fl"].to_list() == [200, 199, 198]
    assert levels["roll"].to_list() == [1.0, 2.0, 4.0]


@pytest.mark.parametrize(("second_s", "second_ft"), [(60.1, 19_000.0), (30.0, 16_999.0)])
def test_gaps_beyond_a_limit_stay_open_and_at_the_limit_are_bridged(second_s: float, second_ft: float) -> None:
    times, heights = [0.0, second_s, second_s + 10], [20_000.0, second_ft, second_ft - 250.0]
    rows = rows_at(times, altitude=heights, IAS=[1.0] * 3)
    low = int(-(-(second_ft - 250.0) // 100))
    assert grid(rows)["level_fl"].to_list() == list(range(int(second_ft // 100), low - 1, -1))
    assert len(grid(rows, gap_s=second_s, gap_ft=20_000 - second_ft)) == 200 - low + 1


def test_a_gap_in_which_a_level_off_may_hide_stays_open() -> None:
    # 375 ft in 50 s are 450 ft/min, with a step of quantisation 480.
    slow = rows_at([0.0, 10.0, 60.0, 70.0], altitude=[20_050.0, 19_850.0, 19_475.0, 19_275.0], IAS=[1.0] * 4)
    levels = grid(slow, slowest_fpm=500.0)
    assert levels["level_fl"].to_list() == [200, 199, 194, 193]
    assert len(grid(slow)) == 8
    # 400 ft may have been 425: 510 ft/min.
    fast = slow.with_columns(altitude=pl.Series([20_050.0, 19_850.0, 19_450.0, 19_275.0]))
    assert len(grid(fast, slowest_fpm=500.0)) == 8
    # Within 10 s, quantisation may hold an altitude for long.
    held = rows_at([0.0, 10.0, 20.0], altitude=[20_050.0, 20_025.0, 19_850.0], IAS=[1.0] * 3)
    assert len(grid(held, slowest_fpm=500.0)) == 2


def test_levels_between_two_stretches_stay_open() -> None:
    rows = rows_at([0.0, 10.0, 20.0, 30.0], altitude=[20_050.0, 19_850.0, 19_650.0, 19_450.0], IAS=[1.0] * 4)
    parted = rows.with_columns(pl.Series(SEGMENT, [0, 0, 1, 1]))
    assert grid(rows)["level_fl"].to_list() == [200, 199, 198, 197, 196, 195]
    assert grid(parted)["level_fl"].to_list() == [200, 199, 196, 195]


def test_flights_are_not_bridged_and_the_bottom_cuts() -> None:
    two = pl.concat([rows_at([0.0, 10.0], name, altitude=[10_350.0, 9_850.0], IAS=[1.0, 2.0]) for name in "ab"])
    levels = grid(two)
    assert levels.select("flight_id", "level_fl").rows() == [(f, fl) for f in "ab" for fl in (103, 102, 101, 100)]
    assert len(grid(two, bottom_fl=300)) == 0
    assert len(grid(two.clear())) == 0
    assert len(grid(two.head(1))) == 0


def test_angles_go_the_short_way_round() -> None:
    levels = grid(rows_at([0.0, 10.0], altitude=[20_000.0, 19_800.0], track=[350.0, 20.0], roll=[-10.0, 10.0]))
    assert levels["track"].to_list() == pytest.approx([350.0, 5.0, 20.0])
    assert levels["roll"].to_list() == pytest.approx([-10.0, 0.0, 10.0])


def test_longitudes_go_across_the_date_line() -> None:
    levels = grid(
        rows_at([0.0, 10.0, 20.0], altitude=[20_000.0, 19_800.0, 19_600.0], longitude=[179.8, -179.8, -179.0])
    )
    assert levels["longitude"].to_list() == pytest.approx([179.8, -180.0, -179.8, -179.4, -179.0])


def test_the_top_is_the_highest_level_of_a_quarter_of_the_flights() -> None:
    tops = [390, 380, 370, 360, 350]
    frame = pl.DataFrame(
        {"typecode": ["A320"] * 5, "flight_id": list("abcde"), "level_fl": pl.Series(tops, dtype=pl.Int32)}
    )
    # Of five flights two are the first to be a quarter; of four, one.
    assert top_levels(frame) == {"A320": 380}
    assert top_levels(frame.head(4)) == {"A320": 390}


@pytest.fixture
def descents() -> Descents:
    levels = grid(rows_at([0.0, 40.0], altitude=[20_050.0, 19_650.0], IAS=[250.0, 251.0], Mach=[0.55, 0.54]))
    frame = levels.with_columns(vertical_rate=pl.lit(-600.0))
    return Descents(frame, {"schema_version": 1, "bottom_fl": 100, "top_fl": {"A320": 200}})


def test_what_is_no_table_of_descents_is_refused(descents: Descents, tmp_path: Path) -> None:
    path = tmp_path / "d.parquet"
    refuses(DataError, "no file", read_descents, path)
    path.write_bytes(b"PAR1 not so")
    refuses(DataError, "whole Parquet file", read_descents, path)
    descents.frame.write_parquet(path)
    refuses(DataError, "not prepared descents", read_descents, path)
    write_descents(Descents(descents.frame, descents.metadata | {"schema_version": 99}), path)
    refuses(DataError, "schema version 99", read_descents, path)
    write_descents(Descents(descents.frame.drop("Mach"), descents.metadata), path)
    refuses(DataError, "no column Mach", read_descents, path)
    write_descents(Descents(descents.frame.clear(), descents.metadata), path)
    refuses(DataError, "no descent", read_descents, path)
    for text in ("not JSON", "[1]"):
        descents.frame.write_parquet(path, metadata={"descentflow": text})
        refuses(DataError, "description", read_descents, path)


def test_the_account_adds_up_and_prints() -> None:
    before = pl.DataFrame({"flight_id": ["a", "a", "b"]})
    report = DropReport()
    report.count("early", before, before)
    assert (report.steps[0].rows_left, report.steps[0].flights_left) == (3, None), "flights are not distinguished yet"
    report.by_flight = True
    assert report.count("none", before, before) is before
    report.count("half", before, before.head(2))
    report.note("changed", 0)
    report.note("changed", 2)
    report.note("changed", 3)
    steps = json.loads(json.dumps(report.as_dict()))["steps"]
    assert steps[2] == {"step": "half", "rows_dropped": 1, "flights_dropped": 1, "rows_left": 2, "flights_left": 1}
    assert report.notes == {"changed": 5}
    assert "changed: 5" in str(report)
    assert len({len(line) for line in str(report).splitlines()[:3]}) == 1, "columns must line up"
