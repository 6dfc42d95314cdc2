"""Mode S frames, registers in rows of their own and ASTERIX blocks: the flight that is known comes back."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from source_toys import (
    FLIGHT,
    all_call,
    assert_same_flight,
    cat048,
    cat062,
    register_50,
    register_60,
    reply,
    rows_of,
    written_to,
)
from surveillance_toys import START, flight

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows._values_of_other_rows import JOINED_VALUES, VALUES_APART, with_values_of_other_rows
from descentflow.surveillance.rows.drop_report import DropReport


def frames_of(rows: pl.DataFrame) -> list[tuple[float, str]]:
    """Replies to a radar: IAS and Mach, and two seconds later the track and turn report."""
    sent = []
    for row in rows.iter_rows(named=True):
        time, altitude = row["timestamp"].timestamp(), 25 * round(row["altitude"] / 25)
        speeds = register_60(200.0, round(row["IAS"]), row["Mach"], row["vertical_rate"])
        sent += [(time, all_call(row["icao24"])), (time, reply(row["icao24"], altitude, speeds))]
        sent += [(time + 2.0, reply(row["icao24"], altitude, register_50(-5.0, row["track"], 400, 420)))]
    return sent


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
    decoded, notes = rows_of(path)
    assert notes == {}
    decoded = decoded.with_columns(typecode=pl.lit("A320"))
    assert_same_flight(decoded, timestamp=1e-5, altitude=12.5, vertical_rate=16.0, IAS=0.5, Mach=0.002)
    assert np.allclose(decoded["heading"], 200.0, atol=0.1)
    assert set(decoded["TAS"]) == {420.0}
    assert set(decoded["groundspeed"]) == {400.0}
    assert np.allclose(decoded["roll"], -5.0, atol=0.1)
    assert np.allclose(decoded["track"], 90.0, atol=0.1)


def test_a_missing_decoder_is_named_with_the_way_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = written_to(tmp_path / "frames.txt", "\n".join(f"{time} {frame}" for time, frame in frames_of(FLIGHT)))
    blocks = written_to(tmp_path / "a.ast", cat062("4ca001", 36_000, 350, 270, 0.8, -500))
    monkeypatch.setitem(__import__("sys").modules, "rs1090", None)
    monkeypatch.setitem(__import__("sys").modules, "pyasteryx", None)
    with pytest.raises(ConfigError, match=r"rs1090 is not installed; .* pip install 'rs1090"):
        rows_of(frames)
    with pytest.raises(ConfigError, match=r"pyasteryx is not installed; .* pip install 'pyasteryx"):
        rows_of(blocks)


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
    decoded, notes = rows_of(written_to(tmp_path / "2024-03-01_tracks.ast", tracks))
    assert notes == {}
    typed = decoded.with_columns(typecode=pl.lit("A320"))
    assert_same_flight(typed, timestamp=0.005, altitude=12.5, vertical_rate=3.2, IAS=0.5, Mach=0.0041)
    assert decoded["heading"].to_list() == pytest.approx([88.0] * len(FLIGHT), abs=0.01)
    assert decoded["groundspeed"].to_list() == pytest.approx([399.95] * len(FLIGHT), abs=0.01)
    assert decoded["track"].to_list() == [90.0] * len(FLIGHT)
    assert decoded["latitude"].to_list() == pytest.approx([45.5] * len(FLIGHT), abs=1e-5)
    expected = {"selected_altitude": 11_000, "wind_speed": 35, "wind_direction": 270, "temperature": 233.15}
    for name, value in expected.items():
        assert decoded[name].to_list() == pytest.approx([value] * len(FLIGHT))
    decoded, notes = rows_of(written_to(tmp_path / "plots_20240301.ast", plots))
    assert notes == {"ASTERIX blocks of other categories": len(FLIGHT)}
    typed = decoded.with_columns(typecode=pl.lit("A320"))
    assert_same_flight(typed, timestamp=0.005, altitude=12.5, vertical_rate=16.1, IAS=0.5, Mach=0.0021)
    assert set(decoded["TAS"]) == {420.0}


def test_a_track_of_another_encoder_is_read(tmp_path: Path) -> None:
    """A block that libasterix 0.36.3 wrote: FL350.25, 270 kt, Mach 0.784, 450 kt true, heading 90, -1500 ft/min."""
    pytest.importorskip("pyasteryx")
    record = "010246504000816c17001777770191ff36e905810c4ca001513531820820400001c2ff1001f4010e0062007b0579ff10"
    block = bytes.fromhex(f"3e{3 + 3 + len(record) // 2:04x}9b1924{record}")
    decoded, notes = rows_of(written_to(tmp_path / "a.ast", block))
    assert notes == {"files of ASTERIX without a day in their name, put on 1970-01-01": 1}
    row = decoded.row(0, named=True)
    expected = {"altitude": 35_025, "IAS": 270, "Mach": 0.784, "TAS": 450, "heading": 90, "vertical_rate": -1500}
    assert {name: row[name] for name in expected} == pytest.approx(expected)
    assert (row["icao24"], row["callsign"]) == ("4ca001", "TST1")
    assert str(row["timestamp"]) == "1970-01-01 10:00:00.500000+00:00"


@pytest.mark.parametrize(
    ("name", "day"),
    [
        ("2024-03-01_x.ast", "2024-03-01"),
        ("20240301080001.ast", "2024-03-01"),
        ("240301-lebl-080001_smr.ast", "2024-03-01"),
        ("lebl_080001_240301.ast", "2024-03-01"),
        ("plots_20240301_231131.ast", "2024-03-01"),
        ("241301.ast", "1970-01-01"),
        ("000123.ast", "1970-01-01"),
        ("1234567.ast", "1970-01-01"),
    ],
)
def test_days_of_six_and_eight_digits_in_names_of_asterix(name: str, day: str, tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    decoded, notes = rows_of(written_to(tmp_path / name, cat062("4ca001", 36_000, 350, 270, 0.8, -500)))
    assert str(decoded["timestamp"][0]) == f"{day} 10:00:00+00:00"
    assert bool(notes) == (day == "1970-01-01")


def test_files_without_days_are_not_put_on_one(tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    steps = [(k, 350 - k, 270 + k % 3, round(0.8 - 0.001 * k, 3), -1400 - 40 * (k % 9)) for k in range(150)]
    block = b"".join(cat062("4ca001", 36_000 + 4 * k, *measured) for k, *measured in steps)
    for name in ("a.ast", "b.ast"):
        written_to(tmp_path / name, block)
    prepare(tmp_path / "a.ast", types={"4ca001": "A320"})
    with pytest.raises(DataError, match=r"begin anew 1 times .* of ASTERIX the day"):
        prepare(tmp_path, types={"4ca001": "A320"})


def test_asterix_of_other_categories_is_refused_by_their_numbers(tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    blocks = bytes([10, 0, 4, 0, 21, 0, 5, 0, 0, 10, 0, 4, 0])
    with pytest.raises(DataError, match="ASTERIX without airspeeds, of category 010 and 021 alone"):
        rows_of(written_to(tmp_path / "240301.ast", blocks))
    decoded, notes = rows_of(written_to(tmp_path / "240301.ast", blocks + cat062("4ca001", 1, 350, 270, 0.8, -500)))
    assert len(decoded) == 1
    assert notes == {"ASTERIX blocks of other categories": 3}


def test_midnight_passes_in_asterix(tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    seconds = [86_390, 86_399.5, 5, 86_399.75, 10]
    blocks = b"".join(cat062("4ca001", second, 350, 270, 0.8, -500) for second in seconds)
    decoded, _ = rows_of(written_to(tmp_path / "20240301.ast", blocks))
    passed = (decoded["timestamp"] - decoded["timestamp"][0]).dt.total_microseconds() / 1e6
    assert passed.to_list() == [0, 9.5, 15, 9.75, 20]


WHOLE = flight(every_s=2.0).with_columns(TAS=430.0 - 0.2 * pl.int_range(pl.len()), groundspeed=pl.lit(400.0))
EVEN = pl.int_range(pl.len()) % 2 == 0


def apart(own: tuple[str, ...], others: tuple[str, ...]) -> pl.DataFrame:
    """Rows that have one set of columns and the other in turn."""
    columns = [pl.when(EVEN).then(name).alias(name) for name in own]
    return WHOLE.with_columns(*columns, *(pl.when(~EVEN).then(name).alias(name) for name in others))


def test_values_of_rows_in_between_are_joined_as_those_of_raw_mode_s() -> None:
    rows = apart(("IAS", "Mach"), ("TAS", "groundspeed", "track"))
    prepared = prepare(rows)
    expected = prepare(WHOLE.filter(EVEN))
    assert prepared.frame["level_fl"].equals(expected.frame["level_fl"])
    for name in ("TAS", "groundspeed", "track"):
        assert (prepared.frame[name] - expected.frame[name]).abs().max() < 0.05, name
        assert prepared.report.notes[JOINED_VALUES.format(name=name)] > 100
    assert (
        with_values_of_other_rows(rows, DropReport())
        .drop("TAS", "groundspeed", "track")
        .equals(rows.select(with_values_of_other_rows(rows, DropReport()).columns).drop("TAS", "groundspeed", "track"))
    ), "rows and their order stay"


def test_altitudes_of_rows_in_between_are_interpolated() -> None:
    prepared = prepare(apart(("IAS", "Mach"), ("altitude",))).frame
    assert prepared.height == pytest.approx(prepare(WHOLE.filter(EVEN)).frame.height, abs=2)


def test_tables_whose_rows_have_both_stay_as_they_are() -> None:
    some = pl.int_range(pl.len()) % 10 == 0
    rows = WHOLE.with_columns(TAS=pl.when(some).then("TAS"), IAS=pl.when(EVEN | some).then("IAS"))
    report = DropReport()
    assert with_values_of_other_rows(rows, report) is rows
    assert report.notes == {}


def test_what_is_too_far_in_time_is_told() -> None:
    far = pl.col("timestamp") + pl.when(~EVEN).then(pl.duration(hours=2)).otherwise(pl.duration(hours=0))
    with pytest.warns(DescentflowWarning, match=r"320 rows with TAS but without IAS.*values of TAS stand in"):
        prepared = prepare(apart(("IAS", "Mach"), ("TAS",)).with_columns(timestamp=far))
    assert VALUES_APART.format(name="TAS") in prepared.report.notes
    with pytest.raises(DataError, match="values of altitude stand in other rows than IAS: put into each row"):
        prepare(apart(("IAS", "Mach"), ("altitude",)).with_columns(timestamp=far))
