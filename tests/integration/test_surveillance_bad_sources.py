"""Damaged and hostile files of every source: a clear error or a counted drop, and never anything else."""

import gzip
import io
import json
import random
import tarfile
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from source_toys import (
    all_call,
    cat048,
    cat062,
    packed,
    possible,
    register_60,
    reply,
    scat_of,
    snapshots_of,
    tar_of,
    trace_of,
    written_to,
)
from surveillance_toys import flight

from descentflow.cli import main
from descentflow.errors import DataError
from descentflow.surveillance.readers import read_rows
from descentflow.surveillance.report import DropReport

FLIGHT = flight().head(60)
ODD = (None, True, 1e308, -1e308, 10**400, float("nan"), "x", "", [], {}, [1], {"a": 1}, "\ud800", -1, 1e18, "9" * 999)


def as_bytes(write: Callable[[io.BytesIO], object]) -> bytes:
    content = io.BytesIO()
    write(content)
    return content.getvalue()


def frames() -> list[tuple[float, str]]:
    found = []
    for row in FLIGHT.iter_rows(named=True):
        speeds = register_60(90.0, round(row["IAS"]), row["Mach"], row["vertical_rate"])
        time = row["timestamp"].timestamp()
        found += [(time, all_call("4ca001")), (time, reply("4ca001", round(row["altitude"]), speeds))]
    return found


def messages() -> list[dict]:
    """Lines as jet1090 decodes them."""
    fixed = {"df": "20", "icao24": "4ca001"}
    return [
        {"timestamp": row["timestamp"].timestamp(), "frame": "00" * 14, **fixed, "altitude": row["altitude"]}
        | {"bds60": {"IAS": row["IAS"], "Mach": row["Mach"], "vrate_barometric": row["vertical_rate"]}}
        for row in FLIGHT.iter_rows(named=True)
    ]


def blocks(category: int) -> bytes:
    found = b""
    for number, row in enumerate(FLIGHT.iter_rows(named=True)):
        level, speeds = row["altitude"] / 100, register_60(90.0, 270, row["Mach"], row["vertical_rate"])
        if category == 62:
            found += cat062("4ca001", 36_000 + 5 * number, level, 270, row["Mach"], row["vertical_rate"])
        else:
            found += cat048("4ca001", 36_000 + 5 * number, level, {0x60: speeds})
    return found


def lines(documents: list) -> bytes:
    return "\n".join(map(json.dumps, documents)).encode()


def unpadded(members: list[tuple[str, bytes]]) -> bytes:
    """An archive without the blocks of nothing that fill it up after its end."""
    whole = tar_of(members)
    used = len(whole.rstrip(b"\0"))
    return whole[: -(-used // 512) * 512 + 1024]


def table_of(frame: pl.DataFrame, kind: str) -> bytes:
    if kind == "parquet":
        return as_bytes(frame.write_parquet)
    if kind == "feather":
        return as_bytes(frame.write_ipc)
    if kind == "csv":
        return frame.write_csv().encode()
    rows = frame.with_columns(pl.col("timestamp").dt.epoch("ms")).to_dicts()
    if kind == "json-rows":
        return json.dumps(rows).encode()
    return json.dumps({name: {str(i): row[name] for i, row in enumerate(rows)} for name in rows[0]}).encode()


TABLES = ("parquet", "feather", "csv", "json-rows", "json-columns")
SOURCES: dict[str, bytes] = {
    **{kind: table_of(FLIGHT, kind) for kind in TABLES},
    "readsb-trace": json.dumps(trace_of(FLIGHT)).encode(),
    "aircraft-json": snapshots_of(FLIGHT),
    "scat": json.dumps(scat_of(flight().head(70))).encode(),
    "jet1090": lines(messages()),
    "modes-hex": "\n".join(f"{time} {frame}" for time, frame in frames()).encode(),
    "asterix-062": blocks(62),
    "asterix-048": blocks(48),
    "tar": unpadded([(f"./traces/0{n}/trace_full_4ca00{n}.json", packed(trace_of(FLIGHT))) for n in range(3)]),
}
OF_JSON = ("json-rows", "json-columns", "readsb-trace", "aircraft-json", "scat", "jet1090")


def outcome(path: Path, **options: object) -> tuple[pl.DataFrame | None, dict[str, int] | str]:
    """Rows and notes, or none and the message; anything but a DataError is a failure."""
    report = DropReport()
    try:
        return read_rows([path], report, **options), report.notes
    except DataError as error:
        words = str(error)
    assert "; expected " in words
    assert "; to mend it, " in words
    return None, words


def refused(path: Path, saying: str, **options: object) -> None:
    rows, words = outcome(path, **options)
    assert rows is None
    assert saying in words, words


@pytest.mark.parametrize("kind", SOURCES)
def test_whole_files_are_read(kind: str, tmp_path: Path) -> None:
    rows, notes = outcome(written_to(tmp_path / "2024-03-01", SOURCES[kind]))
    assert rows is not None, notes
    assert len(rows) >= len(FLIGHT)
    assert set(notes) <= {"trace points whose Mach was computed from IAS and altitude"}


CUT = {
    "csv": None,  # a CSV may end anywhere; the last line then lacks values or has a short one
    "aircraft-json": "JSON lines cut at the end of a file",
    "jet1090": "JSON lines cut at the end of a file",
    "modes-hex": "lines that are no time and frame",
    "asterix-062": "ASTERIX blocks cut at the end of a file",
    "asterix-048": "ASTERIX blocks cut at the end of a file",
    "tar": "damaged or cut archive",
}
"""What is said of a cut file, as an error or a count; those not named are JSON documents or binary tables."""


@pytest.mark.parametrize("share", [0.11, 0.53, 0.97])
@pytest.mark.parametrize("kind", SOURCES)
def test_truncated_files(kind: str, share: float, tmp_path: Path) -> None:
    whole = SOURCES[kind]
    if kind in ("parquet", "tar"):  # not just in what stands after all content
        share = min(share, 0.7)
    place = int(share * len(whole))
    if kind == "modes-hex":  # within a line
        place = whole.rfind(b"\n", 0, place) + 5
    rows, words = outcome(written_to(tmp_path / "2024-03-01", whole[:place]))
    expected = CUT.get(kind, "not JSON" if kind in OF_JSON else "whole, readable file")
    if kind == "csv":
        assert rows is not None
        assert len(rows) <= len(FLIGHT)
    elif kind.startswith(("asterix", "modes", "aircraft", "jet1090")):
        assert rows is not None
        assert len(rows) < len(FLIGHT)
        assert words.pop(expected) == 1
    else:
        assert rows is None
        assert expected in words


@pytest.mark.parametrize("kind", SOURCES)
def test_truncated_gzip(kind: str, tmp_path: Path) -> None:
    content = gzip.compress(SOURCES[kind])
    refused(written_to(tmp_path / "rows.gz", content[: len(content) // 2]), "damaged gzip")
    refused(written_to(tmp_path / "twice.gz", gzip.compress(content)), "gzip inside gzip")


@pytest.mark.parametrize("coding", ["latin-1", "utf-16", "utf-8-sig"])
@pytest.mark.parametrize("kind", [*OF_JSON, "csv", "modes-hex"])
def test_other_encodings(kind: str, coding: str, tmp_path: Path) -> None:
    text = SOURCES[kind].decode().replace("TST1", "TÄST1").encode().decode("unicode_escape").encode("latin-1").decode()
    rows, words = outcome(written_to(tmp_path / "rows", text.replace("\\u00c4", "Ä").encode(coding)))
    if coding == "utf-8-sig" or (coding == "latin-1" and text.isascii()):
        assert rows is not None, words
        assert len(rows) >= len(FLIGHT)
    else:
        assert rows is None
        assert "not UTF-8" in words or "neither text nor" in words


def mutated(thing: object, rolls: random.Random, share: float) -> object:
    """JSON with some values replaced by odd ones, and some left out."""
    if isinstance(thing, dict):
        return {
            name: rolls.choice(ODD) if rolls.random() < share else mutated(value, rolls, share)
            for name, value in thing.items()
            if rolls.random() > share / 3
        }
    if isinstance(thing, list):
        return [rolls.choice(ODD) if rolls.random() < share else mutated(value, rolls, share) for value in thing]
    return thing


@pytest.mark.parametrize("share", [0.002, 0.05, 0.3])
@pytest.mark.parametrize("kind", OF_JSON)
def test_mixed_types_and_absurd_values(kind: str, share: float, tmp_path: Path) -> None:
    rolls = random.Random(f"{kind}{share}")
    for _ in range(5):
        documents = [json.loads(line) for line in SOURCES[kind].splitlines()]
        hostile = lines([mutated(document, rolls, share) for document in documents])
        rows, _ = outcome(written_to(tmp_path / "rows", hostile))
        if rows is None:
            continue
        numbers = rows.select(pl.col(pl.Float64)).fill_null(0.0)
        assert numbers.select(pl.all_horizontal(pl.all().is_finite().all())).item()
        assert len(possible(rows)) <= 2 * len(FLIGHT)


@pytest.mark.parametrize("kind", [kind for kind in SOURCES if kind not in ("parquet", "feather")])
def test_bytes_changed_anywhere(kind: str, tmp_path: Path) -> None:
    """Not of Parquet and Feather: there damage inside of a page is Polars' to find (see the notes on formats)."""
    rolls = random.Random(kind)
    for _ in range(25):
        content = bytearray(SOURCES[kind])
        for _ in range(rolls.choice([1, 3, 30])):
            place = rolls.randrange(len(content))
            change = rolls.random()
            if change < 0.6:
                content[place] = rolls.randrange(256)
            elif change < 0.8:
                del content[place : place + rolls.randrange(1, 50)]
            else:
                content[place:place] = rolls.randbytes(rolls.randrange(1, 9))
        outcome(written_to(tmp_path / "2024-03-01", bytes(content)))


# Hostile sizes ------------------------------------------------------------------------------------------------------


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


def test_gzip_that_unpacks_to_a_thousand_times_its_size_is_refused_on_the_way(tmp_path: Path) -> None:
    content = bomb(64)
    assert len(content) < 100_000
    words = "unpacks to more than 250 times its size"
    refused(written_to(tmp_path / "bomb.json.gz", content), words)
    refused(written_to(tmp_path / "bomb.csv.gz", content), words, format="csv")
    refused(written_to(tmp_path / "bomb.tar", tar_of([("trace_full_a.json", content)])), words)
    header = gzip.compress(FLIGHT.write_csv().encode())
    refused(written_to(tmp_path / "rows.csv.gz", header + content), words)


@pytest.mark.parametrize("kind", [kind for kind in SOURCES if kind != "tar"])
def test_a_good_file_of_every_source_that_ends_in_a_bomb(kind: str, tmp_path: Path) -> None:
    """Nothing by the hundred megabytes: zeros after binary content, blanks after text."""
    binary = kind in ("parquet", "feather") or kind.startswith("asterix")
    packer = io.BytesIO()
    with gzip.GzipFile(fileobj=packer, mode="wb", compresslevel=9) as out:
        out.write(SOURCES[kind])
        for _ in range(24):
            out.write((b"\0" if binary else b" ") * (1 << 20))
    # Blocks of ASTERIX end at the first zero, long before the limit.
    words = "block of length 0" if kind.startswith("asterix") else "unpacks to more than 250 times its size"
    refused(written_to(tmp_path / "rows.gz", packer.getvalue()), words)


def test_nothing_after_the_end_of_an_archive_is_unpacked(tmp_path: Path) -> None:
    packed_archive = gzip.compress(SOURCES["tar"] + bytes(64 << 20))
    rows, notes = outcome(written_to(tmp_path / "a.tar.gz", packed_archive))
    assert rows is not None, notes
    assert len(rows) == 3 * len(FLIGHT)
    refused(written_to(tmp_path / "b.tar.gz", gzip.compress(bytes(64 << 20))), "neither text nor")


def test_lines_and_documents_that_are_too_long_to_be_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("descentflow.surveillance.sources.streams.LARGEST_LINE", 20_000)
    monkeypatch.setattr("descentflow.surveillance.sources.streams.LARGEST_DOCUMENT", 30_000)
    monkeypatch.setattr("descentflow.surveillance.sources.tables.LARGEST_LINE", 20_000)
    monkeypatch.setattr("descentflow.surveillance.sources.tables.CSV_BYTES", 10_000)
    snapshot = '{"now": 1, "aircraft": []}\n'
    refused(written_to(tmp_path / "a.json", snapshot + " " * 20_001), "line 2: longer than")
    trace = json.dumps(trace_of(flight()), indent=0)
    refused(written_to(tmp_path / "trace_full_a.json", trace), "have to be read as a whole")
    refused(written_to(tmp_path / "t.tar", tar_of([("rows", SOURCES["parquet"] + b"x" * 30_000)])), "read as a whole")
    quote = FLIGHT.write_csv() + '1,"' + "2,2,2,2,2,2,2,2,2\n" * 3000
    refused(written_to(tmp_path / "a.csv", quote), "look for a quote that is not closed")


def test_a_quote_that_is_never_closed_costs_no_more_than_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("descentflow.surveillance.sources.tables.CSV_BYTES", 4 << 20)
    text = FLIGHT.write_csv() + '1,"' + "\n" * (4 << 20)
    rows, words = outcome(written_to(tmp_path / "a.csv", text))
    assert rows is None or len(rows) <= len(FLIGHT) + 1, words


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
    refused(written_to(tmp_path / "b.tar", tar_of(members[1:])), "b.json: damaged gzip")


def test_members_of_other_encodings_and_nested_without_end_are_counted(tmp_path: Path) -> None:
    good, deep = packed(trace_of(FLIGHT)), b"[" * 300_000
    text = json.dumps(trace_of(FLIGHT))
    members = [("a.json", good), ("b.json", deep), ("c.json", gzip.compress(deep))]
    members += [("d.json", text.encode("utf-16")), ("e.json", text.replace("TST", "T\xc4T").encode("latin-1"))]
    members += [("f.tar", tar_of(members[:1])), ("g\udcff\n.json", b"{")]
    rows, notes = outcome(written_to(tmp_path / "a.tar", tar_of(members)))
    assert rows is not None, notes
    assert len(rows) == len(FLIGHT)
    assert notes["traces and members of archives that could not be read"] == 6


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
    refused(tree / "trace_full_4ca001.json", "damaged gzip")


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


def test_the_first_part_of_a_split_archive_alone_is_refused(tmp_path: Path) -> None:
    whole = SOURCES["tar"]
    refused(written_to(tmp_path / "day.tar.aa", whole[: len(whole) // 2]), "pass all parts (.tar.aa, .tar.ab, ...)")
    refused(written_to(tmp_path / "day.tar.ab", whole[len(whole) // 2 :]), "not those between or before")


# Kinds that are known and refused -----------------------------------------------------------------------------------

KNOWN_AND_REFUSED = {
    "pickle": (b"\x80\x04\x95\x10\0\0\0", "opening a pickle runs whatever code it holds"),
    "zip": (b"PK\x03\x04\x14\0", "unpack it and pass the folder"),
    "bzip2": (b"BZh91AY&SY", "unpack it, or pack it with gzip"),
    "xz": (b"\xfd7zXZ\0", "unpack it, or pack it with gzip"),
    "zstandard": (b"\x28\xb5\x2f\xfd", "unpack it, or pack it with gzip"),
    "HDF5": (b"\x89HDF\r\n\x1a\n", "write the table as Parquet"),
    "Feather 1": (b"FEA1\0\0", "Feather version 2"),
    "packets": (b"\xd4\xc3\xb2\xa1\2\0\4\0", "take the payloads out of the packets first"),
    "Beast": (b"\x1a\x33\0\0\0\0\0\0\x80", "with jet1090"),
    "AVR": (b"*8D4CA251204994B1C36E60A5343D;\n", "without the time of each"),
    "AVR with ticks": (b"@016CE3671C748D4CA251204994B1C36E60A5343D;\n", "without the time of each"),
    "false ASTERIX": (bytes([62, 0, 40]) + bytes(60), "neither text nor"),
    "other JSON": (b'{"type": "FeatureCollection", "features": []}', "JSON of no known kind (it has type, features)"),
}


@pytest.mark.parametrize("kind", KNOWN_AND_REFUSED)
def test_other_kinds_are_refused_with_what_to_do(kind: str, tmp_path: Path) -> None:
    content, words = KNOWN_AND_REFUSED[kind]
    refused(written_to(tmp_path / "rows", content), words)


@pytest.mark.parametrize("format", ["parquet", "feather", "csv", "readsb-trace", "aircraft-json", "scat", "modes-hex"])
def test_a_format_that_is_named_wrongly_is_refused(format: str, tmp_path: Path) -> None:
    for kind in ("jet1090", "parquet"):
        if kind != format:
            rows, words = outcome(written_to(tmp_path / "rows", SOURCES[kind]), format=format)
            assert rows is None
            assert "rows" in words


# What is wrong inside -----------------------------------------------------------------------------------------------


def test_blocks_of_asterix_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    pytest.importorskip("pyasteryx")
    good = blocks(62)
    length = len(good) // len(FLIGHT)
    broken = bytearray(good)
    broken[3 * length + 3] = 0b11111111  # presence of items that do not fit
    rows, notes = outcome(written_to(tmp_path / "2024-03-01", bytes(broken)))
    assert len(rows) == len(FLIGHT) - 1
    assert notes == {"ASTERIX blocks that could not be decoded": 1}
    refused(written_to(tmp_path / "2024-03-01", good + bytes([62, 0, 0])), "block of length 0")


def test_frames_with_wrong_parity_or_letters_are_counted(tmp_path: Path) -> None:
    pytest.importorskip("rs1090")
    content = SOURCES["modes-hex"].decode().splitlines()
    content[2] = content[2].split()[0] + " 8d3461ce58079115ee53983ccf12"  # a squitter that should end in 11
    content[5] = content[5].replace(" ", " zz")
    content[7] = "later " + content[7].split()[1]
    # Parity over the address: a wrong bit makes up another address.
    content[9] = content[9][:-1] + ("0" if content[9][-1] != "0" else "1")
    rows, notes = outcome(written_to(tmp_path / "frames", "\n".join(content)))
    assert len(rows) == len(FLIGHT) - 3
    assert notes == {
        "lines that are no time and frame": 2,
        "Mode S frames that could not be decoded (parity or format)": 1,
        "Mode S messages of addresses that hardly appear (bit errors)": 1,
    }


@pytest.mark.parametrize("category", [62, 48])
def test_absurd_values_of_asterix_are_read_as_sent_and_are_impossible(category: int, tmp_path: Path) -> None:
    """The largest numbers that fit: the cleaning counts them as impossible, each for itself."""
    pytest.importorskip("pyasteryx")
    found = b""
    for number, row in enumerate(FLIGHT.iter_rows(named=True)):
        level, ias, mach, rate = row["altitude"] / 100, 270, row["Mach"], row["vertical_rate"]
        level, ias, mach = (8191 if number == 5 else level, 1023 if number == 7 else ias, 2.04 if number == 9 else mach)
        if category == 62:
            found += cat062("4ca001", 36_000 + 5 * number, level, ias, mach, -2e5 if number == 11 else rate)
        else:
            found += cat048("4ca001", 36_000 + 5 * number, min(level, 2047), {0x60: register_60(90.0, ias, mach, rate)})
    rows, notes = outcome(written_to(tmp_path / "2024-03-01", found))
    assert rows is not None, notes
    assert len(rows) == len(FLIGHT)
    assert len(possible(rows)) == len(FLIGHT) - 3
    assert rows["altitude"].max() > 200_000


@pytest.mark.parametrize("jump_s", [2e4, 5e4, -2e4, -3.5e4])
@pytest.mark.parametrize("begin_s", [36_000, 80_000])
def test_a_time_of_day_that_jumps_in_asterix_moves_one_row_alone(begin_s: int, jump_s: float, tmp_path: Path) -> None:
    """A time far back may be past midnight, one far on before it: whatever it is taken for, the next row is right."""
    pytest.importorskip("pyasteryx")
    found, bad = b"", 30
    for number, row in enumerate(FLIGHT.iter_rows(named=True)):
        seconds = (begin_s + 5 * number + (jump_s if number == bad else 0)) % 86_400
        found += cat062("4ca001", seconds, row["altitude"] / 100, 270, row["Mach"], row["vertical_rate"])
    rows, words = outcome(written_to(tmp_path / "2024-03-01", found))
    assert rows is not None, words
    since = (rows["timestamp"] - rows["timestamp"][0]).dt.total_seconds().to_list()
    assert [number for number, time in enumerate(since) if time != 5 * number] == [bad]


ABSURD_TIMES = ("nan", "inf", "-inf", "1e308", "-5", "9" * 5000, "", "12:00")


@pytest.mark.parametrize("time", ABSURD_TIMES)
def test_absurd_times_of_frames_cost_one_row(time: str, tmp_path: Path) -> None:
    pytest.importorskip("rs1090")
    content = SOURCES["modes-hex"].decode().splitlines()
    content[31] = f"{time} {content[31].split()[1]}"
    rows, notes = outcome(written_to(tmp_path / "frames", "\n".join(content)))
    assert rows is not None, notes
    assert len(rows.drop_nulls("timestamp")) == len(FLIGHT) - 1
    assert sum(notes.values()) == 1


@pytest.mark.parametrize("kind", TABLES)
def test_tables_of_mixed_types(kind: str, tmp_path: Path) -> None:
    """Numbers as text with other words among them, in every kind of table: read, or missing and counted."""
    index = pl.int_range(pl.len())
    words = {5: "n/a", 7: "1e400", 9: "NaN", 11: "0x10", 13: "270 kt"}
    ias = pl.col("IAS").cast(pl.String)
    for number, word in words.items():
        ias = pl.when(index == number).then(pl.lit(word)).otherwise(ias)
    mixed = FLIGHT.with_columns(ias.alias("IAS"), pl.col("altitude").cast(pl.String))
    content = table_of(mixed, kind)
    rows, notes = outcome(written_to(tmp_path / "rows", content))
    assert rows is not None, notes
    assert rows.schema["IAS"] == pl.Float64
    assert rows.with_row_index().filter(pl.col("IAS").is_null())["index"].to_list() == list(words)
    assert notes["values of IAS that could not be read"] == 3
    assert len(possible(rows)) == len(FLIGHT) - len(words)


@pytest.mark.parametrize("jump_s", [3e5, -3e5])
@pytest.mark.parametrize(
    "kind",
    [*TABLES, "readsb-trace", "aircraft-json", "scat", "jet1090", "modes-hex"],
)
def test_a_clock_that_jumps_moves_one_row_alone(kind: str, jump_s: float, tmp_path: Path) -> None:
    number = 30
    if kind == "readsb-trace":
        document = trace_of(FLIGHT)
        document["trace"][number][0] += jump_s
        content = json.dumps(document).encode()
    elif kind == "scat":
        document = scat_of(flight())
        document["plots"] = document["plots"][: len(FLIGHT)]
        moved = FLIGHT["timestamp"][number].timestamp() + jump_s
        stamp = pl.from_epoch(pl.Series([moved]), "s").dt.strftime("%Y-%m-%dT%H:%M:%S.000000")[0]
        document["plots"][number]["time_of_track"] = stamp
        content = json.dumps(document).encode()
    elif kind in TABLES:
        late = pl.int_range(pl.len()) == number
        moved = pl.when(late).then(pl.col("timestamp") + pl.duration(seconds=int(jump_s))).otherwise("timestamp")
        content = table_of(FLIGHT.with_columns(moved.alias("timestamp")), kind)
    else:
        found = SOURCES[kind].decode().splitlines()
        place = 2 * number + 1 if kind == "modes-hex" else number
        if kind == "modes-hex":
            time, frame = found[place].split()
            found[place] = f"{float(time) + jump_s} {frame}"
        else:
            line = json.loads(found[place])
            line["now" if kind == "aircraft-json" else "timestamp"] += jump_s
            found[place] = json.dumps(line)
        content = "\n".join(found).encode()
    rows, words = outcome(written_to(tmp_path / "rows", content))
    assert rows is not None, words
    assert len(rows) == len(FLIGHT)
    late = (rows["timestamp"].sort() - FLIGHT["timestamp"].shift(0)).dt.total_seconds().abs()
    away = rows.filter(
        (pl.col("timestamp") > FLIGHT["timestamp"].max() + pl.duration(days=1))
        | (pl.col("timestamp") < FLIGHT["timestamp"].min() - pl.duration(days=1))
    )
    assert len(away) == 1
    assert late.max() > 1e5
    assert away["altitude"][0] == pytest.approx(FLIGHT["altitude"][number], abs=13)


def test_hostile_files_through_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Status 2 and no trace of the program for errors; a descent and a count for an archive with bad members."""
    out, report = tmp_path / "d.parquet", tmp_path / "r.json"
    for name, content in (("deep.json", b"[" * 300_000), ("bomb.gz", bomb(32)), ("rows.pkl", b"\x80\x04\x95")):
        status = main(["prepare", str(written_to(tmp_path / name, content)), "--out", str(out)])
        words = capsys.readouterr().err
        assert status == 2
        assert "to mend it" in words
        assert "Traceback" not in words
        assert not out.exists()
    members = [("t/trace_full_4ca001.json", packed(trace_of(flight()))), ("t/trace_full_4ca002.json", b"{")]
    archive = written_to(tmp_path / "day.tar", tar_of(members))
    assert main(["prepare", str(archive), "--out", str(out), "--report", str(report)]) == 0
    notes = json.loads(report.read_text())["report"]["notes"]
    assert notes["traces and members of archives that could not be read"] == 1
    assert pl.read_parquet(out)["flight_id"].unique().to_list() == ["4ca001_20240301T100000"]
