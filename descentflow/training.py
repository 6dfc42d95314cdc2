"""The trainer's commands: LightningCLI with this project's defaults and without its traps."""

import logging
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from lightning.pytorch import Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.cli import LightningArgumentParser, LightningCLI

from descentflow.callbacks.predictions import WriteLogProb
from descentflow.callbacks.scores import ScoreCallback
from descentflow.data.datamodule import DescentDataModule
from descentflow.densities.checkpoint import SECTION, read_checkpoint
from descentflow.errors import CheckpointError, ConfigError
from descentflow.files import whole_file
from descentflow.models import Gaussian, GaussianMixture, LatentModel, MaskedAffineFlow, SplineFlow
from descentflow.threads import one_thread_unless_told

MODELS = (Gaussian, GaussianMixture, MaskedAffineFlow, SplineFlow)
"""Imported so that `--model NAME` finds them by their short names."""

UNNAMED = "default"
"""Stands for the model's name in the folder of a run."""


class DescentCLI(LightningCLI):
    """LightningCLI whose checkpoints, scores and logger are set up unless a config says otherwise."""

    def add_arguments_to_parser(self, parser: LightningArgumentParser) -> None:
        """Add the callbacks that every run has, each with its own section in the config."""
        parser.add_lightning_class_args(ModelCheckpoint, "checkpoint")
        parser.add_lightning_class_args(ScoreCallback, "scores")
        parser.set_defaults(
            {
                "checkpoint.monitor": "val/nll",
                "checkpoint.filename": "best",
                "checkpoint.auto_insert_metric_name": False,
                "trainer.max_epochs": 200,
                "trainer.num_sanity_val_steps": 0,
                "trainer.log_every_n_steps": 1,
                "trainer.logger": {
                    "class_path": "lightning.pytorch.loggers.TensorBoardLogger",
                    "init_args": {"save_dir": "runs", "name": UNNAMED},
                },
            }
        )

    def before_instantiate_classes(self) -> None:
        """Name the run's folder after its model unless a config names it."""
        config = self.config[self.subcommand]
        logger = config.trainer.logger
        if getattr(logger, "init_args", None) is not None and logger.init_args.get("name") == UNNAMED:
            logger.init_args.name = config.model.class_path.rsplit(".", 1)[-1]


def run(command: str, rest: Sequence[str]) -> None:
    """Run ``fit``, ``validate``, ``test`` or ``predict``.

    Args:
        command: Which.
        rest: The words after it.

    Raises:
        ConfigError: If ``validate``, ``test`` or ``predict`` is given no checkpoint: it would score a model of
            random parameters.
        CheckpointError: If the checkpoint cannot be used.
    """
    words = ["--help" if word == "--help_all" else word for word in rest]
    if "--help" not in words:
        words = _with_accelerator(words)
        if command != "fit":
            words = _with_run_settings(command, words)
    _quiet()
    one_thread_unless_told()
    # The best checkpoint's own `save_last` writes only in epochs that are the best so far; a killed run resumes here.
    every_epoch = ModelCheckpoint(filename="last", save_top_k=1, enable_version_counter=False)
    DescentCLI(
        LatentModel,
        DescentDataModule,
        subclass_mode_model=True,
        seed_everything_default=0,
        trainer_defaults={"callbacks": [WriteLogProb(), every_epoch]},
        save_config_kwargs={"overwrite": False},
        parser_kwargs={"prog": "descentflow"},
        args=[command, *words],
    )


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
    _quiet()
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


def _with_accelerator(words: list[str]) -> list[str]:
    """Choose CUDA where there is one; never Apple's MPS, which has no float64."""
    if _option(words, "--trainer.accelerator") is not None:
        return words
    return ["--trainer.accelerator", "cuda" if torch.cuda.is_available() else "cpu", *words]


def _with_run_settings(command: str, words: list[str]) -> list[str]:
    """Put the run's own config first, and let its representation encode whatever flights are scored."""
    checkpoint = _option(words, "--ckpt_path")
    if checkpoint is None:
        raise ConfigError(
            f"{command} without a checkpoint",
            expected="--ckpt_path FILE (otherwise random parameters would be scored)",
            mend="pass the run's checkpoints/best.ckpt",
        )
    content = read_checkpoint(checkpoint)
    if _option(words, "--config") is None:
        words = ["--config", str(_run_config(Path(checkpoint))), *words]
    if "model" not in content[SECTION]:
        raise CheckpointError(f"{checkpoint}: no model named", expected="a whole checkpoint", mend="fit again")
    return [*words, "--data.checkpoint", checkpoint]


def _run_config(checkpoint: Path) -> Path:
    for folder in (checkpoint.parent, checkpoint.parent.parent):
        if (folder / "config.yaml").is_file():
            return folder / "config.yaml"
    raise ConfigError(
        f"no config.yaml beside {checkpoint} or one folder up",
        expected="the settings of the run that wrote it",
        mend="pass them with --config FILE",
    )


def _option(words: Sequence[str], name: str) -> str | None:
    """Value of an option given as ``--name value`` or ``--name=value``."""
    for position, word in enumerate(words):
        if word == name and position + 1 < len(words):
            return words[position + 1]
        if word.startswith(f"{name}="):
            return word.split("=", 1)[1]
    return None


def _quiet() -> None:
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
