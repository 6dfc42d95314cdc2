"""Inputs and outputs at addresses of fsspec are those of local files, and nothing is left on this machine."""

import gc
from pathlib import Path

import fsspec
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from surveillance_toys import fleet, written

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core import _remote_files
from descentflow.core.errors import ConfigError, DataError


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> fsspec.AbstractFileSystem:
    monkeypatch.chdir(tmp_path)
    written(fleet(12), tmp_path / "rows.parquet")
    files = fsspec.filesystem("memory")
    files.put(str(tmp_path / "rows.parquet"), "/bucket/rows/rows.parquet")
    yield files
    files.rm("/bucket", recursive=True)


def test_rows_and_stores_elsewhere_are_those_of_local_files(place: fsspec.AbstractFileSystem, tmp_path: Path) -> None:
    here = df.prepare("rows.parquet", out="store")
    prepared = df.prepare("memory://bucket/rows", out="memory://bucket/store")
    assert_frame_equal(prepared.frame, here.frame, check_exact=True)
    for path in (tmp_path / "store").rglob("*.*"):
        assert place.cat(f"/bucket/store/{path.relative_to(tmp_path / 'store').as_posix()}") == path.read_bytes()
    assert_frame_equal(df.read_descents("memory://bucket/store").frame, here.frame, check_exact=True)
    said: list[str] = []
    df.prepare("memory://bucket/rows", out=Path("memory://bucket/store"), progress=said.append)
    assert said[-1] == "found finished"
    with pytest.raises(ConfigError, match="a store of other inputs or settings"):
        df.prepare("memory://bucket/rows", bottom_fl=200, out="memory://bucket/store")
    del prepared
    gc.collect()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rows.parquet", "store"]


def test_commands_take_and_write_addresses(place: fsspec.AbstractFileSystem, tmp_path: Path, capsys) -> None:
    assert main(["prepare", "memory://bucket/rows/rows.parquet", "--out", "memory://bucket/d.parquet"]) == 0
    assert "sent to memory://bucket/d.parquet" in capsys.readouterr().out
    with place.open("/bucket/d.parquet") as file:
        assert "flight_id" in pl.read_parquet(file).columns
    assert main(["prepare", "memory://bucket/absent.parquet", "--out", "memory://bucket/e.parquet"]) == 2
    assert "memory://bucket/absent.parquet: FileNotFoundError" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["rows.parquet"]


def test_what_could_not_be_sent_stays_for_the_same_call(
    place: fsspec.AbstractFileSystem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(type(place), "put_file", lambda *_: (_ for _ in ()).throw(PermissionError("denied")))
        with pytest.raises(DataError, match="memory://bucket: PermissionError: denied"):
            df.prepare("memory://bucket/rows", out="memory://bucket/store")
    assert len(list((tmp_path / _remote_files.COPIES_FOLDER).glob("*/store/_descentflow.json"))) == 1
    said: list[str] = []
    df.prepare("memory://bucket/rows", out="memory://bucket/store", progress=said.append)
    assert said[-1] == "found finished"
    assert place.exists("/bucket/store/_descentflow.json")


def test_a_protocol_without_its_library_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(__import__("sys").modules, "s3fs", None)
    with pytest.raises(ConfigError, match="pip install s3fs"):
        df.prepare("s3://bucket/rows.parquet")
    assert list(tmp_path.iterdir()) == []
