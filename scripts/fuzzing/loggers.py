"""Fits with every kind of logger in folders that hold files of others: a fit that fails removes none of them."""

import random
from pathlib import Path
from typing import Any

from lightning.pytorch import Callback

from descentflow.core.errors import DataError

OTHERS = (
    "notes.txt",
    "runs/notes.txt",
    "runs/metrics.csv",
    "runs/default/version_0/notes.txt",
    "runs/project/run/notes.txt",
    "runs/7/hparams.yaml",
    "store/notes.txt",
    "checkpoints/notes.txt",
)
"""Files that are there before."""
STORE = "store.txt"
"""Files that a shared logger itself keeps, for all runs."""
LOGGERS = ("TensorBoardLogger", "CSVLogger", "shared_logger.SharedLogger")
NAMES = {"name": ("", "default", "project", "a/b", ".."), "version": ("", "7", "version_0", "run", "..")}
HOOKS = ("setup", "on_fit_start", "on_train_start", "on_train_epoch_end", "on_validation_end", "on_save_checkpoint")


class FailAt(Callback):
    """Raise an error at a moment of the fit.

    Args:
        moment: Name of the hook.
    """

    def __init__(self, moment: str = "setup") -> None:
        super().__init__()

        def fail(*_: Any, **__: Any) -> None:
            raise DataError(f"the moment {moment}", expected="another one", mend="leave the callback out")

        setattr(self, moment, fail)


def words_of_fit(rng: random.Random, descents: Path) -> list[str]:
    """A command that fits, with one logger, two or none, and fails at some moment or not at all.

    Args:
        rng: What chooses.
        descents: Prepared descents; they are absent in some cases.
    """
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), "--trainer.max_epochs=1"]
    if rng.random() < 0.2:
        words[4] = "absent.parquet"
    elif rng.random() < 0.8:
        words += ["--trainer.callbacks+=fuzzing.loggers.FailAt", f"--trainer.callbacks.moment={rng.choice(HOOKS)}"]
    kind = rng.choice((*LOGGERS, "false", ""))
    if kind:
        words.append(f"--trainer.logger={kind}")
    if kind in LOGGERS and rng.random() < 0.8:
        words.append(f"--trainer.logger.save_dir={rng.choice(('.', 'runs', 'store', 'new', 'new/er'))}")
    if kind in LOGGERS[:2]:
        for option, values in NAMES.items():
            if rng.random() < 0.6:
                words.append(f"--trainer.logger.{option}={rng.choice(values)}")
    if rng.random() < 0.2:
        words.append(f"--trainer.default_root_dir={rng.choice(('.', 'runs', 'new'))}")
    return words
