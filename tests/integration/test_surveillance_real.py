"""Real rows through the whole command: what comes out is accounted for and looks like descents."""

import itertools
import json
from pathlib import Path

import polars as pl
import pytest

from descentflow.cli.entry import main
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents

FAMILY = "A319,A320,A321,A20N,A21N"


def run(folder: Path, *words: object) -> Descents:
    out, report = folder / "d.parquet", folder / "r.json"
    assert main(["prepare", *map(str, words), "--out", str(out), "--report", str(report), "--typecode", FAMILY]) == 0
    descents = read_descents(out)
    assert json.loads(report.read_text()) == descents.metadata
    return descents


def check(descents: Descents, bottom_fl: int) -> None:
    frame, report = descents.frame, descents.metadata["report"]
    steps = report["steps"]
    for before, after in itertools.pairwise(steps):
        assert before["rows_left"] == after["rows_left"] + after["rows_dropped"]
        assert after["rows_dropped"] >= 0
        if before["flights_left"] is None:  # flights are not told apart before rows are in order
            assert before["step"] in ("read", "missing_value", "duplicate", "other_clock") or before["step"].startswith(
                "impossible"
            )
        else:
            assert before["flights_left"] == after["flights_left"] + after["flights_dropped"]
            assert after["flights_dropped"] >= 0
    assert steps[-1]["flights_left"] == frame["flight_id"].n_unique()
    assert report["notes"]["levels of the kept descents"] == len(frame)
    assert frame.sort("flight_id", "level_fl", descending=[False, True]).equals(frame)
    assert frame.select("flight_id", "level_fl").is_unique().all()
    assert frame["level_fl"].dtype == pl.Int32
    assert frame["level_fl"].min() == bottom_fl
    assert set(frame["typecode"]) <= set(FAMILY.split(","))
    assert (
        frame.select("flight_id", "icao24", "typecode", "level_fl", "timestamp", "time_s").null_count().row(0)
        == (0,) * 6
    )
    for name, low, high in (("IAS", 130, 360), ("Mach", 0.25, 0.83), ("vertical_rate", -8000, -500)):
        assert frame[name].null_count() == 0
        assert frame[name].is_between(low, high).all(), name
    timed = frame.select(pl.col("time_s").diff().over("flight_id").alias("step"), "flight_id")
    assert (timed["step"].drop_nulls() > 0).all()
    assert (
        frame.group_by("flight_id").agg(pl.col("time_s").min())["time_s"].to_list().count(0.0)
        == frame["flight_id"].n_unique()
    )


@pytest.mark.parametrize("bottom_fl", [100, 150])
def test_embedded_snapshots_give_descents_anywhere(bottom_fl: int, tmp_path: Path) -> None:
    descents = run(tmp_path, "--embedded", "--bottom-fl", bottom_fl)
    check(descents, bottom_fl)
    assert descents.metadata["report"]["steps"][0]["rows_left"] == 12_759, "aircraft in the snapshots"
    assert descents.frame["flight_id"].n_unique() >= {100: 30, 150: 18}[bottom_fl]
    assert [i["name"] for i in descents.metadata["inputs"]] == ["dump1090fa_bengaluru_2023.jsonl.gz"]


def test_dutch_and_embedded_rows_are_pooled(shared: Path, tmp_path: Path) -> None:
    dutch = shared / "real" / "ehs_netherlands_2017-01-11.parquet"
    descents = run(tmp_path, dutch, "--embedded", "--bottom-fl", 100)
    check(descents, 100)
    assert descents.metadata["report"]["steps"][0]["rows_left"] == 12_759 + 24_533
    assert descents.frame["flight_id"].n_unique() >= 45
    assert len(descents.metadata["inputs"]) == 2
    # Position from the embedded snapshots, rate from altitude for the Dutch rows: both are there.
    assert set(descents.frame["timestamp"].dt.year()) == {2017, 2023}
