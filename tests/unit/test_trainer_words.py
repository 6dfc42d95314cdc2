"""Mistakes in the words after `fit` are said in one line, before anything heavy is imported."""

import inspect
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from descentflow.cli.trainer_words import IN_PYTHON, MODELS, OTHER_NAMES, OWN, _arguments, check_words
from descentflow.configs.packaged_config import packaged_configs
from descentflow.core.errors import ConfigError

FILE = ["--data.descents", "descents.parquet"]


@pytest.mark.parametrize(
    ("words", "got", "near"),
    [
        (["--model", "Gausian", *FILE], "no model Gausian", "Gaussian"),
        (["--model=gaussian", *FILE], "no model gaussian", "Gaussian"),
        (["--model", "flow", *FILE], "no model flow", "--model MaskedAffineFlow, or --config flow"),
        (["--model", "gmm", *FILE], "no model gmm", "--model GaussianMixture, or --config gmm"),
        (["--model", "spline", *FILE], "no model spline", "df.fit(..., model=...) takes in Python"),
        (["--modle", "Gaussian", *FILE], "no option --modle", "--model"),
        (["--model", "Gaussian", "--data.descentz", "d"], "no option --data.descentz", "--data.descents"),
        (["--model", "MaskedAffineFlow", "--model.n_flowz=3", *FILE], "no option --model.n_flowz", "--model.n_flows"),
        (["--config", "gmm", "--model.learning_rat", "1", *FILE], "no option --model.learning_rat", "learning_rate"),
        (["--config", "gmm", "--model", "Gaussian", "--model.extend", "no"], "no option --model.extend", "fit --help"),
        (["--scores.sed", "1", "--config", "flow"], "no option --scores.sed", "--scores.seed"),
        (["--config", "flow", "--checkpoint", "best.ckpt"], "--checkpoint best.ckpt", "--ckpt_path FILE"),
        (["--config", "flow", "--data=d.parquet"], "--data d.parquet", "--data.descents FILE"),
        (["--config", "flow", "--trainer", "gpu"], "--trainer gpu", "--trainer.NAME VALUE"),
        (["--config", "flwo"], "no settings file flwo", "mean flow?"),
        ([], "fit without --model and --data.descents", "descentflow fit --model Gaussian"),
        (["--model", "Gaussian"], "fit without --data.descents", "descentflow fit --model Gaussian"),
        (FILE, "fit without --model", "descentflow fit --model Gaussian"),
    ],
)
def test_a_mistake_is_named_with_the_nearest_valid_word(words: list[str], got: str, near: str) -> None:
    with pytest.raises(ConfigError) as refused:
        check_words("fit", words)
    assert str(refused.value).startswith(f"{got};")
    assert near in str(refused.value).rpartition("to mend it, ")[2]
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model: {class_path: Gausian}", "no model Gausian"),
        ("data: {descents: d, split: 3}", "no option --data.split;"),
        ("modle: {class_path: Gaussian}", "no option --modle"),
        ("model: [unclosed", "line 1"),
        ("only words", "holds a str"),
        (f"data: {{seed: {'9' * 5000}}}", "a YAML file of settings"),
        ("data: {validation_fraction: null}", "--data.validation_fraction null; expected a value"),
        ("model: {class_path: Gaussian, init_args: {jitter: null}}", "--model.jitter null; expected a value"),
        ("model: {class_path: Gaussian, init_args: {jiter: 1.0}}", "no option --model.jiter;"),
        ("trainer: -1", "trainer is -1; expected settings by name"),
        ("trainer:", "trainer is None; expected settings by name"),
        ("data: [descents]", "data is .'descents'.; expected settings by name"),
        ("checkpoint: last.ckpt", "checkpoint is last.ckpt; expected settings by name"),
        ("\xff", "a YAML file of settings"),
    ],
)
def test_a_settings_file_is_read_like_the_command_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigError, match=message):
        check_words("fit", ["--config", str(tmp_path / "own.yaml"), *FILE])


@pytest.mark.parametrize(
    "words",
    [
        *(["--config", name] for name in packaged_configs() if name != "default"),
        ["--model", "Gaussian", *FILE, "--trainer.max_epochs=3", "--trainer.callbacks+=LearningRateMonitor"],
        ["--model", "package.of.mine.Flow", "--model.anything", "1", *FILE],
        ["--model.class_path", "Gaussian", *FILE, "--data.context+=hour", "--optimizer.lr", "1"],
        ["--config=flow", "--model", "Gaussian", "--model.ridge", "2", "--print_config"],
        ["--model.help", "Gaussian"],
        ["--config", "flow", "--data", "own.yaml", "--trainer", '{"max_epochs": 3}'],
        ["--help_all"],
        ["--config", "gaussian", "--data.aircraft", "null"],
    ],
)
def test_what_is_valid_passes(words: list[str]) -> None:
    check_words("fit", words)


def test_names_of_models_elsewhere_are_those_that_are_taken_there() -> None:
    from descentflow.training.training_settings import NAMES, SETTINGS_OF

    assert tuple(NAMES) == IN_PYTHON
    assert dict(OTHER_NAMES.values()) == SETTINGS_OF
    assert {OTHER_NAMES[name][1] for name in NAMES} == set(NAMES.values())


def test_other_commands_need_no_model() -> None:
    check_words("test", ["--ckpt_path", "best.ckpt"])


def test_names_are_those_of_the_classes() -> None:
    """Read from the sources, they are those of the constructors in Python."""
    from descentflow.training import models
    from descentflow.training.callbacks.score_callback import ScoreCallback
    from descentflow.training.datamodule import DescentDataModule

    own = {"data": DescentDataModule, "scores": ScoreCallback}
    for section, kind in own.items():
        assert _arguments(*OWN[section]) == _nullable(kind)
    for name in MODELS:
        kind = getattr(models, name)
        assert _arguments(kind.__module__, name) == _nullable(kind)


def _nullable(kind: type) -> dict[str, bool]:
    """Parameters, and whether they may be None, as Python itself sees them."""
    return {
        name: one.annotation is one.empty or type(None) in get_args(one.annotation)
        for name, one in inspect.signature(kind).parameters.items()
    }


def test_nothing_heavy_is_imported() -> None:
    asks = (
        "import sys; from descentflow.cli.entry import main; main(['fit', '--model', 'Gausian']);"
        "print(sorted({'torch', 'lightning', 'numpy'} & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", asks], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
    assert answer.stderr.startswith("descentflow fit: no model Gausian")
    assert answer.stderr.count("\n") == 1
