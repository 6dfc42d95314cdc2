"""Write the log density of each flight that `descentflow predict` went through."""

from collections.abc import Sequence
from typing import Any

import polars as pl
import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import BasePredictionWriter
from lightning.pytorch.utilities import rank_zero_info

from descentflow.core.tabular import write_table
from descentflow.training.datamodule import data_of
from descentflow.training.run_folders import folder_of


class WriteLogProb(BasePredictionWriter):
    """``log_prob.csv`` in the run's folder: flight and log density (nats), the least usual flight first.

    Example:
        >>> from lightning.pytorch import Trainer
        >>> from descentflow.training.datamodule import DescentDataModule
        >>> from descentflow.training.fit import fit
        >>> data = DescentDataModule("descents.parquet")
        >>> options = {"logger": False, "enable_progress_bar": False, "default_root_dir": "usual"}
        >>> trainer = Trainer(callbacks=[WriteLogProb()], accelerator="cpu", **options)
        >>> predicted = trainer.predict(fit(data, "gaussian"), data)
        >>> pl.read_csv("usual/log_prob.csv").columns, len(pl.read_csv("usual/log_prob.csv"))
        (['flight_id', 'log_prob'], 24)
    """

    def __init__(self) -> None:
        super().__init__(write_interval="epoch")

    def write_on_epoch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        predictions: Sequence[Any],
        batch_indices: Sequence[Any],
    ) -> None:
        """Join the batches, name the flights and write the table."""
        if not trainer.is_global_zero:
            return
        flights = data_of(trainer).profiles("test").flight_ids
        log_prob = torch.cat(list(predictions)).double().cpu().numpy()
        path = folder_of(trainer) / "log_prob.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_table(pl.DataFrame({"flight_id": flights, "log_prob": log_prob}).sort("log_prob"), path)
        rank_zero_info(f"wrote {path}")
