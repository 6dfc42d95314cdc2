"""A density of the user's own, in one file: fitted, loaded, sampled, scored, and refused where it cannot be."""

from pathlib import Path

import pytest
import torch

import descentflow as df
from descentflow.cli import main
from descentflow.core.errors import CheckpointError, ConfigError
from descentflow.densities.density import Density
from descentflow.training.training_settings import model_of_file

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "densities.md"
OWN = PAGE.read_text().partition("## A density of your own")[2].split("```")[1].removeprefix("python\n")
"""The file that the page shows."""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file; what it registers is forgotten afterwards."""
    monkeypatch.setattr(Density, "kinds", dict(Density.kinds))
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "my_density.py"
    path.write_text(OWN)
    return path


def test_it_is_fitted_and_loaded_again_in_python(own: Path, descents: Path) -> None:
    model = df.fit(descents, model=str(own), out="mine.ckpt", max_epochs=20, final=False)
    assert type(model.density).__name__ == "ScaledDensity"
    # The weights are standardised, and it began far from that.
    assert float(model.density.loc.detach().abs().max()) < 0.8
    loaded = df.load("mine.ckpt")
    assert torch.equal(loaded.sample(9, seed=1), model.sample(9, seed=1))
    assert len(df.sample(loaded, n=20, seed=0)) == 20
    Density.kinds.pop("ScaledDensity")
    with pytest.raises(CheckpointError, match=r"density 'ScaledDensity'; .*--model FILE.py"):
        df.load("mine.ckpt")


def test_every_command_takes_its_file(own: Path, descents: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fit = ["fit", "--model", str(own), "--data.descents", str(descents), "--trainer.max_epochs", "2"]
    assert main([*fit, "--trainer.logger", "false"]) == 0, capsys.readouterr().err
    (checkpoint,) = own.parent.rglob("best.ckpt")
    Density.kinds.pop("ScaledDensity")
    assert main(["sample", str(checkpoint), "-n", "5", "--out", "samples.parquet"]) == 2
    assert "density 'ScaledDensity'" in capsys.readouterr().err
    assert main(["sample", str(checkpoint), f"--model={own}", "-n", "5", "--out", "samples.parquet"]) == 0
    assert f"descentflow: runs {own} for the density that it defines" in capsys.readouterr().err
    assert main(["info", str(checkpoint), "--model", str(own)]) == 0
    assert "ScaledDensity of" in capsys.readouterr().out
    scored = ["validate", "--ckpt_path", str(checkpoint), "--model", str(own), "--data.descents", str(descents)]
    assert main([*scored, "--trainer.logger", "false"]) == 0, capsys.readouterr().err
    export = ["export", str(checkpoint), "--model", str(own), "--to", "onnx", "--out", "x.onnx"]
    assert main(export) == 2
    assert "a ScaledDensity, whose draws cannot be written as a graph" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("x = 1", "no models"),
        (OWN.replace("ScaledDensity", "GaussianDensity"), "GaussianDensity, a name that is taken"),
        (OWN + "\n\nclass Other(Scaled):\n    pass\n", "2 models"),
        ("import torch\n\n1 / 0\n", r"my_density.py, line 3: ZeroDivisionError"),
    ],
)
def test_a_file_without_one_model_is_refused(content: str, words: str, own: Path) -> None:
    own.write_text(content)
    known = dict(Density.kinds)
    with pytest.raises(ConfigError, match=words):
        model_of_file(own)
    assert Density.kinds == known
    with pytest.raises(ConfigError, match="no such file"):
        df.fit("descents.parquet", model="absent.py")
