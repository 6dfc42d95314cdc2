"""The final fit: after a fit has been scored on held-out flights, the same settings fitted to all flights."""

from tempfile import TemporaryDirectory
from typing import Any

import torch
from lightning.fabric.plugins.environments.lightning import LightningEnvironment
from lightning.pytorch import Callback, LightningModule, Trainer

from descentflow.core.progress import stage
from descentflow.training.callbacks.show_progress import ShowProgress
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models.latent_model import LatentModel


def fit_to_all(
    model: LatentModel[Any], again: LatentModel[Any], data: DescentDataModule, trainer: Trainer, steps: int
) -> None:
    """Fit the settings of a model to all flights, those that it held out among them, and keep it as its final density.

    What the fit chose is kept: the numbers of a mixture's components, and the steps of the best epoch. Bases, scaler
    and bounds are fitted again by the same rules. Nothing is done where no flight was held out.

    Args:
        model: Fitted, with the parameters of its best epoch.
        again: A copy of it from before the fit.
        data: What it was fitted to.
        trainer: That has fitted it.
        steps: Steps of its optimiser up to the best epoch.

    Raises:
        ConfigError: If training diverges.

    Example:
        >>> from descentflow.training.fit import fit
        >>> model = fit("descents.parquet", "gaussian")
        >>> len(model.representation.split.train), len(model.final.representation.split.train)
        (86, 120)
        >>> model.final.held_out_fit is model.density
        True
    """
    split = model.representation.split
    if not split.validation and not split.test:
        return
    with stage("fitting to all flights"), TemporaryDirectory() as own:
        torch.manual_seed(torch.initial_seed())
        again.choose_as(model)
        # One process is enough, on clusters too, and there is nothing to choose an epoch by.
        refitting = Trainer(
            accelerator="cpu" if trainer.strategy.root_device.type == "cpu" else "cuda",
            devices=1,
            plugins=LightningEnvironment(),
            default_root_dir=own,  # on Slurm, a Trainer would resume what it finds in the working directory
            precision=trainer.precision,
            gradient_clip_val=trainer.gradient_clip_val,
            max_epochs=trainer.max_epochs,
            limit_val_batches=0,
            callbacks=[_StopAt(steps), ShowProgress("fitting to all flights")],
            logger=False,
            enable_checkpointing=False,
            enable_progress_bar=False,
            enable_model_summary=False,
        )
        refitting.fit(again, datamodule=data.of_all_flights())
    again.check_finite()
    model.keep_final(again.cpu().eval().density)


class _StopAt(Callback):
    """Ends training with the epoch in which the optimiser has made some number of steps."""

    def __init__(self, steps: int) -> None:
        self.steps = steps

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        if trainer.global_step >= self.steps:
            trainer.should_stop = True
