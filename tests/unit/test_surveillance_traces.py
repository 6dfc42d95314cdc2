"""Traces of readsb, in trees and archives: the same flight comes back."""

import gzip
import json
from pathlib import Path

import pytest
from source_toys import (
    FLIGHT,
    assert_same_flight,
    packed,
    rows_of,
    tar_of,
    trace_of,
    written_to,
)
from surveillance_toys import flight


@pytest.mark.parametrize("extended", [True, False])
def test_traces(extended: bool, tmp_path: Path) -> None:
    details = 4 if extended else 1
    document = trace_of(FLIGHT, extended=extended, details_every=details)
    if not extended:  # the first layout has airspeeds in the details alone
        for point, ias in zip(document["trace"], FLIGHT["IAS"], strict=True):
            point[8]["ias"] = ias
    found, notes = rows_of(written_to(tmp_path / "trace_full_4ca001.json", packed(document)))
    assert_same_flight(found, timestamp=0.01, Mach=6e-4)
    computed = "trace points whose Mach was computed from IAS and altitude"
    assert notes == ({computed: sum(number % 4 > 0 for number in range(len(FLIGHT)))} if extended else {})
    assert found["callsign"].to_list() == ["TST1"] * len(FLIGHT)
    first = found.row(0, named=True)
    expected = {"temperature": 233.15, "wind_direction": 350, "wind_speed": 20, "heading": 88.5, "TAS": 420}
    expected |= {"selected_altitude": 6000, "groundspeed": 400.5, "latitude": 52, "longitude": 4}
    assert {name: first[name] for name in expected} == pytest.approx(expected)
    if extended:
        assert found["geoaltitude"].to_list() == [point[3] + 800 for point in document["trace"]]
        assert set(found["geometric_rate"]) == {-16.0}
        assert set(found["roll"]) == {-0.4}
    assert set(found["flight_id"]) == {"4ca001_20240301T100000"}


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
    found, notes = rows_of(written_to(tmp_path / "trace_full_4ca001.json", json.dumps(document)))
    assert notes["trace points with a stale position, left out"] == 2
    assert len(found) == len(FLIGHT) - 2
    legs = found["flight_id"].unique(maintain_order=True).to_list()
    assert len(legs) == 3
    assert found["flight_id"].to_list() == [legs[0]] * 19 + [legs[1]] * 10 + [legs[2]] * (len(found) - 29)
    rate, height, ground = (found.row(place - 2, named=True) for place in (42, 43, 50))
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
    found, notes = rows_of(tmp_path)
    assert found["icao24"].unique().sort().to_list() == addresses
    assert len(found) == len(FLIGHT) * len(addresses)
    left_out = notes.pop("members of archives left out: no rows by its name", 0)
    assert left_out == (0 if form == "tree" else 4)
    assert set(notes) == {"trace points whose Mach was computed from IAS and altitude"}
