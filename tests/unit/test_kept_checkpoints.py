"""Laws learnt with the density held: in every checkpoint of a fit that has ended, and in none before."""

import warnings
from pathlib import Path
from typing import Any

import pytest
import torch
import toys
from lightning.pytorch import Callback, LightningModule, Trainer, seed_everything
from lightning.pytorch.callbacks import ModelCheckpoint

from descentflow.core.errors import DescentflowWarning
from descentflow.densities.checkpoint import load_model
from descentflow.densities.density import Density
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import GaussianMixture
from descentflow.training.models.latent_model import LatentModel


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("kept") / "descents.parquet", 200)


class LooksIn(Callback):
    """Loads a checkpoint of a fit that goes on."""

    def __init__(self, path: Path) -> None:
        self.path, self.found = path, list[Density]()

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        if trainer.current_epoch == 2:
            with pytest.warns(DescentflowWarning, match="a fit that was going on"):
                self.found.append(load_model(self.path))


def fitted(
    model: LatentModel[Any], data: DescentDataModule, folder: Path, monitor: str
) -> tuple[Density, list[Density]]:
    """Observations inside the fit, and its two best epochs and the last one when it has ended."""
    looks = LooksIn(folder / "best.ckpt")
    best = ModelCheckpoint(folder, "best", monitor=monitor, save_top_k=2)
    seed_everything(1, verbose=False)
    trainer = Trainer(
        max_epochs=4,
        accelerator="cpu",
        logger=False,
        callbacks=[best, ModelCheckpoint(folder, "last"), looks],
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    trainer.fit(model, datamodule=data)
    files = sorted(folder.glob("*.ckpt"))
    assert len(files) == 3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return looks.found[0], [load_model(path) for path in files]


def test_each_epoch_of_a_mixture_has_its_gate(descents: Path, tmp_path: Path) -> None:
    model = GaussianMixture(n_clusters=2, tolerance=1e-12)
    before, kept = fitted(model, DescentDataModule(descents), tmp_path, "val/nll")
    assert isinstance(before, GaussianMixtureDensity)
    assert before.entry_gate is None
    shares = set()
    for mixture in kept:
        assert isinstance(mixture, GaussianMixtureDensity)
        assert mixture.entry_gate is not None
        shares.add(float(mixture.entry_gate.shares[0, 0]))
    assert len(shares) > 1, "each epoch its own"
    assert torch.equal(model.density.mixture.locs, kept[-1].mixture.locs), "the model stays at its last epoch"
