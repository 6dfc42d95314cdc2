"""Cleaning settings travel from `prepare` by the checkpoint to every command that holds flights against it."""

import subprocess
import sys
from pathlib import Path

import pytest

import descentflow as df
from descentflow.core.errors import DescentflowWarning
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs, Opened
from descentflow.generation.prediction.predict import Prediction
from descentflow.surveillance.cleaning.thresholds import Cleaning

STRICT = Cleaning(slowest_fpm=1200.0, transient_s=60.0)
OTHERS = "slowest_fpm is 500 in these descents and 1200 in the model's"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of A320 prepared strictly; others of its world as rows, prepared alike and by default."""
    folder = tmp_path_factory.mktemp("travels")
    df.fit(
        df.prepare(df.simulate("A320", 120, seed=0).rows, cleaning=STRICT),
        "gaussian",
        out=folder / "model.ckpt",
        final=False,
    )
    rows = folder / "rows.parquet"
    df.simulate("A320", 60, seed=1).rows.write_parquet(rows)
    df.prepare(rows, cleaning=STRICT, out=folder / "alike.parquet")
    df.prepare(rows, out=folder / "default.parquet")
    return folder


def both_sides(folder: Path, real: str) -> Opened:
    """Inputs of a diagnosis."""
    return Inputs(folder / f"{real}.parquet", folder / "model.ckpt").open()


def ahead(folder: Path, real: str) -> Prediction:
    return df.predict(folder / "model.ckpt", folder / f"{real}.parquet", 290, n=50)


def test_rows_are_cleaned_as_the_models_own(folder: Path) -> None:
    rows, alike = (both_sides(folder, real) for real in ("rows", "alike"))
    assert rows.frame.drop("flight_id").equals(alike.frame.drop("flight_id"))
    assert rows.real_input.settings == alike.real_input.settings
    scores = [
        df.evaluate(folder / "model.ckpt", folder / f"{real}.parquet", n=60, n_splits=1).scores.frame()
        for real in ("rows", "alike")
    ]
    assert scores[0].equals(scores[1])
    assert ahead(folder, "rows").to_polars().equals(ahead(folder, "alike").to_polars())


@pytest.mark.parametrize("held", [both_sides, ahead])
def test_other_settings_are_warned_of(held: object, folder: Path) -> None:
    with pytest.warns(DescentflowWarning, match=OTHERS):
        held(folder, "default")  # type: ignore[operator]


def test_a_warning_is_one_line_on_the_terminal(folder: Path, tmp_path: Path) -> None:
    words = ["evaluate", str(folder / "model.ckpt"), "--real", str(folder / "default.parquet"), "-n", "50"]
    words += ["--no-figures", "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-m", "descentflow", *words], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    (line,) = (line for line in done.stderr.splitlines() if "slowest_fpm" in line)
    assert line.startswith(f"descentflow evaluate: warning: descents of different cleaning settings: {OTHERS}")
