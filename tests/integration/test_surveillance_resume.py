"""A killed run or worker loses nothing: the rerun goes on, and its result is that of an unbroken run."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from polars.testing import assert_frame_equal
from refusals import refuses
from surveillance_toys import fleet, written

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.workers import Engine
from descentflow.surveillance.descents.prepared_descents import read_descents
from descentflow.surveillance.out_of_core import _groups, _job
from descentflow.surveillance.out_of_core import _partitions as engines
from descentflow.surveillance.prepare import Cleaning, prepare

MEMORY = 800_000
"""So little that the fleet makes some twenty partitions."""
SLOW_RUN = """
import sys, time
from pathlib import Path
from descentflow.surveillance.out_of_core import _partitions as engine
from descentflow.surveillance import prepare
clean = engine.clean
engine.clean = lambda *args: (time.sleep(0.15), clean(*args))[1]
prepare.prepare([Path(sys.argv[1])], out=Path(sys.argv[2]), memory_bytes={memory}, workers=1)
"""

SLOW_WORKER = """
import time
from descentflow.surveillance.out_of_core import _partitions as engine
engine.clean = lambda *args, clean=engine.clean: (time.sleep(0.15), clean(*args))[1]
"""


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rows of sixty aircraft, braided in time."""
    dozen = fleet(12)
    many = pl.concat(
        dozen.with_columns(icao24=pl.col("icao24").str.replace("4ca", f"{number:03x}")) for number in range(5)
    )
    return written(many.sort("timestamp"), tmp_path_factory.mktemp("rows") / "rows.parquet")


def wait_for_parts(folder: Path, number: int) -> list[Path]:
    """Parts that are whole, as soon as there are so many."""
    for _ in range(3000):
        parts = sorted(folder.glob("parts/[0-9]*.parquet"))
        if len(parts) >= number:
            return parts
        time.sleep(0.01)
    raise AssertionError(f"no {number} parts within half a minute")


@pytest.mark.parametrize("out", ["store", "d.parquet"])
def test_a_killed_run_leaves_its_parts_and_the_rerun_goes_on(out: str, rows: Path, tmp_path: Path) -> None:
    target, work = tmp_path / out, tmp_path / f"{out}.work"
    program = SLOW_RUN.format(memory=MEMORY)
    with subprocess.Popen([sys.executable, "-c", program, str(rows), str(target)]) as run:
        wait_for_parts(work, 3)
        run.send_signal(signal.SIGKILL)
    assert run.returncode == -signal.SIGKILL
    assert not target.exists()
    done = {path: path.stat().st_mtime_ns for path in wait_for_parts(work, 3)}
    planned = len(json.loads((work / "partitions.json").read_text()))
    assert len(done) < planned

    refuses(ConfigError, "other inputs or settings", prepare, [rows], cleaning=Cleaning(bottom_fl=100), out=target)
    said: list[str] = []
    cleaned: list[Path] = []

    class Watched(Engine):
        def run(self, function, tasks, *more):  # type: ignore[no-untyped-def]
            cleaned.extend(task.target for task in tasks if isinstance(task, engines.Partition))
            return super().run(function, tasks, *more)

    prepare([rows], out=target, engine=Watched(2), progress=said.append)
    assert f"going on after {len(done)} of {planned} parts" in said
    assert len(cleaned) == planned - len(done)
    assert not set(cleaned) & set(done)
    assert [path.name for path in tmp_path.iterdir()] == [out]
    whole = prepare([rows])
    descents = read_descents(target)
    assert_frame_equal(descents.frame, whole.frame, check_exact=True)
    assert descents.metadata["report"] == whole.report.as_dict()


def test_groups_that_were_read_are_not_read_again(rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = pl.read_parquet(rows)
    folder = tmp_path / "many"
    folder.mkdir()
    for number, part in enumerate(frame.iter_slices(len(frame) // 5 + 1)):
        part.write_parquet(folder / f"{number}.parquet")
    monkeypatch.setattr(_groups, "GROUP_BYTES", 1)
    read: list[str] = []
    take_in = _groups.take_in

    def interrupted(files, *args):  # type: ignore[no-untyped-def]
        if len(read) == 2:
            raise KeyboardInterrupt
        read.append(files[0].name)
        return take_in(files, *args)

    monkeypatch.setattr(_groups, "take_in", interrupted)
    with pytest.raises(KeyboardInterrupt):
        prepare([folder], out=tmp_path / "s", memory_bytes=MEMORY)
    read.append("interrupted")
    prepare([folder], out=tmp_path / "s", memory_bytes=MEMORY)
    assert read == ["0.parquet", "1.parquet", "interrupted", "2.parquet", "3.parquet", "4.parquet"]
    assert_frame_equal(read_descents(tmp_path / "s").frame, prepare([rows]).frame, check_exact=True)


def test_a_group_without_a_row_is_counted_unless_all_are_so(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_groups, "GROUP_BYTES", 1)
    empty = written(pl.read_parquet(rows).clear(), tmp_path / "empty.parquet")
    prepared = prepare([empty, rows], out=tmp_path / "d.parquet")
    assert prepared.report.notes["groups of files without a row"] == 1
    assert_frame_equal(read_descents(tmp_path / "d.parquet").frame, prepare([rows]).frame, check_exact=True)
    again = written(pl.read_parquet(rows).clear(), tmp_path / "again.parquet")
    refuses(DataError, "no row", prepare, [empty, again], out=tmp_path / "n.parquet")
    refuses(DataError, "no row in", prepare, [empty], out=tmp_path / "n.parquet")


def test_two_runs_at_once_on_one_output_are_refused(rows: Path, tmp_path: Path) -> None:
    def again(words: str) -> None:
        if words.startswith("cleaning"):
            prepare([rows], out=tmp_path / "d.parquet", memory_bytes=MEMORY)

    with pytest.raises(ConfigError, match="another run is at work"):
        prepare([rows], out=tmp_path / "d.parquet", memory_bytes=MEMORY, progress=again)
    assert list(tmp_path.iterdir()) == []


class Killed(BaseException):
    """As SIGKILL: nothing of the run goes on."""


@pytest.mark.parametrize("out", ["descents.parquet", "store"])
@pytest.mark.parametrize("instant", ["before", "amid"])
def test_a_run_that_is_killed_while_it_removes_its_work_leaves_none_of_it_to_the_next(
    instant: str, out: str, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def kill(folder: Path, ignore_errors: bool = False, remove: Callable[..., None] = shutil.rmtree) -> None:
        if instant == "amid" and not (parts := sorted(folder.glob("parts/*.parquet"))):
            return remove(folder, ignore_errors)
        if instant == "amid":
            parts[0].unlink()
        raise Killed

    place = tmp_path / "out"
    place.mkdir()
    with monkeypatch.context() as patched:
        patched.setattr(*((_job, "_remove") if instant == "before" else (shutil, "rmtree")), kill)
        with pytest.raises(Killed):
            prepare(rows, out=place / out, memory_bytes=MEMORY)
    assert len(list(place.iterdir())) == 2
    again = prepare(rows, out=place / out, memory_bytes=MEMORY)
    assert [path.name for path in place.iterdir()] == [out]
    assert_frame_equal(again.frame, prepare(rows).frame)


def test_a_failing_partition_is_an_error_and_no_output(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(engines, "clean", broken)
    refuses(DataError, "No space left", prepare, [rows], out=tmp_path / "s", memory_bytes=MEMORY)
    assert not (tmp_path / "s").exists()


@pytest.mark.filterwarnings("ignore")
def test_dask_workers_give_the_same_even_when_one_is_killed(rows: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    whole = prepare([rows])
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, memory_limit=0, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(2)
        # Slow enough to be killed at work; as text, because workers do not know the tests' modules.
        client.run(exec, SLOW_WORKER, {})
        victim = next(iter(client.run(os.getpid).values()))
        killed: list[int] = []

        def kill() -> None:
            killed.append(len(wait_for_parts(tmp_path / "s.work", 3)))
            os.kill(victim, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        prepared = prepare([rows], out=tmp_path / "s", memory_bytes=MEMORY, engine=cluster.scheduler_address)
        killer.join()
    assert 3 <= killed[0] < 12
    descents = read_descents(tmp_path / "s")
    assert_frame_equal(descents.frame, whole.frame, check_exact=True)
    assert prepared.report.as_dict() == whole.report.as_dict()
    assert [path.name for path in tmp_path.iterdir()] == ["s"]


def suicide(task: int, _: None) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_is_a_client_or_a_file_its_workers_are_waited_for_and_a_task_that_kills_them_is_told(
    rows: Path, tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    cloudpickle = pytest.importorskip("cloudpickle")
    cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers do not know the tests' modules
    said: list[str] = []
    with (
        distributed.LocalCluster(n_workers=0, threads_per_worker=1, memory_limit=0, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):

        def come(line: str) -> None:
            said.append(line)
            if line.startswith("waiting"):
                cluster.scale(1)

        prepare([rows], out=tmp_path / "by_client", memory_bytes=MEMORY, engine=client, progress=come)
        assert f"waiting for workers of {cluster.scheduler_address}" in said
        (tmp_path / "scheduler.json").write_text(json.dumps({"address": cluster.scheduler_address}))
        prepare([rows], out=tmp_path / "by_file", memory_bytes=MEMORY, engine=tmp_path / "scheduler.json")
        refuses(DataError, "a worker was killed", list, Engine(1, "dask", client).run(suicide, [0], None))
    stores = (tmp_path / "by_client", tmp_path / "by_file")
    of_client, of_file = ([one.read_bytes() for one in sorted(folder.rglob("*.*"))] for folder in stores)
    assert of_client == of_file


def test_without_dask_or_a_scheduler_the_error_says_what_to_do(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError, match="pip install 'distributed>="):
        prepare([rows], out=tmp_path / "d.parquet", memory_bytes=MEMORY, engine="dask")
    monkeypatch.undo()
    for engine, message in (("absent.json", "no Dask scheduler at absent.json"), (3, "an engine of type int")):
        refuses(ConfigError, message, prepare, [rows], out=tmp_path / "d.parquet", memory_bytes=MEMORY, engine=engine)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_command_starts_workers_of_its_own(rows: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    words = ["prepare", str(rows), "--out", str(tmp_path / "d.parquet"), "--engine", "dask", "--workers", "2"]
    subprocess.run([sys.executable, "-m", "descentflow.cli.entry", *words], check=True)
    assert_frame_equal(read_descents(tmp_path / "d.parquet").frame, prepare([rows]).frame, check_exact=True)
