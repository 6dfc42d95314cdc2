"""A run that failed leaves no folder without content."""

import shutil
from contextlib import suppress
from pathlib import Path

from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Callback


class RemoveFailedRun(Callback):
    """Takes away the folder of a run that failed or was interrupted before it had a checkpoint or scores.

    Example:
        >>> from lightning.pytorch.loggers import CSVLogger
        >>> trainer = Trainer(logger=CSVLogger("failing"), callbacks=[RemoveFailedRun()], accelerator="cpu")
        >>> trainer.logger.log_metrics({"a": 1.0})
        >>> RemoveFailedRun().on_exception(trainer, None, ValueError())
        >>> Path(trainer.log_dir).exists()
        False
    """

    def on_exception(self, trainer: Trainer, pl_module: LightningModule, exception: BaseException) -> None:
        """Remove what the run wrote if nothing in it is of use."""
        folder = Path(trainer.log_dir) if trainer.loggers and trainer.log_dir else None
        if folder is None or not folder.is_dir() or not trainer.is_global_zero or _is_of_use(folder):
            return
        for logger in trainer.loggers:
            logger.finalize("failed")
        shutil.rmtree(folder)
        with suppress(OSError):  # other runs are in them
            folder.parent.rmdir()
            folder.parent.parent.rmdir()


def _is_of_use(folder: Path) -> bool:
    scores = ("scores.csv", "log_prob.csv")
    return any(folder.rglob("*.ckpt")) or any((folder / name).is_file() for name in scores)
