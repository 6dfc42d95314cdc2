"""Cases of damaged sources that users have met, each with its right outcome."""

from pathlib import Path

import polars as pl
import pytest

from descentflow.core.errors import DescentflowWarning
from descentflow.surveillance.prepare import prepare


@pytest.fixture
def cases(shared: Path) -> Path:
    return shared / "cases"


def near(mended: pl.DataFrame, right: pl.DataFrame, name: str, within: float, share: float) -> None:
    """Levels of the right table are there, and most of their values agree."""
    both = right.join(mended, on=["flight_id", "level_fl"], how="left", suffix="_found")
    off = (both[name] - both[f"{name}_found"]).abs() <= within
    assert off.fill_null(False).mean() > share


def test_groundspeed_in_place_of_ias_is_left_out_by_its_name(cases: Path) -> None:
    folder = cases / "24_groundspeed_in_place_of_ias"
    with pytest.warns(DescentflowWarning, match=r"466 values of IAS that equal groundspeed to the digit"):
        prepared = prepare(folder / "no_mach.parquet")
    right = prepare(folder / "right_no_mach.parquet")
    assert prepared.frame["IAS"].max() < 280
    near(prepared.frame, right.frame, "IAS", 3.0, 0.95)


def test_a_rate_that_stands_for_none_costs_no_level(cases: Path) -> None:
    folder = cases / "25_rate_of_minus_64_where_none"
    with pytest.warns(DescentflowWarning, match=r"437 values of vertical_rate that are -64 among others"):
        prepared = prepare(folder / "rows.parquet")
    right = prepare(folder / "right.parquet")
    assert right.frame.height == 1118
    near(prepared.frame, right.frame, "vertical_rate", 150.0, 0.97)


def test_lines_of_pymodes_3_are_read_by_their_frames(cases: Path) -> None:
    pytest.importorskip("rs1090")
    prepared = prepare(cases / "26_lines_of_pymodes_3" / "lines.jsonl", types={"4ca001": "A320"}, bottom_fl=50)
    assert prepared.flights == {"A320": 1}
    assert prepared.frame["IAS"].is_between(269, 271).all()


@pytest.mark.parametrize(("name", "line"), [("last_cut", 256), ("one_a_line", 102)])
def test_a_cut_snapshot_is_left_out_by_its_line(cases: Path, name: str, line: int) -> None:
    prepared = prepare(cases / "27_a_snapshot_cut" / f"{name}.jsonl", bottom_fl=50)
    (note,) = (note for note in prepared.report.notes if note.startswith("JSON lines"))
    assert f"{name}.jsonl, line {line}: not JSON" in note
    assert prepared.report.notes[note] == 1
    assert prepared.frame.height > 190
