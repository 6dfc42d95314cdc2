"""Points of so6 and ALL_FT+: read as public readers read them, and seconds between levels of free descents alone."""

import gzip
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from point_toys import flight_of_allft, segments

from descentflow.core.errors import DataError
from descentflow.surveillance.point_profiles.level_times import legs_of_points
from descentflow.surveillance.point_profiles.read_points import holds_points, read_points
from descentflow.surveillance.read_rows import read_table

START = datetime(2026, 1, 1, 23, 55, tzinfo=UTC)


def at(*steps: tuple[float, int]) -> list[tuple[datetime, int]]:
    return [(START + timedelta(seconds=seconds), level) for seconds, level in steps]


DESCENT = at((0, 350), (150, 300), (330, 250), (530, 200))
"""Over midnight."""


def seconds(path: Path, *edges: int) -> list[list[float]]:
    return legs_of_points(read_points(path).points, edges).seconds.tolist()


@pytest.mark.parametrize("kind", ["so6", "so6.gz", "2", "6", "8"])
def test_both_formats_give_the_same_times(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "flights"
    if kind.startswith("so6"):
        text = "\n".join(segments(DESCENT, 7))
    else:
        text = f"{kind}\n" + flight_of_allft(DESCENT, 7, version=int(kind))
    path.write_bytes(gzip.compress(text.encode()) if kind == "so6.gz" else text.encode())
    assert holds_points(path)
    found = read_points(path)
    assert found.points["typecode"].unique().to_list() == ["A320"]
    assert found.points["callsign"].unique().to_list() == ["CS7"]
    # The crossing of FL225 lies in the middle of a pair of 50 levels: too far apart to be interpolated.
    assert seconds(path, 200, 250, 300, 350) == [[200.0, 180.0, 150.0]]
    assert seconds(path, 225, 300) == []


def test_a_segment_starts_where_the_one_before_ended_or_the_chain_is_broken(tmp_path: Path) -> None:
    path = tmp_path / "gap.so6"
    lines = segments(at((0, 300), (60, 280), (120, 260), (180, 240)), 7)
    path.write_text("\n".join([lines[0], *lines[2:]]))
    assert read_points(path).points["segment"].n_unique() == 2
    assert seconds(path, 240, 300) == []
    path.write_text("\n".join([lines[2], lines[0], lines[1]]))  # in any order
    assert seconds(path, 240, 300) == [[180.0]]


@pytest.mark.parametrize(
    ("between", "why"),
    [((150, 290), "level flight"), ((200, 270), "slower than 500 ft/min"), ((100, 295), "a climb")],
)
def test_a_leg_that_is_no_free_descent_is_not_measured(between: tuple[int, int], why: str, tmp_path: Path) -> None:
    path = tmp_path / "level.so6"
    points = at((0, 310), (40, 290), (between[0] + 100, between[1]), (500, 240), (560, 220), (620, 200))
    if why == "slower than 500 ft/min":
        points = at((0, 310), (40, 290), (340, 270), (400, 240), (460, 220), (520, 200))
    path.write_text("\n".join(segments(points, 7)))
    assert seconds(path, 260, 300) == [], why
    assert len(seconds(path, 200, 240)) == 1


def test_what_cannot_be_read_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "odd.so6"
    good = segments(DESCENT, 7)
    impossible = good[0].replace(" 260101 260101 ", " 261301 261301 ").replace(" 7 1 ", " 8 1 ")
    path.write_text("\n".join([*good, "not a segment", impossible]))
    found = read_points(path)
    assert found.report.notes["lines that are no segment of so6"] == 1
    assert found.report.notes["segments of so6 whose date or time cannot be"] == 1
    assert found.points["flight_id"].unique().to_list() == ["7"]


def test_programs_that_write_numbers_leave_out_zeros(tmp_path: Path) -> None:
    path = tmp_path / "short.so6"
    start = datetime(2006, 1, 2, 0, 4, 5, tzinfo=UTC)
    text = segments([(start, 300), (start + timedelta(seconds=55), 280)], 7)[0]
    path.write_text(text.replace(" 000405 000500 ", " 405 500 ").replace(" 060102 060102 ", " 60102 60102 "))
    assert read_points(path).points["timestamp"].to_list() == [start, start + timedelta(seconds=55)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("6\n" + flight_of_allft(DESCENT, 7).replace(";4;", ";5;"), "4 points where 5 are announced"),
        ("6\n" + flight_of_allft(DESCENT, 7, version=8), "no flight in it"),
        ("7\n" + flight_of_allft(DESCENT, 7), "of version 7"),
        ("a,b\n1,2\n", "neither so6 nor"),
        ("", "neither so6 nor"),
    ],
)
def test_what_is_not_of_the_format_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "other"
    path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_points(path)


def test_a_file_that_was_cut_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cut.so6.gz"
    text = "\n".join(line for flight in range(2000) for line in segments(DESCENT, flight))
    packed = gzip.compress(text.encode())
    path.write_bytes(packed[: len(packed) // 2])
    with pytest.raises(DataError, match="a whole file"):
        read_points(path)


def test_rows_are_wanted_where_points_are_given(tmp_path: Path) -> None:
    path = tmp_path / "day.so6"
    path.write_text("\n".join(segments(DESCENT, 7)))
    with pytest.raises(DataError, match=r"no airspeeds.*--real"):
        read_table(path)


def test_types_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "types.so6"
    path.write_text("\n".join([*segments(DESCENT, 7), *segments(DESCENT, 8, "B738")]))
    assert read_points(path).of_type("B738").points["flight_id"].unique().to_list() == ["8"]
    with pytest.raises(DataError, match="without a flight of A380; expected one; there are A320, B738"):
        read_points(path).of_type("A380")


def test_interpolation_between_points_is_that_of_a_constant_rate(tmp_path: Path) -> None:
    path = tmp_path / "fine.so6"
    path.write_text("\n".join(segments(at((0, 262), (20, 254), (50, 244), (80, 232)), 7)))
    # FL250 four tenths into 30 s, FL240 a third into 30 s.
    np.testing.assert_allclose(seconds(path, 240, 250), [[(50 + 10) - (20 + 12)]], atol=1e-6)
