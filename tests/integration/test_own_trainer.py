"""Models in a Trainer of the user's own: scores that callbacks can ask for, and true words where a fit goes wrong."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import pytest
import torch
from lightning.pytorch import LightningDataModule, Trainer
from lightning.pytorch.callbacks import EarlyStopping, ModelCheckpoint
from lightning.pytorch.loggers import CSVLogger

import descentflow as df
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.training.callbacks.score_callback import ScoreCallback
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian, GaussianMixture, LatentModel, MaskedAffineFlow

pytestmark = pytest.mark.usefixtures("plain_figures")
ENERGY = "val/score/cas_profile/energy"


@pytest.fixture(scope="module")
def data(descents: Path) -> DescentDataModule:
    data = DescentDataModule(descents)
    data.setup()
    return data


def trainer(folder: Path, **options: Any) -> Trainer:
    usual = {
        "logger": False,
        "enable_checkpointing": False,
        "enable_progress_bar": False,
        "log_every_n_steps": 1,
        "enable_model_summary": False,
    }
    return Trainer(**(usual | {"default_root_dir": folder, "accelerator": "cpu", "max_epochs": 2} | options))


@pytest.mark.filterwarnings("ignore:.*exists and is not empty.*")
def test_scores_are_there_for_other_callbacks_and_loggers(tmp_path: Path, data: DescentDataModule) -> None:
    best = ModelCheckpoint(tmp_path, monitor=ENERGY, save_top_k=-1)
    scores = ScoreCallback(every_n_epochs=1, n_samples=200, n_test_samples=200)
    callbacks = [best, EarlyStopping(ENERGY), scores]
    logger = CSVLogger(tmp_path)
    run = trainer(tmp_path, callbacks=callbacks, logger=logger, enable_checkpointing=True)
    model = MaskedAffineFlow(n_flows=1)
    run.fit(model, data)
    found = pl.read_csv(Path(logger.log_dir) / "metrics.csv")[ENERGY].drop_nulls().to_list()
    assert len(found) == 2
    assert sorted(map(float, best.best_k_models.values())) == sorted(found)
    assert float(run.callback_metrics[ENERGY]) == found[-1]
    assert {"val/acceptance", "val/rejected/drag_below_bound", f"{ENERGY}_floor"} <= set(run.callback_metrics)
    (tested,) = run.test(model, data, verbose=False)
    table = pl.read_csv(next(tmp_path.rglob("scores.csv")))
    (score,) = table.filter((pl.col("quantity") == "cas_profile") & (pl.col("statistic") == "energy"))["score"]
    assert tested["test/score/cas_profile/energy"] == pytest.approx(score, rel=1e-6)


def test_epochs_that_are_not_due_and_the_sanity_check_are_not_scored(tmp_path: Path, data: DescentDataModule) -> None:
    class Scored(ScoreCallback):
        def _log(self, trainer: Trainer, *words: Any) -> None:
            epochs.append(trainer.current_epoch)
            super()._log(trainer, *words)

    epochs: list[int] = []
    run = trainer(tmp_path, callbacks=[Scored(every_n_epochs=2, n_samples=50)], max_epochs=5)
    run.fit(MaskedAffineFlow(n_flows=1), data)
    assert epochs == [1, 3, 4]


@pytest.mark.parametrize(
    ("made", "equal"), [(lambda: GaussianMixture(n_clusters=2), 1e-6), (lambda: MaskedAffineFlow(n_flows=1), 0.1)]
)
def test_two_processes_both_have_the_scores(
    made: Callable[[], LatentModel[Any]], equal: float, tmp_path: Path, data: DescentDataModule
) -> None:
    """The first one computes them, and each keeps checkpoints by them; a flow takes other batches."""
    found = []
    for devices, strategy in ((1, "auto"), (2, "ddp_fork")):
        torch.manual_seed(0)
        best = ModelCheckpoint(tmp_path / strategy, monitor=ENERGY)
        callbacks = [best, ScoreCallback(every_n_epochs=1, n_samples=200)]
        options = {"devices": devices, "strategy": strategy, "callbacks": callbacks, "enable_checkpointing": True}
        run = trainer(tmp_path, **options)
        run.fit(made(), data)
        found.append({name: float(run.callback_metrics[name]) for name in ("val/nll", ENERGY, "val/acceptance")})
    assert found[1] == pytest.approx(found[0], rel=equal)


@pytest.mark.parametrize("made", [Gaussian, MaskedAffineFlow, GaussianMixture])
@pytest.mark.filterwarnings("ignore:You defined a `validation_step`")
def test_a_fit_without_our_data_module_says_what_it_needs(
    made: type[LatentModel[Any]], tmp_path: Path, data: DescentDataModule
) -> None:
    expected = r"expected a DescentDataModule.*trainer.fit\(model, datamodule=DescentDataModule"
    with pytest.raises(ConfigError, match=f"a trainer without a DataModule; {expected}"):
        trainer(tmp_path).fit(made(), data.train_dataloader())

    class Other(LightningDataModule):
        def train_dataloader(self) -> Any:
            return data.train_dataloader()

    with pytest.raises(ConfigError, match=f"a trainer with a Other; {expected}"):
        trainer(tmp_path).fit(made(), Other())


def test_a_model_is_not_used_with_components_of_other_flights(tmp_path: Path, data: DescentDataModule) -> None:
    model, other = df.fit(data, "gaussian"), DescentDataModule(data.descents, seed=1)
    for use in (trainer(tmp_path).fit, trainer(tmp_path).test):
        with pytest.raises(ConfigError, match="trained on other flights"):
            use(model, other)
    # Batches alone are enough to score what is fitted.
    (found,) = trainer(tmp_path).validate(model, data.val_dataloader(), verbose=False)
    assert found["val/nll"] == pytest.approx(float(model.outcome.split()[1]), rel=1e-3)


def test_a_flow_that_diverges_ends_with_its_best_epoch(tmp_path: Path, data: DescentDataModule) -> None:
    """The first epoch is the Gaussian, which no learning rate spoils."""
    best = ModelCheckpoint(tmp_path / "kept", monitor="val/bound", save_last=True)
    run = trainer(tmp_path, callbacks=[best], max_epochs=9, enable_checkpointing=True)
    torch.manual_seed(0)
    model = MaskedAffineFlow(learning_rate=1e3)
    said = r"training diverged; .*lower the learning rate \(--model.learning_rate\), 1000.0 here; .* val/bound"
    with pytest.warns(DescentflowWarning, match=said):
        run.fit(model, data)
    assert run.current_epoch < 9
    kept = df.load(tmp_path / "kept" / "last.ckpt")
    for density in (model.density, kept):
        assert torch.equal(density.state_dict()["scale"], df.load(best.best_model_path).state_dict()["scale"])
        assert all(value.isfinite().all() for value in density.state_dict().values())


@pytest.mark.parametrize("batch_size", [50, 512])
def test_a_mixture_that_diverges_says_so(batch_size: int, descents: Path) -> None:
    """By matrices of finite numbers that are not positive definite, in training or in validation."""
    model = GaussianMixture(training="svi", n_clusters=2, learning_rate=1e3)
    with pytest.raises(ConfigError, match=r"epoch 1: training diverged; .*learning_rate\), 1000.0 here"):
        df.fit(DescentDataModule(descents, batch_size=batch_size), model, max_epochs=2)


@pytest.mark.parametrize(
    "model",
    [MaskedAffineFlow(n_flows=1, max_steps=None), GaussianMixture(training="svi", n_clusters=2)],
)
def test_a_fit_that_nothing_ends_is_refused(model: LatentModel[Any], tmp_path: Path, data: DescentDataModule) -> None:
    with pytest.raises(ConfigError, match=r"without a last epoch \(max_epochs -1\).*a number of epochs"):
        trainer(tmp_path, max_epochs=-1).fit(model, data)


@pytest.mark.parametrize("made", [Gaussian, GaussianMixture])
def test_a_closed_form_ends_by_itself(made: type[LatentModel[Any]], tmp_path: Path, data: DescentDataModule) -> None:
    run = trainer(tmp_path, max_epochs=-1)
    run.fit(made(), data)
    assert run.current_epoch > 0
