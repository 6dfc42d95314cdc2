"""An output that cannot be written is refused before the work, and what the system refuses in the middle in a line."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import polars as pl
import pytest
from refusals import refuses

import descentflow as df
from descentflow.cli.ending import ended_in_order
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import check_folder, system_number, whole_file
from descentflow.simulation.world import world_files

NO_MODEL = "no.ckpt"
"""It is empty: who tells of the output first has not read it."""


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Ctrl-C arrives also where the tests run in the background of a shell, which has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A file where a folder is wanted."""
    monkeypatch.chdir(tmp_path)
    Path("rows.csv").write_text("icao24,time\n")
    Path("taken").write_text("mine")
    Path(NO_MODEL).touch()
    return "taken"


@pytest.mark.parametrize(
    "words",
    [
        ("evaluate", NO_MODEL, "--real", "rows.csv", "--out"),
        ("diagnose", "--simulator", NO_MODEL, "--real", "rows.csv", "--out"),
        ("prepare", "rows.csv", "--out"),
        ("prepare", "rows.csv", "--out", "p.parquet", "--figures"),
    ],
)
def test_a_folder_that_is_a_file_is_told_first(
    taken: str, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, taken]) == 2
    assert "output taken is a file; expected a folder" in capsys.readouterr().err
    assert Path(taken).read_text() == "mine"


def test_a_fit_tells_its_folder_before_it_reads_descents(taken: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("no_store").mkdir()
    words = ["fit", "--model", "Gaussian", "--data.descents", "no_store", "--trainer.default_root_dir", taken]
    assert main(words) == 2
    assert "output taken is a file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "call",
    [
        lambda: df.fit("none.parquet", "gaussian", out="folder.ckpt"),
        lambda: df.simulate("A320", 1, out="folder.parquet"),
        lambda: world_files(Path("w.parquet")),
        lambda: check_folder(".", "other.csv", "scores.csv"),
    ],
)
@pytest.mark.usefixtures("taken")
def test_a_call_tells_its_output_first(call: Callable[[], object]) -> None:
    for name in ("folder.parquet", "folder.ckpt", "w_truth.parquet", "scores.csv"):
        Path(name).mkdir()
    refuses(DataError, "is a folder", call)


def test_what_polars_tells_of_a_full_disk_is_told_as_the_system_does(tmp_path: Path) -> None:
    refused = pl.exceptions.ComputeError("parquet: underlying IO error: File too large (os error 27)")
    assert system_number(refused) == 27

    def fail() -> None:
        with whole_file(tmp_path / "out.parquet"):
            raise refused

    refuses(DataError, "cannot be written: File too large", fail)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_what_the_system_refuses_to_a_thread_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    def write() -> None:
        raise OSError(28, "No space left on device")

    with ended_in_order("fit"):
        thread = threading.Thread(target=write)
        thread.start()
        thread.join()
    said = capsys.readouterr().err
    assert said == "descentflow fit: warning: a log is not whole: [Errno 28] No space left on device\n"


@pytest.mark.parametrize(
    ("reads", "status", "said"), [(True, 1, "a process that the command began, has ended early"), (False, 0, "")]
)
def test_a_broken_pipe_ends_a_command_well_only_where_nobody_reads_its_output(
    reads: bool, status: int, said: str
) -> None:
    """The pipe to a worker that is killed while it starts breaks, too: that was taken for `| head`."""
    code = """from descentflow.cli.ending import ended_in_order
with ended_in_order("study"):
    raise BrokenPipeError(32, "gone")"""
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        if not reads:
            process.stdout.close()
        errors = process.stderr.read()
    assert (process.returncode, said in errors, bool(errors)) == (status, True, reads)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize(
    "error",
    [
        ValueError("not a valid PEP 3118 buffer format string"),
        OSError(5, "failed"),
        SystemExit(1),
        pl.exceptions.PanicException("called `Result::unwrap()` on an `Err` value"),
    ],
)
def test_an_interruption_that_a_library_takes_for_a_failure_is_none(
    number: signal.Signals, status: int, error: BaseException, capsys: pytest.CaptureFixture[str]
) -> None:
    """NumPy did so with a buffer's format, Polars when it first looked for NumPy; Lightning ends the process."""
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)

    def library() -> None:
        try:
            signal.raise_signal(number)
        except BaseException:
            raise error from None

    with pytest.raises(SystemExit) as ended, ended_in_order("evaluate"):
        library()
    assert ended.value.code == status
    assert capsys.readouterr().err == ("\ndescentflow evaluate: interrupted\n" if status == 130 else "")
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interruption_within_a_finalizer_is_not_lost(
    number: signal.Signals, status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Python ignores what a finalizer raises, prints a traceback and goes on."""

    class Finalized:
        def __del__(self) -> None:
            signal.raise_signal(number)

    def work() -> None:
        Finalized()
        time.sleep(20)

    hook, begun = sys.unraisablehook, time.monotonic()
    with pytest.raises(SystemExit) as ended, ended_in_order("fit"):
        work()
    assert time.monotonic() - begun < 20
    assert ended.value.code == status
    assert "Traceback" not in capsys.readouterr().err
    assert sys.unraisablehook is hook


@pytest.mark.usefixtures("taken")
def test_an_output_that_is_an_input_is_refused_and_stays(capsys: pytest.CaptureFixture[str]) -> None:
    mine = Path("mine.parquet").absolute()
    pl.DataFrame({"mine": [1]}).write_parquet(mine)
    refuses(ConfigError, r"also an input or the other output \(mine\.parquet\)", df.prepare, mine, out="mine.parquet")
    Path("flown").mkdir()
    for sides in ({"real": "flown", "simulator": "A320"}, {"real": "rows.csv", "simulator": ["rows.csv", "flown"]}):
        refuses(ConfigError, r"also an input or the other output \(flown\)", df.diagnose, **sides, out="flown")
    words = ["predict-descent", NO_MODEL, str(mine), "--from-fl", "250", "--out"]
    for outputs in (
        ["mine.parquet"],
        ["a.csv", "--continuations", "mine.parquet"],
        ["a.csv", "--continuations", "a.csv"],
    ):
        assert main([*words, *outputs]) == 2
        assert "also an input or the other output" in capsys.readouterr().err
    for option in ("--given-table", "--air"):
        assert main(["sample", NO_MODEL, option, str(mine), "--out", "mine.parquet"]) == 2
        assert "also an input or the other output" in capsys.readouterr().err
    assert pl.read_parquet(mine).columns == ["mine"]
