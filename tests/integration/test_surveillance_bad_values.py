"""Files of every source that are whole but wrong inside: bad blocks, mixed types, absurd values, clocks that jump."""

import json
from pathlib import Path

import polars as pl
import pytest
from hostile_toys import FLIGHT, SOURCES, TABLES, blocks, outcome, refused, table_of
from source_toys import cat048, cat062, possible, register_60, scat_of, trace_of, written_to
from surveillance_toys import flight


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
