"""Files that are no table of rows are named as what they are, with what to do."""

import io
import json
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import polars as pl
import pytest
import torch
from polars.testing import assert_frame_equal
from surveillance_toys import fleet, written

from descentflow.core.errors import DataError
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.read_rows import read_rows
from descentflow.surveillance.rows.drop_report import DropReport


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
