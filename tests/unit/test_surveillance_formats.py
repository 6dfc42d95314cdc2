"""Tables, SCAT, snapshots and JSON values give the same flight; files of other kinds are named as what they are."""

import gzip
import io
import json
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
from polars.testing import assert_frame_equal
from source_toys import FLIGHT, assert_same_flight, rows_of, scat_of, snapshots_of, tar_of, written_to
from surveillance_toys import fleet, written

from descentflow.core.errors import DataError
from descentflow.surveillance.formats.json_rows import numbers, table, texts
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport


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
    decoded, notes = rows_of(path)
    assert_frame_equal(decoded, FLIGHT, check_exact=not kind.startswith("json"))
    assert set(notes) <= {"members of archives left out: no rows by its name"}
    named, _ = rows_of(path, format="json-rows" if kind.startswith("json") else kind)
    assert_frame_equal(named, decoded)


@pytest.mark.parametrize("form", ["list", "list over lines", "one after the other", "indented", "one aircraft a line"])
def test_snapshots_in_any_arrangement(form: str, tmp_path: Path) -> None:
    """As loggers append them: in a list, one after the other with or without line ends; and readsb's JSON output."""
    lines = snapshots_of(FLIGHT).decode().splitlines()
    text = {
        "list": "[" + ", ".join(lines) + "]",
        "list over lines": "[\n" + ",\n".join(lines) + "\n]\n",
        "one after the other": "".join(lines),
        "indented": "\n".join(json.dumps(json.loads(line), indent=1) for line in lines),
        "one aircraft a line": "\n".join(
            json.dumps({"now": whole["now"], **whole["aircraft"][0]}) for whole in map(json.loads, lines)
        ),
    }[form]
    decoded, notes = rows_of(written_to(tmp_path / "aircraft", text))
    assert_same_flight(decoded)
    assert notes == {}
    if form.startswith("one"):
        cut, notes = rows_of(written_to(tmp_path / "cut", text[:-40]))
        assert len(cut) == len(FLIGHT) - 1
        (note, number), *_ = notes.items()
        assert number == len(notes) == 1
        assert (
            f"cut, line {1 if form == 'one after the other' else len(lines)}" in note or "at the end of a file" in note
        )


def test_lines_with_nan_are_read_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The standard library writes it, and the faster parser does not take it; nothing is read as a whole for it."""
    monkeypatch.setattr("descentflow.surveillance.unpacking.MAX_DOCUMENT_BYTES", 1000)
    text = snapshots_of(FLIGHT).decode().replace('"flight"', '"rssi": NaN, "flight"')
    read, _ = rows_of(written_to(tmp_path / "aircraft", text))
    assert_same_flight(read)


def test_snapshots_of_a_program_without_airspeeds_are_refused_by_their_names(tmp_path: Path) -> None:
    craft = {"hex": "4ca001", "altitude": 34000, "vert_rate": -32, "speed": 450, "seen": 0.1}
    old = written_to(tmp_path / "old.json", json.dumps({"now": 1.7e9, "aircraft": [craft]}))
    with pytest.raises(DataError, match="`altitude` for `alt_baro`, of a dump1090 that reports no IAS and no Mach"):
        rows_of(old)
    with pytest.raises(DataError, match="aircraft of a receiver without the time of each"):
        rows_of(written_to(tmp_path / "data.json", json.dumps([craft])))


def test_csv_is_cut_between_rows_and_never_inside_quotes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("descentflow.surveillance.formats._tables.CSV_BYTES", 1000)
    quoted = FLIGHT.with_columns(callsign=pl.lit('TST "1"\n,\n'))
    quoted.write_csv(tmp_path / "rows.csv")
    read, _ = rows_of(tmp_path / "rows.csv")
    assert_frame_equal(read, FLIGHT.with_columns(callsign=pl.lit('TST "1"\n,')))


@pytest.mark.parametrize("line", ["\n", "\r\n"])
def test_a_few_kilobytes_that_unpack_to_millions_of_empty_lines_are_refused(tmp_path: Path, line: str) -> None:
    packed = gzip.compress((FLIGHT.write_csv() + line * (1 << 21)).encode())
    assert len(packed) < 100_000
    with pytest.raises(DataError, match=r"2,\d{3},\d{3} lines in [24],\d{3},\d{3} bytes from byte"):
        rows_of(written_to(tmp_path / "rows.csv.gz", packed))


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
    decoded, notes = rows_of(tmp_path / "states.parquet")
    assert notes == {"state vectors without a message for 2 s, left out": 10}
    assert np.allclose(decoded["altitude"], FLIGHT["altitude"][10:])
    assert np.allclose(decoded["vertical_rate"], FLIGHT["vertical_rate"][10:], atol=1e-6)
    assert np.allclose(decoded["groundspeed"], 400.0)
    assert decoded["track"].to_list() == FLIGHT["track"][10:].to_list()


def test_scat_with_its_clearances(tmp_path: Path) -> None:
    decoded, notes = rows_of(written_to(tmp_path / "100002.json", json.dumps(scat_of(FLIGHT), indent=1)))
    assert notes == {}
    assert_same_flight(decoded.with_columns(icao24=FLIGHT["icao24"]), altitude=1e-6, vertical_rate=1e-9)
    assert set(decoded["icao24"]) == set(decoded["flight_id"]) == {"scat7"}
    assert decoded["groundspeed"].to_list() == pytest.approx([400.0] * len(FLIGHT))
    assert decoded["track"].to_list() == pytest.approx([90.0] * len(FLIGHT))
    rest = len(FLIGHT) - 60
    assert decoded["cleared_flight_level"].to_list() == [350.0] * 20 + [190.0] * 20 + [40.0] * (20 + rest)
    assert decoded["cleared_mach"].to_list() == [None] * 20 + [0.77] * 20 + [None] * (20 + rest)
    assert decoded["cleared_speed_kt"].to_list() == [None] * 40 + [280.0] * 20 + [None] * rest


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


def test_prepared_descents_are_told_as_such(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"these are prepared descents: pass the file that .* wrote to fit, evaluate"):
        prepare(written(prepare(fleet(1)).frame, tmp_path / "descents.parquet"))


def test_state_vectors_are_sent_to_the_table_with_airspeeds() -> None:
    names = ["time", "icao24", "lat", "lon", "velocity", "heading", "vertrate", "callsign", "onground", "alert", "spi"]
    vectors = pl.DataFrame({name: [1.0] for name in [*names, "squawk", "baroaltitude", "geoaltitude", "lastcontact"]})
    with pytest.raises(
        DataError, match=r"no column IAS, Mach .it has .*squawk, baroaltitude, .*rawdata or the roll-call"
    ):
        prepare(vectors)
    with pytest.raises(DataError, match=r"c19 and 5 more\)"):
        prepare(pl.DataFrame({f"c{number}": [1.0] for number in range(25)}))


def zipped(name: str) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(name, "x")
    return content.getvalue()


def checkpoint() -> bytes:
    content = io.BytesIO()
    torch.save({"state_dict": {}}, content)
    return content.getvalue()


OTHERS = {
    "best.ckpt": (checkpoint(), "is a checkpoint or another file of torch.*info, sample, evaluate and diagnose take"),
    "rows.xlsx": (zipped("xl/workbook.xml"), "is a workbook of Excel.*save the sheet as CSV in UTF-8"),
    "rows.zip": (zipped("rows.csv"), "is a zip archive.*unpack it"),
    "utf16.csv": ("timestamp,icao24\n1,4ca001\n".encode("utf-16"), "text in UTF-16.*save it as UTF-8"),
    "semicolons.csv": (b"timestamp;icao24\n1;4ca001\n", r"but with semicolons.*sep=';', decimal=','"),
    "tabs.csv": (b"timestamp\ticao24\n1\t4ca001\n", r"but with tabs.*sep='\\t'"),
    "comment.csv": (b"# of 2024-03-01\ntimestamp,icao24\n1,4ca001\n", "a comment.*take the lines before the names out"),
    "split.json": (json.dumps({"columns": ["a"], "index": [0], "data": [[1]]}).encode(), "orient='records'"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_files_of_other_kinds_are_told_with_their_mend(name: str, tmp_path: Path) -> None:
    content, words = OTHERS[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=words):
        prepare(tmp_path / name)


def test_a_column_without_a_name_is_told_as_that(tmp_path: Path) -> None:
    rows, report = fleet(1), DropReport()
    path = tmp_path / "rows.csv"
    rows.select(pl.int_range(pl.len()).alias(""), *rows.columns).write_csv(path)
    assert len(read_rows([path], report)) == len(rows)
    unused = "rows whose columns are not used: (a column without a name, such as an index)"
    assert report.notes == {unused: len(rows)}


def test_an_index_of_pandas_is_a_column() -> None:
    pandas = pytest.importorskip("pandas")
    rows = fleet(1)
    table = pandas.DataFrame({name: rows[name].to_list() for name in rows.columns})
    expected = prepare(rows).frame
    for indexed in (
        table.set_index("timestamp"),
        table.set_index(["icao24", "timestamp"]),
        table.set_index("timestamp").rename_axis("time"),
        table.set_index("timestamp").rename_axis(None),
        table.set_index("timestamp", drop=False),
    ):
        assert_frame_equal(prepare(indexed).frame, expected)
    assert expected["timestamp"][0] > datetime(2024, 3, 1, tzinfo=UTC)
