"""A logger as MLflow's and Weights & Biases': it has no folder of its own, and a name and version for each run."""

from pathlib import Path
from typing import Any

from lightning.pytorch import Callback, LightningModule, Trainer
from lightning.pytorch.loggers.logger import Logger, rank_zero_experiment


class SharedLogger(Logger):
    """Keeps one file for all runs in ``save_dir``."""

    def __init__(self, save_dir: str = ".", run: str = "run") -> None:
        super().__init__()
        self._save_dir, self._run = save_dir, run

    @property
    def save_dir(self) -> str:
        return self._save_dir

    @property
    def name(self) -> str:
        return "project"

    @property
    def version(self) -> str:
        return self._run

    @property
    @rank_zero_experiment
    def experiment(self) -> Path:
        store = Path(self._save_dir) / "store.txt"
        store.parent.mkdir(parents=True, exist_ok=True)
        store.touch()
        return store

    def log_metrics(self, metrics: dict[str, float], step: int | None = None) -> None:
        """Nothing is kept."""

    def log_hyperparams(self, params: Any, *args: Any, **kwargs: Any) -> None:
        """Nothing is kept."""


class Fail(Callback):
    """An error, and nothing else."""

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Fail."""
        raise ValueError("as a user's callback may")
