"""The trainer's commands, run as a user runs them, on small prepared descents."""

import os
import re
from pathlib import Path

import polars as pl
import pytest
import torch
import toys
import yaml
from command_line_toys import QUICK

from descentflow.cli.entry import main
from descentflow.densities.checkpoint import load_model
from descentflow.representation.read_checkpoint import read_checkpoint

pytestmark = pytest.mark.usefixtures("plain_figures")


def test_settings_of_files_and_words_stand_under_one_name(tmp_path: Path, capsys) -> None:
    (tmp_path / "mine.yaml").write_text(
        "model: {class_path: descentflow.training.models.MaskedAffineFlow, init_args: {caution: 0.5}}\n"
        "data: {test_fraction: 0.3, seed: 5, split_by: aircraft, batch_size: 64}\n"
    )
    words = ["--config", str(tmp_path / "mine.yaml"), "--data.descents=d", "--data.seed", "7", "--data.gaps=filled"]
    words += ["--model.shrinkage=100", "--model.init_args.n_draws", "4"]
    with pytest.raises(SystemExit):
        main(["fit", *words, "--data.fewest_batches=2", "--print_config"])
    found = yaml.safe_load(capsys.readouterr().out)
    steps = {"weight_decay": 1e-5, "shrinkage": 100.0, "caution": 0.5, "n_draws": 4, "max_steps": 3000}
    assert found["model"]["init_args"].items() >= steps.items()
    split = {"test_fraction": 0.3, "validation_fraction": 0.1, "split_by": "aircraft", "seed": 7}
    batches = {"batch_size": 64, "fewest_batches": 2}
    assert found["data"].items() >= (split | batches | {"gaps": "filled"}).items()


def test_a_fit_ends_with_its_checkpoint_and_info_tells_what_it_holds(
    tmp_path: Path, descents: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK]) == 0
    said = capsys.readouterr().out
    path = "runs/Gaussian/version_0/checkpoints/best.ckpt"
    final = path.replace("best", "final")
    score = re.search(
        rf"wrote {path} \((val/nll \S+)\)\nwrote {final}, .*\n  descentflow test --ckpt_path {path} ", said
    )
    assert score is not None, said
    assert f"descentflow sample {final} " in said
    assert main(["info", path]) == 0
    told = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines()[1:])
    parts = load_model(path).representation
    assert told["flights"] == f"fitted to {parts.split.describe()}"
    assert told["aircraft"].startswith(parts.decoder.aircraft.typecode)
    assert told["score"].startswith(f"{score[1]} in epoch 1;")
    assert (told["context"], told["effects added"], told["cleaning"]) == ("none", "none", "the default thresholds")


def test_tensorboard_holds_scores_acceptance_and_figures(run: Path) -> None:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(run), size_guidance={"images": 0})
    events.Reload()
    scalars = events.Tags()["scalars"]
    assert "hp_metric" not in scalars, "a score that nobody measured"
    for name in ("val/nll", "val/acceptance", "val/rejected/drag_below_bound", "val/score/cas_below_transition/ks"):
        assert name in scalars
    assert {"val/profiles", "val/rejections"} <= set(events.Tags()["images"])


@pytest.mark.usefixtures("real_figures")
def test_test_scores_the_held_out_flights(run: Path, tmp_path: Path) -> None:
    checkpoint = run / "checkpoints" / "best.ckpt"
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path)]
    assert main(["test", "--ckpt_path", str(checkpoint), *where, "--scores.n_test_samples=500"]) == 0
    folder = next((tmp_path / "gaussian").iterdir())
    rows = pl.read_csv(folder / "scores.csv")
    assert len(rows) == 4 * 5 + 2 + 2  # by part, of whole profiles, of whole descents
    assert set(rows["quantity"]) >= {"time_to_bottom_of_descent", "rocd_below_transition"}
    assert (folder / "profiles.png").stat().st_size > 10_000


def test_predict_names_every_held_out_flight(run: Path, tmp_path: Path) -> None:
    checkpoint = run / "checkpoints" / "best.ckpt"
    assert main(["predict", "--ckpt_path", str(checkpoint), f"--trainer.logger.init_args.save_dir={tmp_path}"]) == 0
    table = pl.read_csv(next(tmp_path.rglob("log_prob.csv")))
    split = read_checkpoint(checkpoint)["descentflow"]["representation"]["split"]
    assert set(table["flight_id"]) == set(split["test"])
    assert table["log_prob"].is_sorted()


@pytest.mark.parametrize("command", ["test", "predict", "validate"])
def test_no_command_scores_random_weights(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command]) == 2
    assert "without a checkpoint" in capsys.readouterr().err


class Payload:
    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (f"touch {self.target}",)


def test_resuming_executes_nothing_of_what_a_checkpoint_holds(
    run: Path, descents: Path, tmp_path: Path, capsys
) -> None:
    evil = tmp_path / "evil.ckpt"
    content = torch.load(run / "checkpoints" / "best.ckpt", weights_only=True)
    torch.save({**content, "extra": Payload(tmp_path / "owned")}, evil)
    words = ["fit", "--config", str(run / "config.yaml"), "--ckpt_path", str(evil)]
    assert main(words) == 2
    assert "could execute code" in capsys.readouterr().err
    assert main([*words, "--weights_only=false"]) == 2
    assert "could execute code" in capsys.readouterr().err
    assert main([*words[:-1], str(run / "checkpoints" / "last.ckpt"), "--weights_only=false"]) == 2
    assert "never executes code" in capsys.readouterr().err
    assert not (tmp_path / "owned").exists()


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["--model", "MaskedAffineFlow"], "a checkpoint of a Gaussian, where the options ask for a MaskedAffineFlow"),
        (["--config", "gmm"], "a checkpoint of a Gaussian, where the options ask for a GaussianMixture"),
        (["--config", "gaussian", "--model.jitter", "0.5"], r"jitter 1e-06 \(the options: 0.5\)"),
    ],
)
def test_resuming_as_another_model_is_refused(
    asked: list[str], words: str, run: Path, descents: Path, tmp_path: Path, capsys
) -> None:
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path), "--data.descents", str(descents)]
    resumed = ["--ckpt_path", str(run / "checkpoints" / "last.ckpt"), "--trainer.max_epochs=2"]
    assert main(["fit", *asked, *where, *resumed]) == 2
    told = capsys.readouterr().err
    assert re.search(words, told)
    assert "config.yaml, or leave --ckpt_path out" in told


@pytest.mark.parametrize(
    ("changed", "words"),
    [("--data.cas_explained_variance=0.999", "data.cas_explained_variance"), ("other", "trained on other flights")],
)
def test_resuming_with_other_components_or_flights_is_refused(
    changed: str, words: str, run: Path, tmp_path: Path, capsys
) -> None:
    if changed == "other":
        changed = f"--data.descents={toys.write_descents_file(tmp_path / 'other.parquet', 300, seed=4)}"
    resumed = ["--config", str(run / "config.yaml"), "--ckpt_path", str(run / "checkpoints" / "last.ckpt"), changed]
    where = ["--trainer.logger.init_args.save_dir", str(tmp_path), "--trainer.max_epochs=2"]
    assert main(["fit", *resumed, *where]) == 2
    assert words in capsys.readouterr().err
