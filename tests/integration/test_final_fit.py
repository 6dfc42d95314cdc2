"""After a fit with held-out flights the same settings are fitted to all; each function takes the fit that it should."""

from pathlib import Path

import polars as pl
import pytest
import torch
from command_line_toys import fit as fit_by_command
from toys import assert_equal

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError
from descentflow.densities.checkpoint import load_model
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
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
