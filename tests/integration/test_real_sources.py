"""Real files: what is read, units by physics that no reader uses, accounts, and cases that users have met."""

import gzip
import itertools
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from source_toys import possible

from descentflow.cli.entry import main
from descentflow.core.errors import DescentflowWarning
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.surveillance.formats.aircraft_json import embedded_rows
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.air_data import cas_of_mach_kt
from descentflow.surveillance.rows.drop_report import DropReport

FILES = {
    # name: rows read, rows with IAS, Mach and altitude
    "scat_100002.json": (524, 524),
    "scat_100009.json": (588, 588),
    "modes_a319_BAW3AK.jsonl.gz": (4690, 4688),
    "readsb_trace_full_ac671b.json": (2425, 54),
    "ehs_netherlands_2017-01-11.parquet": (24_533, 24_531),
    "dump1090fa_bengaluru_2023.jsonl.gz": (12_759, 6123),
}


def median(values: pl.Series) -> float:
    return float(np.median(values.to_numpy()))


def steps_of(rows: pl.DataFrame) -> pl.DataFrame:
    """Neighbouring rows of an aircraft, 2 to 60 s apart: what altitude and position say of rate and speed."""
    here = rows.sort("icao24", "timestamp").with_columns(
        seconds=pl.col("timestamp").diff().dt.total_microseconds() / 1e6,
        climbed=pl.col("altitude").diff(),
        north=pl.col("latitude").diff() * 60,
        east=pl.col("longitude").diff() * 60 * (pl.col("latitude") * np.pi / 180).cos(),
        same=pl.col("icao24") == pl.col("icao24").shift(),
    )
    return here.filter(pl.col("same") & pl.col("seconds").is_between(2, 60))


@pytest.mark.parametrize("name", FILES)
def test_real_files_are_read_and_their_units_are_right(name: str, shared: Path) -> None:
    path = embedded_rows() if name.startswith("dump") else shared / "real" / name
    read = read_rows([path], DropReport())
    rows = possible(read)
    assert (len(read), len(rows)) == FILES[name]
    high = rows.filter(pl.col("altitude") > 5000)
    ratio = high["IAS"].to_numpy() / cas_of_mach_kt(high["Mach"].to_numpy(), high["altitude"].to_numpy())
    assert np.median(ratio) == pytest.approx(1.0, abs=0.005), "IAS, Mach and pressure say the same"
    assert np.quantile(np.abs(ratio - 1), 0.9) < 0.02
    steps = steps_of(rows)
    if "vertical_rate" in rows.columns:
        moving = steps.filter(pl.col("climbed").abs() > 100).drop_nulls("vertical_rate")
        if len(moving) > 20:
            differenced = moving["climbed"] / moving["seconds"] * 60
            assert median(moving["vertical_rate"] / differenced) == pytest.approx(1.0, abs=0.1)
    fast = steps.filter(pl.col("groundspeed") > 100).drop_nulls(["north", "east"])
    flown = (fast["north"] ** 2 + fast["east"] ** 2).sqrt() / fast["seconds"] * 3600
    assert median(flown / fast["groundspeed"]) == pytest.approx(1.0, abs=0.02)
    if "track" in rows.columns:
        over_ground = np.degrees(np.arctan2(fast["east"].to_numpy(), fast["north"].to_numpy()))
        turned = (over_ground - fast["track"].to_numpy() + 180) % 360 - 180
        assert abs(np.nanmedian(turned)) < 1.0


def test_clearances_of_scat_are_those_that_are_flown(shared: Path) -> None:
    rows = read_rows([shared / "real" / "scat_100009.json"], DropReport())
    mach = rows.filter(pl.col("cleared_mach").is_not_null())
    assert set(mach["cleared_mach"]) == {0.77}
    assert median((mach["Mach"] - mach["cleared_mach"]).abs()) < 0.01
    speed = rows.filter(pl.col("cleared_speed_kt").is_not_null())
    assert set(speed["cleared_speed_kt"]) == {280.0, 210.0, 160.0}
    assert (speed["IAS"] <= speed["cleared_speed_kt"] + 5).mean() > 0.9, "slowing down takes its time"
    # A level is set on the panel soon after it is cleared, and the flight stays above it.
    levels = rows.group_by("cleared_flight_level", maintain_order=True).agg(
        pl.col("selected_altitude").median(), lowest=pl.col("altitude").min()
    )
    descending = levels.filter(pl.col("cleared_flight_level").is_in([190.0, 110.0, 70.0, 40.0]))
    assert descending["selected_altitude"].to_list() == [19_000.0, 11_000.0, 7000.0, 4000.0]
    assert (descending["lowest"] >= 100 * descending["cleared_flight_level"] - 100).all()


def test_frames_alone_give_what_the_receiver_decoded(shared: Path, tmp_path: Path) -> None:
    pytest.importorskip("rs1090")
    path = shared / "real" / "modes_a319_BAW3AK.jsonl.gz"
    with gzip.open(path) as lines:
        messages = [json.loads(line) for line in itertools.islice(lines, 40_000, 65_000)]
    frames = tmp_path / "frames.txt"
    frames.write_text("\n".join(f"{1000 * m['timestamp']} {m['frame']}" for m in messages))  # milliseconds
    report = DropReport()
    received = tmp_path / "received.jsonl"
    received.write_text("\n".join(map(json.dumps, messages)))
    given = read_rows([received], DropReport())
    decoded = read_rows([frames], report)
    assert report.notes["Mode S replies that may be BDS 5,0 or 6,0 and fit neither"] < 100
    assert decoded["latitude"].count() > 0.95 * len(decoded)
    whole = pl.col("timestamp").dt.round("10us")  # what is left of a microsecond in milliseconds
    both = given.with_columns(whole).join(decoded.with_columns(whole), on=["icao24", "timestamp"], suffix="_d")
    assert len(both) > 0.995 * len(given)
    for name, tolerance in {"IAS": 0, "Mach": 1e-9, "altitude": 1e-3, "vertical_rate": 0, "heading": 1e-9}.items():
        assert ((both[name] - both[f"{name}_d"]).abs() > tolerance).sum() == 0, name
    for name in ("TAS", "groundspeed", "roll", "latitude"):
        assert ((both[name] - both[f"{name}_d"]).abs() > 1e-3).sum() < 0.01 * len(both), name


def test_rows_of_frames_are_one_a_second_and_between_altitudes(shared: Path) -> None:
    rows = read_rows([shared / "real" / "modes_a319_BAW3AK.jsonl.gz"], DropReport())
    assert set(rows["icao24"]) == {"400f99"}
    assert set(rows["callsign"]) == {"BAW3AK"}
    seconds = rows["timestamp"].dt.epoch("s")
    assert seconds.is_unique().all()
    # The rate agrees with altitude over half a minute: the altitude is of the same moment as the rate.
    steps = rows.sort("timestamp").select(
        seconds=pl.col("timestamp").diff(10).dt.total_microseconds() / 1e6,
        climbed=pl.col("altitude").diff(10),
        rate=pl.col("vertical_rate").rolling_mean(11),
    )
    usable = steps.filter(pl.col("seconds").is_between(5, 30) & (pl.col("climbed").abs() > 200))
    ratio = usable["climbed"] / usable["seconds"] * 60 / usable["rate"]
    assert median(ratio) == pytest.approx(1.0, abs=0.02)


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
        if before["flights_left"] is None:  # flights are not distinguished before rows are in order
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
