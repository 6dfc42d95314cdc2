"""Files of every source that are whole but wrong inside: bad blocks, mixed types, absurd values, clocks that jump."""

from pathlib import Path

import pytest
from hostile_toys import FLIGHT, SOURCES, blocks, outcome, refused
from source_toys import cat062, written_to


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
