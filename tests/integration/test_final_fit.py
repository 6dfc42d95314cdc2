"""A final fit to all flights, which function takes which, and fits that were interrupted and resumed."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import polars as pl
import pytest
import torch
from command_line_toys import QUICK
from command_line_toys import fit as fit_by_command
from toys import assert_equal

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.densities.checkpoint import load_model
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.training.callbacks.kept_epochs import WholeCheckpoints
from descentflow.training.fit import fit
from descentflow.training.models import GaussianMixture

pytestmark = pytest.mark.usefixtures("plain_figures")


@pytest.fixture(scope="module")
def final(tmp_path_factory: pytest.TempPathFactory, descents: Path) -> Path:
    path = tmp_path_factory.mktemp("final") / "a320.ckpt"
    df.fit(descents, "gaussian", out=path)
    return path


def others(descents: Path) -> Descents:
    """The same flights on other days."""
    known = read_descents(descents)
    later = known.frame.with_columns(pl.col("timestamp").dt.offset_by("30d"), flight_id="later-" + pl.col("flight_id"))
    return Descents(later, known.metadata)


@pytest.mark.parametrize(("model", "config"), [("gaussian", "gaussian"), ("mixture", "gmm"), ("flow", "flow")])
def test_python_and_the_command_line_leave_the_same_two_fits(
    model: str, config: str, tmp_path: Path, descents: Path
) -> None:
    run = fit_by_command(tmp_path, descents, config, "--trainer.max_epochs", "3")
    written = load_model(run / "checkpoints" / "final.ckpt")
    fitted = df.fit(descents, model, max_epochs=3)
    assert_equal(written, fitted.final)
    assert_equal(written.held_out_fit, fitted.density)
    assert_equal(load_model(run / "checkpoints" / "best.ckpt"), fitted.density)
    split, every = fitted.representation.split, fitted.final.representation.split
    assert set(every.train) == {*split.train, *split.validation, *split.test}
    assert not every.validation
    assert torch.equal(fitted.final.representation.decoder.levels_fl, fitted.representation.decoder.levels_fl)


def test_a_final_fit_may_be_left_out(descents: Path, tmp_path: Path) -> None:
    assert df.fit(descents, "gaussian", final=False).final is None
    assert df.fit(descents, "gaussian", test_fraction=0, validation_fraction=0).final is None
    run = fit_by_command(tmp_path, descents, "gaussian", "--final", "false")
    assert not (run / "checkpoints" / "final.ckpt").exists()


def test_samples_are_of_the_final_fit_and_scores_of_the_other(final: Path, descents: Path) -> None:
    density = df.load(final)
    samples = df.sample(final, 50)
    assert samples.origin["fitted_to"] == "all 300 flights, none held out"
    assert "drawn from the fit to all 300 flights" in str(samples)
    evaluation = df.evaluate(final, descents, n=200, n_splits=2)
    assert evaluation.scores.frame().equals(
        df.evaluate(density.held_out_fit, descents, n=200, n_splits=2).scores.frame()
    )
    assert len(evaluation.real) + evaluation.n_seen == 300
    assert "scored: the fit to 216 of 300 flights" in str(evaluation)


def test_new_flights_are_predicted_by_the_final_fit_and_held_out_ones_by_the_other(final: Path, descents: Path) -> None:
    held_out = df.predict(final, descents, from_fl=290, n=50)
    assert "predicted by the fit to 216 of 300 flights" in str(held_out)
    test = df.load(final).held_out_fit.representation.split.test
    assert {flight.flight_id for flight in held_out.flights} <= set(test)
    new = df.predict(final, others(descents), from_fl=290, n=50, flights=["later-" + test[0], "later-" + test[1]])
    assert "predicted by the fit to all 300 flights" in str(new)


def test_the_trainer_scores_the_held_out_fit_of_a_final_checkpoint(
    descents: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = fit_by_command(tmp_path, descents, "gaussian")
    said = {}
    for name in ("best", "final"):
        capsys.readouterr()
        assert main(["validate", "--ckpt_path", str(run / "checkpoints" / f"{name}.ckpt")]) == 0
        said[name] = capsys.readouterr().out
    assert said["best"] == said["final"] != ""


def test_info_says_which_fit_it_is(final: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(final)]) == 0
    said = capsys.readouterr().out
    assert "fitted to all 300 flights, none held out" in said
    assert "scored: the fit to 216 of 300 flights (24 for validation and 60 for test held out)" in said
    assert "score: val/nll" in said


def test_a_run_folder_of_a_fit_from_python_is_one_for_the_commands(
    descents: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    model = df.fit(descents, GaussianMixture(n_clusters=2), out=run, seed=2, max_epochs=3, explained_variance=0.7)
    assert {path.name for path in run.rglob("*") if path.is_file()} >= {
        "config.yaml",
        "metrics.csv",
        "best.ckpt",
        "final.ckpt",
    }
    assert_equal(load_model(run / "checkpoints" / "final.ckpt"), model.final)
    assert_equal(load_model(run / "checkpoints" / "best.ckpt"), model.density)
    assert main(["validate", "--ckpt_path", str(run / "checkpoints" / "best.ckpt")]) == 0
    again = tmp_path / "again"
    words = ["--config", str(run / "config.yaml"), "--trainer.logger.init_args.save_dir", str(again)]
    assert main(["fit", *words]) == 0
    assert_equal(load_model(next(again.rglob("best.ckpt"))), model.density)
    with pytest.raises(ConfigError, match="of another run"):
        df.fit(descents, "gaussian", out=run)


PATHS = ("dirpath", "best_model_path", "kth_best_model_path", "last_model_path")


def differences(one: Any, other: Any, place: str = "") -> list[str]:
    """Places where two checkpoints differ, but for the paths in them."""
    if isinstance(one, torch.Tensor):
        same = isinstance(other, torch.Tensor) and torch.equal(one.nan_to_num(), other.nan_to_num())
        return [] if same else [place]
    if isinstance(one, dict):
        if list(one) != list(other) and not place.endswith("best_k_models"):
            return [f"{place}: {list(one)} {list(other)}"]
        pairs = zip(one, one.values(), other.values(), strict=True)
        return [w for key, a, b in pairs if key not in PATHS for w in differences(a, b, f"{place}.{key}")]
    if isinstance(one, list | tuple):
        pairs = zip(one, other, strict=True)
        return [where for number, (a, b) in enumerate(pairs) for where in differences(a, b, f"{place}.{number}")]
    return [] if one == other else [f"{place}: {one} {other}"]


def held(run: Path) -> dict[str, Any]:
    return {name: torch.load(run / "checkpoints" / f"{name}.ckpt", weights_only=True) for name in ("best", "last")}


def interrupted_at(epoch: int, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let writing a checkpoint of an epoch end the process, as a kill does."""
    save = WholeCheckpoints.save_checkpoint

    def broken(self: Any, checkpoint: dict[str, Any], path: Any, storage_options: Any = None) -> None:
        if checkpoint["epoch"] == epoch and Path(path).stem == name:
            raise SystemExit(9)
        save(self, checkpoint, path, storage_options)

    monkeypatch.setattr(WholeCheckpoints, "save_checkpoint", broken)


@pytest.mark.parametrize(
    ("model", "epochs", "broken_at"),
    [
        ("flow", 3, 1),
        pytest.param("gmm_svi", 3, 2, marks=pytest.mark.slow),
        pytest.param("gmm", 30, None, marks=pytest.mark.slow),
    ],
)
def test_a_resumed_fit_is_the_undisturbed_one(
    model: str, epochs: int, broken_at: int | None, descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without an epoch to break, a fit that stopped by itself is resumed, and must do nothing more."""
    monkeypatch.chdir(tmp_path)
    words = ["--config", model, "--data.descents", str(descents), f"--trainer.max_epochs={epochs}", *QUICK]
    runs = tmp_path / "runs" / model
    assert main(["fit", *words]) == 0
    if broken_at is not None:
        with monkeypatch.context() as broken:
            interrupted_at(broken_at, "last", broken)
            with pytest.raises(SystemExit):
                main(["fit", *words])
        (runs / "version_1" / "checkpoints" / ".best.descentflow-part0.ckpt").write_text("half, as a kill leaves it")
        assert held(runs / "version_1")["last"]["epoch"] == broken_at - 1
    left = runs / ("version_0" if broken_at is None else "version_1")
    resumed = ["--config", str(left / "config.yaml"), "--ckpt_path", str(left / "checkpoints" / "last.ckpt")]
    ended = pytest.warns(DescentflowWarning, match="had ended by itself") if broken_at is None else nullcontext()
    with ended:
        assert main(["fit", *resumed]) == 0
    last = sorted(runs.iterdir())[-1]
    assert last != left
    assert differences(held(runs / "version_0"), held(last)) == []
    assert not list(tmp_path.rglob("*descentflow-part*"))


def test_a_fit_on_slurm_is_alone_in_its_folder(descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checkpoints that another program of Lightning left there are not resumed, and no signal leaves more."""
    monkeypatch.chdir(tmp_path)
    tasks = {"NTASKS": "1", "NTASKS_PER_NODE": "1", "NNODES": "1", "PROCID": "0", "LOCALID": "0", "NODEID": "0"}
    for name, value in {**tasks, "JOB_ID": "77", "JOB_NAME": "fit", "JOB_NODELIST": "here"}.items():
        monkeypatch.setenv(f"SLURM_{name}", value)
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK]
    assert main([*words, "--trainer.callbacks+=toys.NoRequeueing"]) == 0
    assert not list(tmp_path.glob("*.ckpt"))
    torch.save({"state_dict": {}, "epoch": 3}, tmp_path / "hpc_ckpt_1.ckpt")
    assert len(fit(descents, "gaussian").final.representation.split.train) == 300


def test_what_makes_a_resumed_fit_another_one_is_said(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    alone = tmp_path / "last.ckpt"
    alone.write_bytes((run / "checkpoints" / "last.ckpt").read_bytes())
    words = ["fit", "--config", str(run / "config.yaml"), "--ckpt_path", str(alone), "--seed_everything=7"]
    with (
        pytest.warns(UserWarning, match="the best epoch of the resumed fit is lost"),
        pytest.warns(UserWarning, match="a fit of seed 0 is resumed with seed 7"),
    ):
        main(words)


def test_a_second_run_in_a_folder_is_refused_and_leaves_the_first_alone(
    run: Path, descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    before = sorted(path.name for path in run.rglob("*") if not path.name.startswith("events"))
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK]
    where = [f"--trainer.logger.save_dir={run.parents[1]}", f"--trainer.logger.name={run.parent.name}"]
    assert main([*words, *where, f"--trainer.logger.version={run.name}"]) == 2
    assert "config.yaml of another run" in capsys.readouterr().err
    assert sorted(path.name for path in run.rglob("*") if not path.name.startswith("events")) == before
