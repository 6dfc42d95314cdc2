"""Files made to harm: bombs, endless nesting, archives that lead out; nothing grows, nothing is written."""

import gzip
import io
import json
import tarfile
from pathlib import Path

import polars as pl
import pytest
from hostile_toys import FLIGHT, OF_JSON, SOURCES, as_bytes, outcome, refused
from source_toys import packed, tar_of, trace_of, written_to
from surveillance_toys import flight

PACKED = {"compression": "zstd"}
KINDS = ("text", "categorical", "enum")


@pytest.mark.parametrize("kind", OF_JSON)
@pytest.mark.parametrize("bracket", [b"[", b'{"trace":'])
def test_json_nested_without_end(kind: str, bracket: bytes, tmp_path: Path) -> None:
    path = written_to(tmp_path / "deep.json", bracket * 300_000)
    refused(path, "nested too deeply")
    refused(path, "nested too deeply", format=kind.replace("columns", "rows"))
    inside = written_to(tmp_path / "inside.json", SOURCES[kind] + b"\n" + bracket * 300_000)
    refused(inside, "nested too deeply")


def bomb(megabytes: int) -> bytes:
    """A list that begins with megabytes of blanks."""
    packer = io.BytesIO()
    with gzip.GzipFile(fileobj=packer, mode="wb", compresslevel=9) as out:
        out.write(b"[")
        for _ in range(megabytes):
            out.write(b" " * (1 << 20))
    return packer.getvalue()


@pytest.mark.parametrize("kind", [kind for kind in SOURCES if kind != "tar"])
def test_a_bomb_of_gzip_is_refused_by_the_limits_of_what_is_held(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A good file of every source that ends in a bomb: zeros after binary content, blanks after text."""
    monkeypatch.setattr("descentflow.surveillance.unpacking.MAX_LINE_BYTES", 1 << 20)
    monkeypatch.setattr("descentflow.surveillance.unpacking.MAX_DOCUMENT_BYTES", 2 << 20)
    monkeypatch.setattr("descentflow.surveillance.formats._tables.MAX_LINE_BYTES", 1 << 20)
    monkeypatch.setattr("descentflow.surveillance.formats._tables.CSV_BYTES", 1 << 20)
    binary = kind in ("parquet", "feather") or kind.startswith("asterix")
    packer = io.BytesIO()
    with gzip.GzipFile(fileobj=packer, mode="wb", compresslevel=9) as out:
        out.write(SOURCES[kind])
        for _ in range(24):
            out.write((b"\0" if binary else b" ") * (1 << 20))
    words = {True: "read as a whole", False: "longer than"}[kind in ("parquet", "feather")]
    words = "block of length 0" if kind.startswith("asterix") else words
    refused(written_to(tmp_path / "rows.gz", packer.getvalue()), words)


@pytest.mark.parametrize("kind", [pl.String(), pl.Categorical(), pl.Enum(["x" * 200_000, "b"])], ids=KINDS)
@pytest.mark.parametrize("form", ["parquet", "feather"])
def test_one_text_that_a_small_table_repeats_in_every_row(kind: pl.DataType, form: str, tmp_path: Path) -> None:
    """Kept once in the file and by Polars, two gigabytes if anything copies it; it is counted."""
    long = FLIGHT.sample(10_000, with_replacement=True, seed=0).with_columns(
        callsign=pl.lit("x" * 200_000).cast(kind), timestamp=pl.lit(FLIGHT["timestamp"][0])
    )
    content = as_bytes(lambda out: long.write_parquet(out) if form == "parquet" else long.write_ipc(out, **PACKED))
    assert len(content) < 3_000_000
    rows, notes = outcome(written_to(tmp_path / "rows", content))
    assert rows is not None, notes
    assert notes == {"values of callsign that could not be read": 10_000}
    assert rows["callsign"].null_count() == len(rows) == 10_000


def test_a_long_text_in_a_column_that_is_needed_is_refused_and_not_printed_whole(tmp_path: Path) -> None:
    path = tmp_path / "rows.parquet"
    FLIGHT.with_columns(icao24=pl.lit("x" * 200_000)).write_parquet(path)
    refused(path, "60 of 60 values of icao24 cannot be read")
    assert len(str(outcome(path)[1])) < 400


def test_lines_and_documents_that_are_too_long_to_be_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("descentflow.surveillance.unpacking.MAX_LINE_BYTES", 20_000)
    monkeypatch.setattr("descentflow.surveillance.unpacking.MAX_DOCUMENT_BYTES", 30_000)
    monkeypatch.setattr("descentflow.surveillance.formats._tables.MAX_LINE_BYTES", 20_000)
    monkeypatch.setattr("descentflow.surveillance.formats._tables.CSV_BYTES", 10_000)
    snapshot = '{"now": 1, "aircraft": []}\n'
    refused(written_to(tmp_path / "a.json", snapshot + " " * 20_001), "line 2: longer than")
    trace = json.dumps(trace_of(flight()), indent=0)
    refused(written_to(tmp_path / "trace_full_a.json", trace), "have to be read as a whole")
    refused(written_to(tmp_path / "t.tar", tar_of([("rows", SOURCES["parquet"] + b"x" * 30_000)])), "read as a whole")
    quote = FLIGHT.write_csv() + '1,"' + "2,2,2,2,2,2,2,2,2\n" * 3000
    refused(written_to(tmp_path / "a.csv", quote), "look for a quote that is not closed")


def test_a_bomb_of_blank_lines_is_refused_before_they_are_counted(tmp_path: Path) -> None:
    snapshot = b'{"now": 1, "aircraft": []}\n'
    path = written_to(tmp_path / "a.json.gz", gzip.compress(snapshot + b"\n" * (50 << 20)))
    refused(path, "line 1000002: more than 1,000,000 blank lines in a row")


# Archives -----------------------------------------------------------------------------------------------------------


def hostile_archive() -> bytes:
    """Links, devices, names that lead out, a sparse file; and one good trace."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        for number, kind in enumerate((tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.BLKTYPE)):
            info = tarfile.TarInfo(f"traces/0{number}/trace_full_a.json")
            info.type, info.linkname, info.devmajor, info.devminor = kind, "/etc/passwd", 1, 3
            archive.addfile(info)
        fifo = tarfile.TarInfo("traces/fifo")
        fifo.type = tarfile.FIFOTYPE
        archive.addfile(fifo)
        sparse = tarfile.TarInfo("traces/sparse.json")
        sparse.pax_headers = {"GNU.sparse.major": "1", "GNU.sparse.minor": "0", "GNU.sparse.realsize": str(1 << 50)}
        content = b"0\n" + b"\0" * 510
        sparse.size = len(content)
        archive.addfile(sparse, io.BytesIO(content))
        for name in ("../../outside.json", "/etc/outside.json", "traces/../../x.json"):
            info = tarfile.TarInfo(name)
            content = packed(trace_of(FLIGHT))
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
        good = packed(trace_of(FLIGHT))
        info = tarfile.TarInfo("traces/01/trace_full_4ca001.json")
        info.size = len(good)
        archive.addfile(info, io.BytesIO(good))
    return out.getvalue()


def test_links_devices_and_names_that_lead_out_are_counted_and_nothing_is_written(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    rows, notes = outcome(written_to(tmp_path / "in" / "hostile.tar", hostile_archive()))
    assert rows is not None, notes
    assert len(rows) == len(FLIGHT)
    assert notes["members of archives left out: link, device or sparse file"] == 6
    assert notes["members of archives left out: name that leads out of the archive"] == 3
    assert [path.name for path in tmp_path.rglob("*")] == ["in", "hostile.tar"]


def test_a_header_that_asks_for_gigabytes_is_refused(tmp_path: Path) -> None:
    info = tarfile.TarInfo("long")
    info.type, info.size = tarfile.XHDTYPE, 4 << 30
    refused(written_to(tmp_path / "a.tar", info.tobuf() + b"\0" * 2048), "a header of")


def test_damaged_members_are_counted_as_long_as_there_is_a_good_one(tmp_path: Path) -> None:
    good = packed(trace_of(FLIGHT))
    members = [("a.json", good), ("b.json", good[:200]), ("c.json", b"{"), ("d.bin", b"\0\1\2"), ("e.json", b"")]
    rows, notes = outcome(written_to(tmp_path / "a.tar", tar_of(members)))
    assert rows is not None, notes
    assert len(rows) == len(FLIGHT)
    assert notes["traces and members of archives that could not be read"] == 4
    refused(written_to(tmp_path / "b.tar", tar_of(members[1:])), "b.json: Compressed file ended")


def test_a_damaged_trace_in_a_tree_is_counted_but_not_one_that_is_named(tmp_path: Path) -> None:
    good = packed(trace_of(FLIGHT))
    tree = tmp_path / "traces"
    tree.mkdir()
    for number, content in enumerate((good, good[:300], b"\x1f\x8b", gzip.compress(b'{"icao": 3}'))):
        written_to(tree / f"trace_full_4ca00{number}.json", content)
    rows, notes = outcome(tree)
    assert rows is not None, notes
    assert len(rows) == len(FLIGHT)
    assert notes["traces and members of archives that could not be read"] == 3
    refused(tree / "trace_full_4ca001.json", "Compressed file ended")


@pytest.mark.parametrize("place", ["header", "size", "end"])
def test_damaged_archives(place: str, tmp_path: Path) -> None:
    archive = bytearray(SOURCES["tar"])
    second = archive.find(b"./traces/01")
    if place == "header":
        archive[second + 20] ^= 0xFF
    elif place == "size":
        archive[second + 124 : second + 135] = b"99999999999"
    else:
        archive = archive[:-1024]
    refused(written_to(tmp_path / "a.tar", bytes(archive)), "damaged or cut archive")
