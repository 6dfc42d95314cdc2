"""Traces of readsb in trees and archives, and files at addresses of fsspec: the same flight comes back."""

import gc
import gzip
import json
from pathlib import Path

import fsspec
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from source_toys import FLIGHT, assert_same_flight, packed, rows_of, tar_of, trace_of, written_to
from surveillance_toys import fleet, flight, written

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core import _remote_files
from descentflow.core.errors import ConfigError, DataError


@pytest.mark.parametrize("extended", [True, False])
def test_traces(extended: bool, tmp_path: Path) -> None:
    details = 4 if extended else 1
    document = trace_of(FLIGHT, extended=extended, details_every=details)
    if not extended:  # the first layout has airspeeds in the details alone
        for point, ias in zip(document["trace"], FLIGHT["IAS"], strict=True):
            point[8]["ias"] = ias
    decoded, notes = rows_of(written_to(tmp_path / "trace_full_4ca001.json", packed(document)))
    assert_same_flight(decoded, timestamp=0.01, Mach=6e-4)
    computed = "trace points whose Mach was computed from IAS and altitude"
    assert notes == ({computed: sum(number % 4 > 0 for number in range(len(FLIGHT)))} if extended else {})
    assert decoded["callsign"].to_list() == ["TST1"] * len(FLIGHT)
    first = decoded.row(0, named=True)
    expected = {"temperature": 233.15, "wind_direction": 350, "wind_speed": 20, "heading": 88.5, "TAS": 420}
    expected |= {"selected_altitude": 6000, "groundspeed": 400.5, "latitude": 52, "longitude": 4}
    assert {name: first[name] for name in expected} == pytest.approx(expected)
    if extended:
        assert decoded["geoaltitude"].to_list() == [point[3] + 800 for point in document["trace"]]
        assert set(decoded["geometric_rate"]) == {-16.0}
        assert set(decoded["roll"]) == {-0.4}
    assert set(decoded["flight_id"]) == {"4ca001_20240301T100000"}


def test_flags_of_points_are_honoured(tmp_path: Path) -> None:
    document = trace_of(FLIGHT)
    points = document["trace"]
    points[10][6] = 1  # stale
    points[20][6] = 2  # a new leg
    points[30][6] = 3  # both: the leg begins, the point is left out
    points[42][6], points[42][8] = 4, None  # a geometric rate
    points[43][6] = 8  # a geometric altitude
    points[50][3] = "ground"
    points[51][6] = None
    decoded, notes = rows_of(written_to(tmp_path / "trace_full_4ca001.json", json.dumps(document)))
    assert notes["trace points with a stale position, left out"] == 2
    assert len(decoded) == len(FLIGHT) - 2
    legs = decoded["flight_id"].unique(maintain_order=True).to_list()
    assert len(legs) == 3
    assert decoded["flight_id"].to_list() == [legs[0]] * 19 + [legs[1]] * 10 + [legs[2]] * (len(decoded) - 29)
    rate, height, ground = (decoded.row(place - 2, named=True) for place in (42, 43, 50))
    assert rate["vertical_rate"] is None
    assert rate["geometric_rate"] == -16.0
    assert height["altitude"] is None
    assert ground["altitude"] is None
    assert ground["track"] is None, "on the ground it is a heading"


@pytest.mark.parametrize("form", ["tree", "tar", "tar.gz"])
def test_trees_and_archives_of_traces(form: str, tmp_path: Path) -> None:
    addresses = [f"4ca{number:03x}" for number in range(6)]
    names = [f"./traces/{address[-2:]}/trace_full_{address}.json" for address in addresses]
    contents = [packed(trace_of(flight(address))) for address in addresses]
    beside = [("./heatmap/00.bin.ttf", b"\0\1\2"), ("./acas/acas.csv", b"a,b\n1,2\n"), ("./README.md", b"words")]
    beside += [(names[0].replace("full", "recent"), contents[0])]
    archive = tar_of([*zip(names, contents, strict=True), *beside])
    if form == "tree":
        for name, content in [*zip(names, contents, strict=True), *beside]:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_bytes(content)
    else:
        written_to(tmp_path / f"day.{form}", gzip.compress(archive) if form == "tar.gz" else archive)
    decoded, notes = rows_of(tmp_path)
    assert decoded["icao24"].unique().sort().to_list() == addresses
    assert len(decoded) == len(FLIGHT) * len(addresses)
    left_out = notes.pop("members of archives left out: no rows by its name", 0)
    assert left_out == (0 if form == "tree" else 4)
    assert set(notes) == {"trace points whose Mach was computed from IAS and altitude"}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> fsspec.AbstractFileSystem:
    monkeypatch.chdir(tmp_path)
    written(fleet(12), tmp_path / "rows.parquet")
    files = fsspec.filesystem("memory")
    files.put(str(tmp_path / "rows.parquet"), "/bucket/rows/rows.parquet")
    yield files
    files.rm("/bucket", recursive=True)


def test_rows_and_stores_elsewhere_are_those_of_local_files(place: fsspec.AbstractFileSystem, tmp_path: Path) -> None:
    here = df.prepare("rows.parquet", out="store")
    prepared = df.prepare("memory://bucket/rows", out="memory://bucket/store")
    assert_frame_equal(prepared.frame, here.frame, check_exact=True)
    for path in (tmp_path / "store").rglob("*.*"):
        assert place.cat(f"/bucket/store/{path.relative_to(tmp_path / 'store').as_posix()}") == path.read_bytes()
    assert_frame_equal(df.read_descents("memory://bucket/store").frame, here.frame, check_exact=True)
    said: list[str] = []
    df.prepare("memory://bucket/rows", out=Path("memory://bucket/store"), progress=said.append)
    assert said[-1] == "found finished"
    with pytest.raises(ConfigError, match="a store of other inputs or settings"):
        df.prepare("memory://bucket/rows", bottom_fl=200, out="memory://bucket/store")
    del prepared
    gc.collect()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rows.parquet", "store"]


def test_commands_take_and_write_addresses(place: fsspec.AbstractFileSystem, tmp_path: Path, capsys) -> None:
    assert main(["prepare", "memory://bucket/rows/rows.parquet", "--out", "memory://bucket/d.parquet"]) == 0
    assert "sent to memory://bucket/d.parquet" in capsys.readouterr().out
    with place.open("/bucket/d.parquet") as file:
        assert "flight_id" in pl.read_parquet(file).columns
    assert main(["prepare", "memory://bucket/absent.parquet", "--out", "memory://bucket/e.parquet"]) == 2
    assert "memory://bucket/absent.parquet: FileNotFoundError" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["rows.parquet"]


def test_what_could_not_be_sent_stays_for_the_same_call(
    place: fsspec.AbstractFileSystem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(type(place), "put_file", lambda *_: (_ for _ in ()).throw(PermissionError("denied")))
        with pytest.raises(DataError, match="memory://bucket: PermissionError: denied"):
            df.prepare("memory://bucket/rows", out="memory://bucket/store")
    assert len(list((tmp_path / _remote_files.COPIES_FOLDER).glob("*/store/_descentflow.json"))) == 1
    said: list[str] = []
    df.prepare("memory://bucket/rows", out="memory://bucket/store", progress=said.append)
    assert said[-1] == "found finished"
    assert place.exists("/bucket/store/_descentflow.json")


def test_a_protocol_without_its_library_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(__import__("sys").modules, "s3fs", None)
    with pytest.raises(ConfigError, match="pip install s3fs"):
        df.prepare("s3://bucket/rows.parquet")
    assert list(tmp_path.iterdir()) == []
