"""Cleaning settings travel from `prepare` by the checkpoint to every command that holds flights against it."""

import json
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from descentflow.cli.entry import main
from descentflow.core.errors import DescentflowWarning

pytestmark = pytest.mark.usefixtures("components_once", "plain_figures", "worlds_once")

STRICT = ["--slowest-fpm", "1200", "--transient-s", "60"]
QUICK = ["--trainer.enable_progress_bar=false", "--trainer.enable_model_summary=false", "--scores.n_samples=100"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulator of 300 A320, prepared strictly; 200 others of its world as rows, prepared alike and by default."""
    folder = tmp_path_factory.mktemp("travels")
    for name, flights, seed in (("own_rows", "300", "0"), ("rows", "200", "1")):
        words = ["simulate", "--typecode", "A320", "--flights", flights, "--seed", seed]
        assert main([*words, "--out", str(folder / f"{name}.parquet")]) == 0
    for rows, out, settings in (
        ("own_rows", "own", STRICT),
        ("rows", "alike", STRICT),
        ("rows", "default", []),
    ):
        words = ["prepare", str(folder / f"{rows}.parquet"), *settings]
        assert main([*words, "--out", str(folder / f"{out}.parquet")]) == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["fit", "--config", "gaussian", "--data.descents", "own.parquet", *QUICK]) == 0
    (checkpoint,) = folder.rglob("best.ckpt")
    checkpoint.rename(folder / "simulator.ckpt")
    return folder


def test_diagnose_cleans_rows_as_the_simulators_own(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = {}
    for real in ("rows", "alike"):
        words = ["diagnose", "--real", str(folder / f"{real}.parquet"), "--simulator", str(folder / "simulator.ckpt")]
        assert main([*words, "--channels", "IAS,Mach", "--out", str(folder / real)]) == 0
        found[real] = json.loads((folder / real / "gap.json").read_text())
        # By which way the flights came is said, and is another one.
        assert found[real].pop("provenance")["real"]["name"] == f"{real}.parquet"
    assert found["rows"] == found["alike"]
    assert found["rows"]["verdict"] == "none"
    assert "differ by no more than chance would" in capsys.readouterr().out


def test_evaluate_and_predict_descent_clean_rows_as_the_models_own(folder: Path) -> None:
    for real in ("rows", "alike"):
        words = ["evaluate", str(folder / "simulator.ckpt"), "--real", str(folder / f"{real}.parquet"), "-n", "100"]
        assert main([*words, "--no-figures", "--out", str(folder / f"scores_{real}")]) == 0
        words = ["predict-descent", str(folder / "simulator.ckpt"), str(folder / f"{real}.parquet"), "--from-fl", "290"]
        assert main([*words, "-n", "60", "--out", str(folder / f"ahead_{real}.parquet")]) == 0
    scores = [(folder / f"scores_{real}" / "scores.csv").read_text() for real in ("rows", "alike")]
    assert scores[0] == scores[1]
    ahead = [pl.read_parquet(folder / f"ahead_{real}.parquet") for real in ("rows", "alike")]
    assert ahead[0].equals(ahead[1])


@pytest.mark.parametrize("command", ["evaluate", "predict-descent", "diagnose"])
def test_every_command_warns_of_other_settings(command: str, folder: Path, tmp_path: Path) -> None:
    checkpoint, real, out = (str(folder / "simulator.ckpt"), str(folder / "default.parquet"), str(tmp_path / "out"))
    words = {
        "evaluate": ["evaluate", checkpoint, "--real", real, "-n", "50", "--no-figures", "--out", out],
        "predict-descent": ["predict-descent", checkpoint, real, "--from-fl", "290", "-n", "60", "--out", out],
        "diagnose": ["diagnose", "--real", real, "--simulator", checkpoint, "--channels", "IAS", "--out", out],
    }[command]
    with pytest.warns(DescentflowWarning, match="slowest_fpm is 500 in these descents and 1200 in the model's"):
        main(words)


def test_a_warning_is_one_line_on_the_terminal(folder: Path, tmp_path: Path) -> None:
    words = ["evaluate", str(folder / "simulator.ckpt"), "--real", str(folder / "default.parquet"), "-n", "50"]
    words += ["--no-figures", "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-m", "descentflow", *words], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    lines = [line for line in done.stderr.splitlines() if "slowest_fpm" in line]
    assert len(lines) == 1
    assert lines[0].startswith("descentflow evaluate: warning: descents of other cleaning settings: slowest_fpm is 500")
