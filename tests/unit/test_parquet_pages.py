"""Damaged counts in Parquet pages, by which Polars would end the process: found before it reads them."""

import gzip
import io
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from descentflow.cli.entry import main
from descentflow.core.errors import DataError
from descentflow.core.parquet_pages import DamagedParquetError, check_pages
from descentflow.representation.context_columns import read_table
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport

ONE_VALUE = b"\x2c\x15\x02"
"""In a page header: the structure of a data page (field 5), in it the number of values (field 1), 1."""
MINUS_ONE = b"\x2c\x15\x01"


def content(frame: pl.DataFrame, **options: object) -> bytes:
    file = io.BytesIO()
    frame.write_parquet(file, **options)
    return file.getvalue()


def smallest() -> bytes:
    """One value, and a page that claims to hold -1."""
    described = {"descentflow": "{}"}
    whole = content(pl.DataFrame({"IAS": [250.0]}), statistics=False, compression="uncompressed", metadata=described)
    assert ONE_VALUE in whole, "Polars writes page headers in another way"
    return whole.replace(ONE_VALUE, MINUS_ONE)


@pytest.mark.parametrize("read", [lambda path: read_rows([path], DropReport()), read_descents, read_table])
def test_a_page_of_less_than_nothing(read: Callable[[Path], object], tmp_path: Path) -> None:
    path = tmp_path / "rows.parquet"
    path.write_bytes(smallest())
    with pytest.raises(DataError, match=r"rows\.parquet: the page at byte 4 has a negative number of values"):
        read(path)


def test_commands_end_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rows.parquet.gz"
    path.write_bytes(gzip.compress(smallest()))
    assert main(["prepare", str(path), "--out", str(tmp_path / "out.parquet"), "--workers", "1"]) == 2
    said = capsys.readouterr().err
    assert "negative number of values" in said
    assert "copy it again" in said
    assert [one.name for one in tmp_path.iterdir()] == ["rows.parquet.gz"]


FRAME = pl.DataFrame(
    {
        "text": [f"flight {number % 7}" for number in range(300)],
        "number": [None if number % 5 == 0 else number / 3 for number in range(300)],
        "yes": [number % 2 == 0 for number in range(300)],
        "list": [[number] * (number % 3) for number in range(300)],
        "nested": [{"a": number, "b": None if number else 1.5} for number in range(300)],
        "nothing": pl.Series([None] * 300, dtype=pl.Float64),
        "constant": [25_000.0] * 300,
    }
)


@pytest.mark.parametrize("compression", ["uncompressed", "zstd", "snappy", "lz4", "gzip", "brotli"])
@pytest.mark.parametrize("more", [{}, {"row_group_size": 70}, {"data_page_size": 100}, {"statistics": "full"}])
def test_whole_files_pass(compression: str, more: dict, tmp_path: Path) -> None:
    path = tmp_path / "whole.parquet"
    for frame in (FRAME, FRAME.head(1), FRAME.clear(), FRAME.select(pl.col("text").repeat_by(200).list.join(","))):
        frame.write_parquet(path, compression=compression, **more)
        check_pages(path)


@pytest.mark.parametrize("version", ["parquet_1_0", "parquet_2_0"])
def test_files_of_another_writer_pass(version: str, tmp_path: Path) -> None:
    """The writer of Apache Arrow for Rust; version 2 has other page headers."""
    arrow, files = pytest.importorskip("arro3.core"), pytest.importorskip("arro3.io")
    path = tmp_path / "whole.parquet"
    files.write_parquet(arrow.Table.from_arrow(FRAME), str(path), writer_version=version)
    check_pages(path)
    damaged = bytearray(path.read_bytes())
    kind = b"\x5c\x15" if version == "parquet_2_0" else b"\x2c\x15"
    place = bytes(damaged).index(kind) + len(kind)
    damaged[place] |= 1
    with pytest.raises(DamagedParquetError, match="negative number of values"):
        check_pages(bytes(damaged))


def test_the_last_of_many_pages_is_looked_at() -> None:
    whole = content(FRAME.select("number"), compression="uncompressed", row_group_size=1, statistics=False)
    place = whole.rindex(ONE_VALUE)
    damaged = whole[:place] + MINUS_ONE + whole[place + len(MINUS_ONE) :]
    with pytest.raises(DamagedParquetError, match=f"the page at byte {place - 6} has a negative"):
        check_pages(damaged)


def test_any_byte_of_a_file_changed() -> None:
    """Unreadable files are a DamagedParquetError, never another: 1,500 damaged files, and 400 that are cut."""
    whole = content(FRAME.head(3).select("text", "number"))
    refused = 0
    for place in range(4, len(whole)):
        for value in (whole[place] ^ 1, 0xFF):
            refused += _is_refused(whole[:place] + bytes([value]) + whole[place + 1 :])
        refused += _is_refused(whole[:place])
    assert refused > len(whole), "every file that is cut, and some of the others"


def _is_refused(damaged: bytes) -> bool:
    try:
        check_pages(damaged)
    except DamagedParquetError:
        return True
    return False
