"""Wrong options, values and settings files of `fit` end in a line that names them."""

from pathlib import Path

import pytest

from descentflow.cli.lightning_cli import run
from descentflow.configs.packaged_config import packaged_configs
from descentflow.core.errors import ConfigError
from descentflow.training.training_settings import NAMES, SETTINGS_OF

FIT = ["--model", "Gaussian", "--data.descents", "descents.parquet"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([*FIT, "--data.context", "hour"], r"--data\.context: Expected a <class 'list'>; Given value: hour;"),
        (
            [*FIT, "--data.explained_variance=80"],
            r"--data\.explained_variance: .* 80 does not conform to .*v<1",
        ),
        ([*FIT, "--data.batch_size", "0"], r"--data\.batch_size: .*PositiveInt"),
        ([*FIT, "--data.bottom_fl", "1.5"], "--data.bottom_fl: Expected a <class 'int'>; Given value: 1.5"),
        ([*FIT, "--data.fpca", "pca"], r"--data\.fpca: Expected .*'ppca', 'iterative'.* Got value: pca"),
        ([*FIT, "--data.descentz", "d"], "nrecognized arguments: --data.descentz d;"),
        ([*FIT, "--model.jitter", "2"], "--jitter: .* 2 does not conform to restriction v>=0 and v<=1"),
        ([*FIT, "--model.jiter", "2"], "'jiter' is not accepted"),
        ([*FIT, "--modle", "Gaussian"], "nrecognized arguments: --modle Gaussian;"),
        ([*FIT, "--trainer.devices", "x"], "options that cannot be taken: .*devices"),
        ([*FIT, "--data", __file__], "--data: Unable to load config"),
        (["--config", "flwo", *FIT], "no settings file flwo; .* did you mean flow"),
        (["--model", "Gausian", *FIT[2:]], "no model Gausian; expected gaussian, mixture, .* did you mean Gaussian"),
        (FIT[:2], "--data.descents.* required|are required: --data.descents;"),
        ([], "required: --data.descents, --model;|--model' is required"),
    ],
)
def test_what_is_wrong_is_named_in_a_line(words: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as refused:
        run("fit", words)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model: {class_path: Gausian}", "Gausian"),
        ("data: {descents: d, split: 3}", "data.split"),
        ("modle: {class_path: Gaussian}", "modle"),
        ("model: [unclosed", "own.yaml"),
        ("data: {validation_fraction: null}", "validation_fraction"),
        ("model: {class_path: descentflow.training.models.Gaussian, init_args: {jiter: 1.0}}", "jiter"),
        ("data: [descents]", "data"),
        ("checkpoint: last.ckpt", "checkpoint"),
        ("\xff", "."),
    ],
)
def test_a_wrong_settings_file_is_refused_in_a_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigError, match=message) as refused:
        run("fit", [*FIT, "--config", str(tmp_path / "own.yaml")])
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "words",
    [
        *(["--config", name, *FIT[2:]] for name in packaged_configs() if name not in ("default", "paper")),
        *(["--model", name, *FIT[2:]] for name in (*NAMES, *SETTINGS_OF)),
        ["--model.class_path=Gaussian", *FIT[2:], "--data.context+=hour", "--model.ridge", "2"],
        ["--config=flow", *FIT, "--data.mass_kg", "6e4", "--data.context", "[hour]", "--data.aircraft", "null"],
    ],
)
def test_what_is_valid_passes(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run("fit", [*words, "--print_config"])
    assert ended.value.code == 0
    assert "class_path: descentflow.training.models." in capsys.readouterr().out
