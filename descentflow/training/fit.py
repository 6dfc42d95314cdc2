"""Fit a density from Python."""

import logging
import os
import warnings
from pathlib import Path
from typing import Any

from lightning.pytorch import Trainer

from descentflow.core.files import whole_file
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import LatentModel


def fit(model: LatentModel[Any], data: DescentDataModule, checkpoint: Path, max_epochs: int) -> None:
    """Fit a model from Python, without logs or progress bars, and write its checkpoint, whole or not at all.

    Args:
        model: What to fit.
        data: Descents.
        checkpoint: File to write.
        max_epochs: Epochs at most.

    Example:
        >>> fit(Gaussian(), DescentDataModule(Path("a320.parquet")), Path("a320.ckpt"), max_epochs=1)
    """
    quiet()
    trainer = Trainer(
        max_epochs=max_epochs,
        accelerator="cpu",
        logger=False,
        enable_progress_bar=False,
        enable_checkpointing=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
    )
    trainer.fit(model, datamodule=data)
    with whole_file(checkpoint) as temporary:
        trainer.save_checkpoint(temporary)


def quiet() -> None:
    """Silence advice that does not apply here; everything else that Lightning says still comes through."""
    # Lightning's own calls of jsonargparse are what is deprecated, not anything a user wrote.
    os.environ.setdefault("JSONARGPARSE_DEPRECATION_WARNINGS", "off")
    for advice in (
        ".*does not have many workers.*",  # the weights are in memory
        ".*The number of training batches.*",  # a closed form has few
        ".*LightningCLI's args parameter.*",  # descentflow's own command line calls it
        ".*treespec, LeafSpec.*",
        ".*isinstance.treespec.*",
        ".*The dirpath has changed.*",  # test and predict write into a folder of their own
    ):
        warnings.filterwarnings("ignore", message=advice)
    for handler in logging.getLogger("lightning.pytorch").handlers:
        handler.addFilter(lambda record: not record.getMessage().startswith(("TPU available", "\U0001f4a1 Tip")))
