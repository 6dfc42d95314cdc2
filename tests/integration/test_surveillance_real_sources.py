"""Real files of each source: what is read, and that its units are right by physics that the reader does not use."""

import gzip
import itertools
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from source_toys import possible

from descentflow.surveillance.formats.aircraft_json import embedded_rows
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
