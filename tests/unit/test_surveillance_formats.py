"""Each source from a file that is made as the source makes it: the same flight comes back."""

import gzip
import io
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from source_toys import (
    all_call,
    cat048,
    cat062,
    packed,
    register_50,
    register_60,
    reply,
    scat_of,
    snapshots_of,
    tar_of,
    trace_of,
    written_to,
)
from surveillance_toys import START, flight

from descentflow.core.errors import ConfigError, DataError
from descentflow.surveillance.formats.json_values import numbers, table, texts
from descentflow.surveillance.formats.known_formats import FORMATS
from descentflow.surveillance.formats.mode_s_registers import values_of
from descentflow.surveillance.read_rows import read_rows, row_blocks
from descentflow.surveillance.rows.air_data import cas_of_mach_kt, isa_tas_of_mach_kt, mach_of_cas
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.source_files import with_parts

FLIGHT = flight()
SHARED_COLUMNS = ("timestamp", "icao24", "callsign", "typecode", "altitude", "vertical_rate", "IAS", "Mach", "track")


def rows_of(path: Path, **options: object) -> tuple[pl.DataFrame, dict[str, int]]:
    report = DropReport()
    return read_rows([path], report, **options), report.notes


def same(found: pl.DataFrame, **tolerances: float) -> None:
    """Columns that all sources share are those of the flight, within a source's quantum."""
    assert len(found) == len(FLIGHT)
    for name in ("icao24", "typecode"):
        assert found[name].to_list() == FLIGHT[name].to_list()
    late = (found["timestamp"] - FLIGHT["timestamp"]).dt.total_microseconds().abs().max()
    assert late <= 1e6 * tolerances.pop("timestamp", 1e-6)
    for name, tolerance in {"altitude": 0.5, "vertical_rate": 0.5, "IAS": 1e-9, "Mach": 1e-9, **tolerances}.items():
        assert (found[name] - FLIGHT[name]).abs().max() <= tolerance, name


# Tables -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("packing", ["plain", "gzip", "tar", "tar.gz"])
@pytest.mark.parametrize("kind", ["parquet", "feather", "csv", "json-rows", "json-lines", "json-columns"])
def test_tables_in_every_packing(kind: str, packing: str, tmp_path: Path) -> None:
    content = io.BytesIO()
    if kind == "parquet":
        FLIGHT.write_parquet(content)
    elif kind == "feather":
        FLIGHT.write_ipc(content)
    elif kind == "csv":
        FLIGHT.write_csv(content)
    else:  # pandas writes times as milliseconds
        rows = FLIGHT.with_columns(pl.col("timestamp").dt.epoch("ms")).to_dicts()
        columns = {name: {str(place): row[name] for place, row in enumerate(rows)} for name in FLIGHT.columns}
        documents = {"json-rows": [rows], "json-lines": rows, "json-columns": [columns]}[kind]
        content.write("\n".join(map(json.dumps, documents)).encode())
    whole = content.getvalue()
    if packing.startswith("tar"):
        whole = tar_of([("./day/rows", whole), ("README.md", b"not rows")])
    path = written_to(tmp_path / "rows", gzip.compress(whole) if packing.endswith("gz") or packing == "gzip" else whole)
    found, notes = rows_of(path)
    assert_frame_equal(found, FLIGHT, check_exact=not kind.startswith("json"))
    assert set(notes) <= {"members of archives left out: no rows by its name"}
    named, _ = rows_of(path, format="json-rows" if kind.startswith("json") else kind)
    assert_frame_equal(named, found)


def test_blocks_bound_what_is_held_and_lose_nothing(tmp_path: Path) -> None:
    FLIGHT.write_parquet(tmp_path / "a.parquet", row_group_size=50)
    FLIGHT.with_columns(icao24=pl.lit("4ca002")).write_csv(tmp_path / "b.csv")
    blocks = list(row_blocks([tmp_path], DropReport(), block_rows=64))
    assert max(map(len, blocks)) <= 64
    whole = pl.concat(blocks)
    assert_frame_equal(whole.filter(icao24="4ca001"), FLIGHT)
    assert len(whole) == 2 * len(FLIGHT)
    with pytest.raises(ConfigError, match="blocks of 0 rows"):
        next(row_blocks([tmp_path], DropReport(), block_rows=0))


def test_csv_is_cut_between_rows_and_never_inside_quotes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("descentflow.surveillance.formats.tables.CSV_BYTES", 1000)
    quoted = FLIGHT.with_columns(callsign=pl.lit('TST "1"\n,\n'))
    quoted.write_csv(tmp_path / "rows.csv")
    found, _ = rows_of(tmp_path / "rows.csv")
    assert_frame_equal(found, FLIGHT.with_columns(callsign=pl.lit('TST "1"\n,')))


def test_a_format_that_there_is_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no format 'xlsx'; expected one of parquet, feather, csv"):
        rows_of(tmp_path, format="xlsx")
    assert all(one.meaning for one in FORMATS.values())


def test_state_vectors_that_opensky_repeats_are_left_out(tmp_path: Path) -> None:
    seconds = FLIGHT["timestamp"].dt.epoch("s")
    vectors = FLIGHT.select(
        time=seconds,
        lastcontact=pl.when(pl.int_range(pl.len()) < 10).then(seconds - 11).otherwise(seconds - 0.4),
        icao24="icao24",
        baroaltitude=pl.col("altitude") * 0.3048,
        velocity=pl.lit(205.7776),
        heading="track",
        vertrate=pl.col("vertical_rate") * 0.00508,
        ias="IAS",
        mach="Mach",
    )
    vectors.write_parquet(tmp_path / "states.parquet")
    found, notes = rows_of(tmp_path / "states.parquet")
    assert notes == {"state vectors without a message for 10 s, left out": 10}
    assert np.allclose(found["altitude"], FLIGHT["altitude"][10:])
    assert np.allclose(found["vertical_rate"], FLIGHT["vertical_rate"][10:], atol=1e-6)
    assert np.allclose(found["groundspeed"], 400.0)
    assert found["track"].to_list() == FLIGHT["track"][10:].to_list()


def test_a_headwind_is_not_taken_for_metres_a_second(tmp_path: Path) -> None:
    airspeed = isa_tas_of_mach_kt(FLIGHT["Mach"].to_numpy(), FLIGHT["altitude"].to_numpy())
    slow = FLIGHT.with_columns(groundspeed=0.6 * airspeed)
    slow.write_parquet(tmp_path / "rows.parquet")
    assert len(rows_of(tmp_path / "rows.parquet")[0]) == len(FLIGHT)
    aircraft = [slow.with_columns(icao24=pl.lit(f"4ca00{number}")) for number in range(3)]
    pl.concat(aircraft).write_parquet(tmp_path / "rows.parquet")
    with pytest.raises(DataError, match="groundspeed seems to be in m/s"):
        rows_of(tmp_path / "rows.parquet")


def test_names_of_registers_in_traffic_and_pymodes(tmp_path: Path) -> None:
    renamed = FLIGHT.rename({"vertical_rate": "vrate_barometric", "track": "true_track"})
    renamed = renamed.with_columns(selected_mcp=6000.0, magnetic_heading=88.0)
    renamed.write_parquet(tmp_path / "rows.parquet")
    found, _ = rows_of(tmp_path / "rows.parquet")
    assert_frame_equal(found.select(FLIGHT.columns), FLIGHT)
    assert found["selected_altitude"].to_list() == [6000.0] * len(FLIGHT)
    assert found["heading"].to_list() == [88.0] * len(FLIGHT)


# readsb -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("extended", [True, False])
def test_traces(extended: bool, tmp_path: Path) -> None:
    details = 4 if extended else 1
    document = trace_of(FLIGHT, extended=extended, details_every=details)
    if not extended:  # the first layout has airspeeds in the details alone
        for point, ias in zip(document["trace"], FLIGHT["IAS"], strict=True):
            point[8]["ias"] = ias
    found, notes = rows_of(written_to(tmp_path / "trace_full_4ca001.json", packed(document)))
    same(found, timestamp=0.01, Mach=6e-4)
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


@pytest.mark.parametrize("form", ["tree", "tar", "tar.gz", "parts"])
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
    elif form == "parts":
        third = len(archive) // 3
        for number, letter in enumerate("abc"):
            part = archive[number * third : (number + 1) * third if number < 2 else None]
            written_to(tmp_path / f"v2024.03.01-planes-readsb-prod-0.tar.a{letter}", part)
    else:
        written_to(tmp_path / f"day.{form}", gzip.compress(archive) if form == "tar.gz" else archive)
    found, notes = rows_of(tmp_path)
    assert found["icao24"].unique().sort().to_list() == addresses
    assert len(found) == len(FLIGHT) * len(addresses)
    left_out = notes.pop("members of archives left out: no rows by its name", 0)
    assert left_out == (0 if form == "tree" else 4)
    assert set(notes) == {"trace points whose Mach was computed from IAS and altitude"}


def test_parts_of_split_archives_are_found_and_missing_ones_named(tmp_path: Path) -> None:
    names = ["b.csv", "x.tar.ab", "x.tar.aa", "y.tar.002", "y.tar.001", "whole.tar.gz", "whole.tar.xz"]
    groups = dict(with_parts([tmp_path / name for name in names]))
    assert [path.name for path in groups[str(tmp_path / "x.tar")]] == ["x.tar.aa", "x.tar.ab"]
    assert [path.name for path in groups[str(tmp_path / "y.tar")]] == ["y.tar.001", "y.tar.002"]
    assert [path.name for path in groups[str(tmp_path / "whole.tar.gz")]] == ["whole.tar.gz"]
    assert len(groups) == 5
    for missing in (["x.tar.ab", "x.tar.ac"], ["x.tar.aa", "x.tar.ac"], ["x.tar.003"]):
        with pytest.raises(DataError, match="split archive"):
            with_parts([tmp_path / name for name in missing])


# SCAT ---------------------------------------------------------------------------------------------------------------


def test_scat_with_its_clearances(tmp_path: Path) -> None:
    found, notes = rows_of(written_to(tmp_path / "100002.json", json.dumps(scat_of(FLIGHT), indent=1)))
    assert notes == {}
    same(found.with_columns(icao24=FLIGHT["icao24"]), altitude=1e-6, vertical_rate=1e-9)
    assert set(found["icao24"]) == set(found["flight_id"]) == {"scat7"}
    assert found["groundspeed"].to_list() == pytest.approx([400.0] * len(FLIGHT))
    assert found["track"].to_list() == pytest.approx([90.0] * len(FLIGHT))
    rest = len(FLIGHT) - 60
    assert found["cleared_flight_level"].to_list() == [350.0] * 20 + [190.0] * 20 + [40.0] * (20 + rest)
    assert found["cleared_mach"].to_list() == [None] * 20 + [0.77] * 20 + [None] * (20 + rest)
    assert found["cleared_speed_kt"].to_list() == [None] * 40 + [280.0] * 20 + [None] * rest


# Mode S -------------------------------------------------------------------------------------------------------------


def frames_of(rows: pl.DataFrame) -> list[tuple[float, str]]:
    """What a radar asks for: IAS and Mach, and two seconds later the track and turn report."""
    found = []
    for row in rows.iter_rows(named=True):
        time, altitude = row["timestamp"].timestamp(), 25 * round(row["altitude"] / 25)
        speeds = register_60(200.0, round(row["IAS"]), row["Mach"], row["vertical_rate"])
        found += [(time, all_call(row["icao24"])), (time, reply(row["icao24"], altitude, speeds))]
        found += [(time + 2.0, reply(row["icao24"], altitude, register_50(-5.0, row["track"], 400, 420)))]
    return found


@pytest.mark.parametrize("form", ["blank", "comma", "avr", "header", "jet1090", "parquet"])
def test_frames_with_times_are_decoded_and_brought_together(form: str, tmp_path: Path) -> None:
    pytest.importorskip("rs1090")
    frames = frames_of(FLIGHT)
    path = tmp_path / "frames"
    if form == "parquet":
        times, raw = zip(*frames, strict=True)
        pl.DataFrame({"mintime": times, "rawmsg": raw}).write_parquet(path)
    elif form == "jet1090":
        written_to(path, "\n".join(json.dumps({"timestamp": time, "frame": frame}) for time, frame in frames))
    else:
        joint = {"blank": "{} {}", "comma": "{},{}", "avr": "{} *{};", "header": "{},{}"}[form]
        lines = (["ts,hex"] if form == "header" else []) + [joint.format(*pair) for pair in frames]
        written_to(path, "\n".join(lines))
    found, notes = rows_of(path)
    assert notes == {}
    found = found.with_columns(typecode=pl.lit("A320"))
    same(found, timestamp=1e-5, altitude=12.5, vertical_rate=16.0, IAS=0.5, Mach=0.002)
    assert np.allclose(found["heading"], 200.0, atol=0.1)
    assert set(found["TAS"]) == {420.0}
    assert set(found["groundspeed"]) == {400.0}
    assert np.allclose(found["roll"], -5.0, atol=0.1)
    assert np.allclose(found["track"], 90.0, atol=0.1)


def test_frames_in_milliseconds_are_brought_together_as_well(tmp_path: Path) -> None:
    pytest.importorskip("rs1090")
    plain, _ = rows_of(written_to(tmp_path / "s", "\n".join(f"{time} {frame}" for time, frame in frames_of(FLIGHT))))
    lines = "\n".join(f"{round(1000 * time)} {frame}" for time, frame in frames_of(FLIGHT))
    milli, _ = rows_of(written_to(tmp_path / "ms", lines))
    assert_frame_equal(milli, plain)


def test_batches_of_messages_make_no_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rs1090")
    lines = "\n".join(f"{time} {frame}" for time, frame in frames_of(FLIGHT))
    path = written_to(tmp_path / "frames.txt", lines)
    whole, _ = rows_of(path)
    monkeypatch.setattr("descentflow.surveillance.formats.mode_s_frames.BATCH", 100)
    parts, _ = rows_of(path)
    assert_frame_equal(parts, whole)


def test_registers_are_read_as_the_standard_has_them() -> None:
    speeds = values_of((6, 0), int(register_60(200.0, 270, 0.78, -1984), 16))
    assert speeds == pytest.approx({"heading": 200.0, "IAS": 270, "Mach": 0.78, "vertical_rate": -1984}, abs=0.1)
    turn = values_of((5, 0), int(register_50(-20.0, 10.0, 400, 420), 16))
    assert turn == pytest.approx({"roll": -20.0, "track": 10.0, "groundspeed": 400, "TAS": 420}, abs=0.1)
    assert values_of((6, 0), 0) == {}
    assert values_of((1, 0), 1 << 55) == {}


def test_a_missing_decoder_is_named_with_the_way_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = written_to(tmp_path / "frames.txt", "\n".join(f"{time} {frame}" for time, frame in frames_of(FLIGHT)))
    blocks = written_to(tmp_path / "a.ast", cat062("4ca001", 36_000, 350, 270, 0.8, -500))
    monkeypatch.setitem(__import__("sys").modules, "rs1090", None)
    monkeypatch.setitem(__import__("sys").modules, "pyasteryx", None)
    with pytest.raises(DataError, match=r"pip install 'descentflow\[modes\]'"):
        rows_of(frames)
    with pytest.raises(DataError, match=r"pip install 'descentflow\[asterix\]'"):
        rows_of(blocks)


# ASTERIX ------------------------------------------------------------------------------------------------------------


def test_tracks_and_plots_of_asterix(tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    midnight = START.replace(hour=0).timestamp()
    tracks, plots = b"", b""
    for row in FLIGHT.iter_rows(named=True):
        seconds, level = row["timestamp"].timestamp() - midnight, row["altitude"] / 100
        tracks += cat062("4ca001", seconds, level, round(row["IAS"]), row["Mach"], row["vertical_rate"])
        registers = {
            0x60: register_60(200.0, round(row["IAS"]), row["Mach"], row["vertical_rate"]),
            0x50: register_50(0.0, 90.0, 400, 420),
        }
        plots += cat048("4ca001", seconds, level, registers) + bytes([34, 0, 4, 0])
    found, notes = rows_of(written_to(tmp_path / "2024-03-01_tracks.ast", tracks))
    assert notes == {}
    typed = found.with_columns(typecode=pl.lit("A320"))
    same(typed, timestamp=0.005, altitude=12.5, vertical_rate=3.2, IAS=0.5, Mach=0.0041)
    assert found["heading"].to_list() == pytest.approx([88.0] * len(FLIGHT), abs=0.01)
    assert found["groundspeed"].to_list() == pytest.approx([399.95] * len(FLIGHT), abs=0.01)
    assert found["track"].to_list() == [90.0] * len(FLIGHT)
    assert found["latitude"].to_list() == pytest.approx([45.5] * len(FLIGHT), abs=1e-5)
    expected = {"selected_altitude": 11_000, "wind_speed": 35, "wind_direction": 270, "temperature": 233.15}
    for name, value in expected.items():
        assert found[name].to_list() == pytest.approx([value] * len(FLIGHT))
    found, notes = rows_of(written_to(tmp_path / "plots_20240301.ast", plots))
    assert notes == {"ASTERIX blocks of other categories": len(FLIGHT)}
    typed = found.with_columns(typecode=pl.lit("A320"))
    same(typed, timestamp=0.005, altitude=12.5, vertical_rate=16.1, IAS=0.5, Mach=0.0021)
    assert set(found["TAS"]) == {420.0}


def test_a_track_of_another_encoder_is_read(tmp_path: Path) -> None:
    """A block that libasterix 0.36.3 wrote: FL350.25, 270 kt, Mach 0.784, 450 kt true, heading 90, -1500 ft/min."""
    pytest.importorskip("pyasteryx")
    record = "010246504000816c17001777770191ff36e905810c4ca001513531820820400001c2ff1001f4010e0062007b0579ff10"
    block = bytes.fromhex(f"3e{3 + 3 + len(record) // 2:04x}9b1924{record}")
    found, notes = rows_of(written_to(tmp_path / "a.ast", block))
    assert notes == {"files of ASTERIX without a day in their name, put on 1970-01-01": 1}
    row = found.row(0, named=True)
    expected = {"altitude": 35_025, "IAS": 270, "Mach": 0.784, "TAS": 450, "heading": 90, "vertical_rate": -1500}
    assert {name: row[name] for name in expected} == pytest.approx(expected)
    assert (row["icao24"], row["callsign"]) == ("4ca001", "TST1")
    assert str(row["timestamp"]) == "1970-01-01 10:00:00.500000+00:00"


def test_midnight_passes_in_asterix(tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    seconds = [86_390, 86_399.5, 5, 86_399.75, 10]
    blocks = b"".join(cat062("4ca001", second, 350, 270, 0.8, -500) for second in seconds)
    found, _ = rows_of(written_to(tmp_path / "20240301.ast", blocks))
    passed = (found["timestamp"] - found["timestamp"][0]).dt.total_microseconds() / 1e6
    assert passed.to_list() == [0, 9.5, 15, 9.75, 20]


# Snapshots and values -----------------------------------------------------------------------------------------------


def test_snapshots(tmp_path: Path) -> None:
    found, notes = rows_of(written_to(tmp_path / "aircraft.json", snapshots_of(FLIGHT)))
    assert notes == {}
    same(found, altitude=1e-9, vertical_rate=1e-9)


def test_answers_of_open_apis(tmp_path: Path) -> None:
    answers = [json.loads(line) for line in snapshots_of(FLIGHT).splitlines()]
    answers = [{"ac": answer["aircraft"], "now": 1000 * answer["now"], "total": 1} for answer in answers]
    found, _ = rows_of(written_to(tmp_path / "answers.jsonl", "\n".join(map(json.dumps, answers))))
    same(found, altitude=1e-9, vertical_rate=1e-9)


def test_mach_of_cas_is_the_inverse_of_cas_of_mach() -> None:
    altitude = np.array([0.0, 10_000, 36_000, 39_000])
    mach = np.array([0.3, 0.5, 0.78, 0.85])
    assert mach_of_cas(cas_of_mach_kt(mach, altitude), altitude) == pytest.approx(mach, rel=1e-12)


def test_values_from_json_are_numbers_text_or_missing() -> None:
    odd = [1, 2.5, "ground", None, True, 10**400, [1], {"a": 1}, "3", float("nan")]
    assert numbers(odd).fill_nan(None).to_list() == [1.0, 2.5, None, None, 1.0, None, None, None, 3.0, None]
    assert numbers([10**400, 1]).to_list() == [None, 1.0]
    assert texts([" a ", "", None, 7, [1], "\ud800"]).to_list() == ["a", None, None, "7", None, "?"]
    kinds = {"x": pl.Float64(), "s": pl.String(), "in": pl.Struct({"y": pl.Float64()})}
    plain = table([{"x": 1, "s": "a", "in": {"y": 2}}, {}], kinds)
    assert plain.rows() == [(1.0, "a", {"y": 2.0}), (None, None, None)]
    hostile = table([{"x": [1], "s": "\ud800", "in": 3}, {"x": 2, "s": {}, "in": {"y": "far"}}], kinds)
    assert hostile.select("x", "s", pl.col("in").struct.field("y")).rows() == [(None, "?", None), (2.0, None, None)]
    assert table([], kinds).schema == pl.Schema(kinds)
