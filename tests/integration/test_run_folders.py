"""Folders of the trainer's commands: no empty runs, results beside their checkpoint, two runs into one target."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_line_toys import QUICK
from surveillance_toys import fleet, written
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from descentflow.cli.entry import main

pytestmark = pytest.mark.usefixtures("plain_figures")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.is_file() and not path.name.startswith("events.")}


def test_a_run_goes_where_it_is_told_and_what_scores_it_goes_into_it(here: Path, descents: Path) -> None:
    words = ["--model", "Gaussian", "--data.descents", str(descents), *QUICK, "--trainer.default_root_dir", "mine"]
    assert main(["fit", *words]) == 0
    run = here / "mine" / "Gaussian" / "version_0"
    checkpoint = ["--ckpt_path", str(run / "checkpoints" / "best.ckpt")]
    before = files(run)
    assert main(["validate", *checkpoint]) == 0
    assert main(["predict", *checkpoint]) == 0
    for _ in range(2):  # once more, over what is there
        assert main(["test", *checkpoint, "--scores.n_test_samples=200"]) == 0
    assert {path.name for path in here.iterdir()} == {"mine"}
    assert {path.name for path in run.parent.iterdir()} == {"version_0"}
    assert {path.name for path in run.iterdir() if path.is_dir()} == {"checkpoints", "predict", "test"}
    assert files(run) == before
    assert {"scores.csv", "profiles.png"} <= files(run / "test")
    assert "log_prob.csv" in files(run / "predict")


def test_trainer_options_that_contradict_each_other_are_told_in_a_line(
    here: Path, descents: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--model", "Gaussian", "--data.descents", str(descents), "--trainer.max_epochs=-2"]
    assert main(["fit", *words]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert line.startswith("descentflow fit: ")
    assert "max_epochs" in line


SHARED = "--trainer.logger=shared_logger.SharedLogger"


def test_a_fit_without_a_logger_that_fails_does_not_stand_in_the_way_of_the_next(here: Path, descents: Path) -> None:
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK, "--trainer.logger=false"]
    with pytest.raises(ValueError, match="as a user's"):
        main([*words, "--trainer.callbacks+=shared_logger.Fail"])
    assert main(words) == 0


def test_runs_of_a_logger_that_shares_its_folder_have_folders_of_their_own(here: Path, descents: Path) -> None:
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK, SHARED]
    for run in ("first", "second"):
        assert main([*words, f"--trainer.logger.run={run}"]) == 0
        folder = here / "runs" / "project" / run
        assert (folder / "config.yaml").is_file()
        checkpoint = str(folder / "checkpoints" / "best.ckpt")
        assert main(["validate", "--ckpt_path", checkpoint]) == 0


@pytest.mark.parametrize("precision", ["bf16-mixed", "16-true", "bf16-true"])
def test_half_precision_is_refused_before_anything_is_written(
    here: Path, descents: Path, precision: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(descents), "--trainer.precision", precision]) == 2
    assert f"precision {precision}; expected 32-true or 64-true" in capsys.readouterr().err
    assert not list(here.iterdir())


@pytest.mark.slow  # processes that import everything anew; test_own_trainer.py has forked ones
def test_two_processes_train_and_validate_as_one_does(here: Path, descents: Path) -> None:
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK, "--data.batch_size", "7"]
    # A score, which the first process alone computes, is asked for in both.
    words += ["--checkpoint.monitor", "val/score/cas_profile/energy"]
    words += ["--trainer.accelerator", "cpu", "--trainer.devices"]
    assert main([*words, "1"]) == 0
    # Two processes that wait for each other would wait for ever.
    command = [sys.executable, "-m", "descentflow", *words, "2"]
    subprocess.run(command, check=True, timeout=300, capture_output=True)
    scalars = []
    for run in sorted((here / "runs" / "Gaussian").iterdir()):
        events = EventAccumulator(str(run))
        events.Reload()
        scalars.append([e.value for name in ("val/nll", "val/score/cas_profile/energy") for e in events.Scalars(name)])
    assert scalars[1] == pytest.approx(scalars[0], rel=1e-6)  # of float32, in which metrics are kept


@pytest.mark.parametrize(
    "option", ["--trainer.fast_dev_run=true", "--trainer.limit_train_batches=0", "--trainer.max_epochs=0"]
)
def test_a_fit_that_keeps_no_checkpoint_claims_none(
    here: Path, descents: Path, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK, option]) == 0
    said = capsys.readouterr().out
    assert "no checkpoint was written" in said
    assert "descentflow sample" not in said
    assert not list(here.rglob("*.ckpt"))


def test_a_callback_that_cannot_be_made_is_named_in_a_line(
    here: Path, descents: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a logger whose library is missing, or refuses its folder."""
    words = ["--trainer.callbacks+=EarlyStopping", "--trainer.callbacks.monitor=val/nll", "--trainer.callbacks.mode=up"]
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK, *words]) == 2
    said = capsys.readouterr().err
    assert (
        "cannot be taken: MisconfigurationException: `mode` can be min, max, got up; expected options of trainer"
        in said
    )
    assert "Traceback" not in said


def test_a_csv_logger_does_not_delete_the_metrics_of_another_run(
    descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("runs").mkdir()
    Path("runs", "metrics.csv").write_text("another's")
    logger = ["--trainer.logger", "CSVLogger", "--trainer.logger.save_dir", "runs", "--trainer.logger.version", ".."]
    assert main(["fit", "--model", "gaussian", "--data.descents", str(descents), *logger]) == 2
    assert "metrics.csv of another run" in capsys.readouterr().err
    assert Path("runs", "metrics.csv").read_text() == "another's"


NO_HOME = "/dev/null/home"
"""No folder can be made there, whoever asks."""


def begun(*words: str | Path, folder: Path) -> subprocess.Popen[str]:
    """The command, begun in a folder and with a home that cannot be written."""
    hidden = ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR")
    environment = {name: value for name, value in os.environ.items() if name not in hidden} | {"HOME": NO_HOME}
    command = [sys.executable, "-m", "descentflow", *map(str, words)]
    return subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)


def test_two_runs_into_one_file_leave_what_one_leaves(tmp_path: Path) -> None:
    """The later one is refused while the first is at work; begun after it, it finds the file and writes it again."""
    rows = written(fleet(3), tmp_path / "rows.parquet")
    for number, folder in ((1, tmp_path / "alone"), (2, tmp_path / "together")):
        folder.mkdir()
        runs = [begun("prepare", rows, "--out", "d.parquet", "--quiet", folder=folder) for _ in range(number)]
        said = [run.communicate()[1] for run in runs]
        ended = [run.returncode for run in runs]
        assert 0 in ended, said
        assert all(not status or "another run is at work" in text for status, text in zip(ended, said, strict=True))
        assert [path.name for path in folder.iterdir()] == ["d.parquet"]
    alone, together = ((tmp_path / name / "d.parquet").read_bytes() for name in ("alone", "together"))
    assert alone == together
