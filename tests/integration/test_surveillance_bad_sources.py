"""Damaged files of every source, cut or wrong inside: a clear error or a counted drop, and never anything else."""

import gzip
import random
from pathlib import Path

import pytest
from hostile_toys import FLIGHT, OF_JSON, SOURCES, blocks, outcome, refused
from source_toys import cat062, written_to

from descentflow.surveillance.formats.json_rows import DAMAGED

ODD = (None, True, 1e308, -1e308, 10**400, float("nan"), "x", "", [], {}, [1], {"a": 1}, "\ud800", -1, 1e18, "9" * 999)


@pytest.mark.parametrize("kind", SOURCES)
def test_whole_files_are_read(kind: str, tmp_path: Path) -> None:
    rows, notes = outcome(written_to(tmp_path / "2024-03-01", SOURCES[kind]))
    assert rows is not None, notes
    assert len(rows) >= len(FLIGHT)
    assert set(notes) <= {"trace points whose Mach was computed from IAS and altitude"}


CUT = {
    "csv": None,  # a CSV may end anywhere; the last line then lacks values or has a short one
    "aircraft-json": DAMAGED,
    "jet1090": DAMAGED,
    "modes-hex": "lines that are no time and frame",
    "asterix-062": "ASTERIX blocks cut at the end of a file",
    "asterix-048": "ASTERIX blocks cut at the end of a file",
    "tar": "damaged or cut archive",
}
"""Messages on a cut file, as an error or a count; those not named are JSON documents or binary tables."""


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
        assert [number for note, number in words.items() if note.startswith(expected)] == [1]
    else:
        assert rows is None
        assert expected in words


@pytest.mark.parametrize("kind", SOURCES)
def test_truncated_gzip(kind: str, tmp_path: Path) -> None:
    content = gzip.compress(SOURCES[kind])
    refused(written_to(tmp_path / "rows.gz", content[: len(content) // 2]), "Compressed file ended")
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
    "so6": (b"A_B EHAM UUEE A321 214900 214926 0 10 0 AFL2 171214 171214 1 2 3 4 7 1 1.4 0\n", "so6 of EUROCONTROL"),
    "ALL_FT+": (b"6\n" + b";" * 150 + b"\n", "ALL_FT+ of EUROCONTROL"),
    "BaseStation": (
        b"MSG,3,1,1,4CA001,1,2024/03/01,10:00:00.123,2024/03/01,10:00:00.123,,35000,,,52.1,4.5,,,0,0,0,0\r\n",
        "BaseStation (SBS-1) log, whose messages have no IAS and no Mach",
    ),
    "CR alone": (b"timestamp,icao24,altitude,IAS,Mach\r1,4ca001,30000,270,0.7\r", "lines end in CR alone"),
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
