"""The trainer's commands: LightningCLI with this project's defaults and without its traps."""

import json
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from jsonargparse import ArgumentError
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch import Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.cli import LightningArgumentParser, LightningCLI

from descentflow.cli.parser_errors import config_error
from descentflow.cli.trainer_words import MODELS, models_named
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import CheckpointError, ConfigError
from descentflow.core.settings_file import read_settings
from descentflow.core.threads import one_thread_unless_told
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint
from descentflow.training import models
from descentflow.training.callbacks.failed_run import RemoveFailedRun, WholeConfig
from descentflow.training.callbacks.kept_epochs import KeptEpochs, WholeCheckpoints
from descentflow.training.callbacks.log_prob_writer import WriteLogProb
from descentflow.training.callbacks.score_callback import ScoreCallback
from descentflow.training.callbacks.show_progress import ShowProgress
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.final_fit import fit_to_all
from descentflow.training.models import LatentModel
from descentflow.training.models.latent_model import check_precision
from descentflow.training.quiet import quiet
from descentflow.training.run_folders import (
    UNNAMED,
    USUAL_FOLDER,
    log_settings,
    name_run,
    run_folder,
    write_into_run,
)
from descentflow.training.training_settings import CHECKPOINT_DEFAULTS, TRAINER_DEFAULTS

NOTHING_KEPT = (
    "no checkpoint was written: no epoch was trained and validated to its end (--trainer.max_epochs, fast_dev_run and "
    "limit_train_batches say how much is trained)"
)


class DescentCLI(LightningCLI):
    """LightningCLI whose checkpoints, scores and logger are set up unless a config sets others.

    Args:
        command: The one that is run; the parsers of the others, a fifth of a second, are not built.
        options: LightningCLI's own.
    """

    def __init__(self, command: str, **options: Any) -> None:
        self.command = command
        super().__init__(LatentModel, DescentDataModule, **options)

    def subcommands(self) -> dict[str, set[str]]:  # type: ignore[override]  # Lightning's is static
        """The command that is run, with the arguments of the trainer's method that are no options."""
        return {self.command: LightningCLI.subcommands()[self.command]}

    def add_arguments_to_parser(self, parser: LightningArgumentParser) -> None:
        """Add the callbacks that every run has, each with its own section in the config."""
        parser.add_lightning_class_args(KeptEpochs, "checkpoint")
        parser.add_lightning_class_args(ScoreCallback, "scores")
        # The other commands know it too, for they take the settings of a run.
        parser.add_argument("--final", type=bool, default=True, help="Of fit: fit again to all flights, final.ckpt.")
        parser.set_defaults(
            {
                **{f"checkpoint.{name}": value for name, value in CHECKPOINT_DEFAULTS.items()},
                **{f"trainer.{name}": value for name, value in TRAINER_DEFAULTS.items()},
                # Lightning's own bar goes to stdout, and knows no logs of batch jobs.
                "trainer.enable_progress_bar": False,
                "trainer.logger": {
                    "class_path": "lightning.pytorch.loggers.TensorBoardLogger",
                    "init_args": {"save_dir": USUAL_FOLDER, "name": UNNAMED},
                },
            }
        )

    def parse_arguments(self, parser: LightningArgumentParser, args: Any) -> None:
        """Remember which options were given: what is chosen by default steps back behind them."""
        self.words = list(args)
        super().parse_arguments(parser, args)

    def _parse_ckpt_path(self) -> None:
        """Take no class from a checkpoint: Lightning would import whatever module it names."""

    def before_instantiate_classes(self) -> None:
        """Choose the folder that is written to, unless an option of the logger does."""
        config = self.config[self.subcommand]
        if self.subcommand == "fit":
            name_run(config)
            return
        run = _run_of(Path(config.ckpt_path))
        if not any(word.startswith("--trainer.logger") for word in self.words):
            write_into_run(config, str(self.subcommand), run)
        elif (options := getattr(config.trainer.logger, "init_args", {})).get("name") == UNNAMED:
            options["name"] = run.parent.name

    def instantiate_trainer(self, **kwargs: Any) -> Trainer:
        """A trainer whose checkpoints are written whole."""
        try:
            trainer = super().instantiate_trainer(**kwargs)
        except (TypeError, ValueError) as error:
            raise ConfigError(
                f"options of the trainer that it does not take: {str(error).splitlines()[0]}",
                expected="values as `descentflow fit --help_all` lists them",
                mend="correct the one that is named, or leave it out",
            ) from error
        check_precision(trainer)
        trainer.strategy.checkpoint_io = WholeCheckpoints()
        for callback in trainer.callbacks:  # type: ignore[attr-defined]
            if isinstance(callback, RemoveFailedRun):
                callback.note(trainer)
        return trainer

    def before_fit(self) -> None:
        """Keep the model as it is, for the final fit."""
        self.again = deepcopy(self.model)

    def after_fit(self) -> None:
        """Fit again to all flights; say where both fits were written, how good, and what to do with them."""
        for kept in self.trainer.checkpoint_callbacks:
            if self.trainer.is_global_zero and isinstance(kept, ModelCheckpoint) and kept.monitor:
                if kept.best_model_path:
                    log_settings(self.trainer, self.config["fit"], float(kept.best_model_score or "nan"), kept.monitor)
                    final = Path(kept.best_model_path).with_name("final.ckpt")
                    if self.config["fit"].final:
                        self._write_final(Path(kept.best_model_path), final)
                    print(_next_steps(kept, final))
                else:
                    print(NOTHING_KEPT)

    def _write_final(self, best: Path, final: Path) -> None:
        content = read_checkpoint(best)
        self.model.restore(content)
        fit_to_all(self.model, self.again, self.datamodule, self.trainer, content["global_step"])
        if self.model.final is not None:
            self.model.save(final)

    def after_test(self) -> None:
        """Print the likelihood; the scores are in a table."""
        if self.trainer.is_global_zero:
            print(f"test/nll {float(self.trainer.callback_metrics['test/nll']):.6g}")


def _run_of(checkpoint: Path) -> Path:
    """The run's folder; the checkpoint's own where that was taken out of its run."""
    try:
        return run_folder(checkpoint)
    except ConfigError:
        return checkpoint.parent


def _next_steps(best: ModelCheckpoint, final: Path) -> str:
    here = Path.cwd()
    path, all_flights = (
        one.relative_to(here) if one.is_relative_to(here) else one for one in (Path(best.best_model_path), final)
    )
    score = "" if best.best_model_score is None else f" ({best.monitor} {float(best.best_model_score):.4g})"
    lines = [f"wrote {path}{score}"]
    if final.is_file():
        lines.append(f"wrote {all_flights}, the same fitted to all flights")
    return "\n".join(
        [
            *lines,
            f"  descentflow test --ckpt_path {path}   # scores against its held-out flights, figures",
            f"  descentflow sample {all_flights if final.is_file() else path} -n 1000 --out samples.parquet",
        ]
    )


def run(command: str, rest: Sequence[str]) -> None:
    """Run ``fit``, ``validate``, ``test`` or ``predict``.

    Args:
        command: Which.
        rest: The words after it.

    Raises:
        ConfigError: If ``validate``, ``test`` or ``predict`` is given no checkpoint: it would score a model of
            random parameters; or if checkpoints are to be loaded unsafely.
        CheckpointError: If the checkpoint cannot be used.
    """
    words = _with_packaged_configs(["--help" if word == "--help_all" else word for word in rest])
    if "--help" not in words:
        words = _with_safe_loading(words)
        if command != "fit":
            words = _with_checkpoint(command, words)
        elif (resumed := _option(words, "--ckpt_path")) is not None and Path(resumed).suffix:
            read_checkpoint(resumed)
    quiet()
    one_thread_unless_told()
    # The parser finds by its short name what has been imported; a mixture's library is no matter of a flow.
    for name in models_named(words):
        getattr(models, name)
    # The best checkpoint's own `save_last` writes only in epochs that are the best so far; a killed run resumes here.
    every_epoch = KeptEpochs(filename="last", save_top_k=1, enable_version_counter=False)
    try:
        DescentCLI(
            command,
            subclass_mode_model=True,
            seed_everything_default=0,
            trainer_defaults={"callbacks": [WriteLogProb(), every_epoch, RemoveFailedRun(), ShowProgress()]},
            save_config_callback=WholeConfig if command == "fit" else None,
            save_config_kwargs={"overwrite": False},
            parser_kwargs={
                "prog": "descentflow",
                "exit_on_error": False,
                command: {"exit_on_error": False},
            },
            args=[command, *words],
        )
    except ArgumentError as error:
        # The parser's own way is two pages of usage before the line that says what is wrong.
        raise config_error(str(error)) from None
    except MisconfigurationException as error:
        raise ConfigError(
            str(error).splitlines()[0],
            expected="options of the trainer that go together",
            mend="change or leave out one",
        ) from None


def _with_packaged_configs(words: list[str]) -> list[str]:
    """Replace the names of settings files that come with the package by their paths; others are LightningCLI's."""

    def found(name: str) -> str:
        try:
            return str(config_file(name))
        except ConfigError:
            return name

    return [
        found(word) if before == "--config" else f"--config={found(word[9:])}" if word.startswith("--config=") else word
        for before, word in zip(["", *words], words, strict=False)
    ]


def _with_safe_loading(words: list[str]) -> list[str]:
    """Have Lightning load checkpoints as this package does; left to itself it runs whatever their pickles say."""
    if _option(words, "--weights_only") not in (None, "true"):
        raise ConfigError(
            "--weights_only that is not true",
            expected="checkpoints of tensors and primitives: loading one never executes code",
            mend="leave it out",
        )
    return ["--weights_only", "true", *words]


def _with_checkpoint(command: str, words: list[str]) -> list[str]:
    """Name the model that a checkpoint holds, and let its representation encode whatever flights are scored.

    Neither the checkpoint nor the settings beside it choose a class by its path: they may be anybody's.
    """
    checkpoint = _option(words, "--ckpt_path")
    if checkpoint is None:
        raise ConfigError(
            f"{command} without a checkpoint",
            expected="--ckpt_path FILE (otherwise random parameters would be scored)",
            mend="pass the run's checkpoints/best.ckpt"
            + ("; the rest of descents, df.predict, is `descentflow predict-descent`" if command == "predict" else ""),
        )
    model = str(read_checkpoint(checkpoint)[SECTION].get("model", "")).removesuffix("Density")
    if model not in MODELS:
        raise CheckpointError(f"{checkpoint}: no model named", expected="a whole checkpoint", mend="fit again")
    named = {name for name in ("--config", "--data", "--data.descents") if _option(words, name) is not None}
    kept = [] if named & {"--config", "--data"} else _settings_beside(Path(checkpoint), needed=not named)
    # Lightning would print a line for each of the hundred scores that are logged, after the table that shows them.
    quiet = ["--verbose", "false"] if command == "test" else []
    return [*quiet, *kept, "--model", model, *words, "--data.checkpoint", checkpoint]


def _settings_beside(checkpoint: Path, *, needed: bool) -> list[str]:
    """Settings of data and scores of the run that wrote a checkpoint, if it lies in a run or they are needed."""
    try:
        run = read_settings(run_folder(checkpoint) / "config.yaml")
    except ConfigError:
        if needed:
            raise
        return []
    return [
        f"--{name}.{option}={value if isinstance(value, str) else json.dumps(value)}"
        for name in ("data", "scores")
        for option, value in dict(run.get(name) or {}).items()
        if value is not None
    ]


def _option(words: Sequence[str], name: str) -> str | None:
    """Value of an option given as ``--name value`` or ``--name=value``."""
    for position, word in enumerate(words):
        if word == name and position + 1 < len(words):
            return words[position + 1]
        if word.startswith(f"{name}="):
            return word.split("=", 1)[1]
    return None
