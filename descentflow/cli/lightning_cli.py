"""The trainer's commands: LightningCLI with this project's defaults and without its traps."""

import json
import re
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from copy import deepcopy
from os.path import normpath
from pathlib import Path
from typing import Any

from jsonargparse import ArgumentError
from lightning.fabric.plugins.environments.slurm import SLURMEnvironment
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch import Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.cli import LightningArgumentParser, LightningCLI
from lightning.pytorch.loggers import CSVLogger

from descentflow.cli.options import class_in
from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import CheckpointError, ConfigError, DescentflowError, nearest
from descentflow.core.threads import one_thread_by_default
from descentflow.core.user_files import read_settings
from descentflow.densities.kinds import KINDS
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint
from descentflow.training.callbacks.kept_epochs import KeptEpochs, WholeCheckpoints, WholeConfig
from descentflow.training.callbacks.log_prob_writer import WriteLogProb
from descentflow.training.callbacks.score_callback import ScoreCallback
from descentflow.training.callbacks.show_progress import ShowProgress, quiet
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.final_fit import fit_to_all
from descentflow.training.models import LatentModel
from descentflow.training.models.latent_model import check_precision
from descentflow.training.run_folders import (
    UNNAMED,
    USUAL_FOLDER,
    name_run,
    run_folder,
    write_into_run,
)
from descentflow.training.training_settings import CHECKPOINT_DEFAULTS, SETTINGS_OF, TRAINER_DEFAULTS

IN_PYTHON = {kind.name: kind.model for kind in KINDS}
"""Name of a model in :func:`descentflow.training.fit.fit` -> its class."""
NOISE = re.compile("Does not validate|Subtypes|Errors|Expected a <class 'NoneType'>|Given value type")
"""Lines of the parser's messages that name nothing of the user's."""
NOTHING_KEPT = (
    "no checkpoint was written: no epoch was trained and validated to its end (--trainer.max_epochs, fast_dev_run and "
    "limit_train_batches say how much is trained)"
)


class DescentCLI(LightningCLI):
    """LightningCLI whose checkpoints, scores and logger are set up unless a config sets others."""

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
        """Remember which options were given: defaults step back behind them."""
        self.words = list(args)
        try:
            super().parse_arguments(parser, args)
        except (ArgumentError, UnicodeDecodeError) as error:
            # The parser's own way is two pages of usage before the line that names what is wrong.
            raise ConfigError(
                _in_a_line(str(error), self.words[0]),
                expected=f"options and values as `descentflow {self.words[0]} --help_all` lists them, files as YAML",
                mend="correct what is named first, or leave it out",
            ) from None

    def _parse_ckpt_path(self) -> None:
        """Take no class from a checkpoint: Lightning would import whatever module it names."""

    def before_instantiate_classes(self) -> None:
        """Load checkpoints safely, and choose the folder that is written to, unless an option of the logger does."""
        config = self.config[self.subcommand]
        if config.weights_only is False:
            raise ConfigError(
                "--weights_only that is not true",
                expected="checkpoints of tensors and primitives: loading one never executes code",
                mend="leave it out",
            )
        config.weights_only = True  # left to itself, Lightning runs whatever a checkpoint's pickle asks for
        if self.subcommand == "fit":
            name_run(config)
            return
        run = _run_of(Path(config.ckpt_path))
        if not any(word.startswith("--trainer.logger") for word in self.words):
            write_into_run(config, str(self.subcommand), run)
        elif (options := getattr(config.trainer.logger, "init_args", {})).get("name") == UNNAMED:
            options["name"] = run.parent.name

    def instantiate_classes(self) -> None:
        """Make the classes of the options; a trainer, logger or callback that cannot be made is an error in a line."""
        try:
            super().instantiate_classes()
        except (TypeError, ValueError, MisconfigurationException) as error:
            cause = error.__cause__ or error  # the parser's error wraps that of a class
            if isinstance(cause, DescentflowError):
                raise cause from None
            raise ConfigError(
                f"options that cannot be taken: {type(cause).__name__}: {' '.join(str(cause).split())}",
                expected="options of trainer, loggers and callbacks as `descentflow fit --help_all` lists them",
                mend="correct or leave out what is named",
            ) from error

    def instantiate_trainer(self, **kwargs: Any) -> Trainer:
        """A trainer whose checkpoints are written whole."""
        if self.config[self.subcommand].trainer.plugins is None and SLURMEnvironment.detect():
            # At its signal Lightning would write into the folder that jobs share, in the midst of an epoch.
            kwargs["plugins"] = SLURMEnvironment(auto_requeue=False)
        trainer = super().instantiate_trainer(**kwargs)
        check_precision(trainer)
        if self.subcommand == "fit" and self.config["fit"].ckpt_path is None:
            _check_metrics(trainer)
        trainer.strategy.checkpoint_io = WholeCheckpoints()
        return trainer

    def before_fit(self) -> None:
        """Keep the model as it is, for the final fit."""
        self.again = deepcopy(self.model)

    def after_fit(self) -> None:
        """Fit again to all flights; say where both fits were written, how good, and what to do with them."""
        for kept in self.trainer.checkpoint_callbacks:
            if self.trainer.is_global_zero and isinstance(kept, ModelCheckpoint) and kept.monitor:
                if kept.best_model_path:
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
        path.relative_to(here) if path.is_relative_to(here) else path for path in (Path(best.best_model_path), final)
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
            random parameters; if checkpoints are to be loaded unsafely, or the options are wrong.
        CheckpointError: If the checkpoint cannot be used.
    """
    words = ["--help" if word == "--help_all" else word for word in rest]
    words = _replaced(_replaced(words, "--config", _settings), "--model", _class_path)
    words = _replaced(words, "--model.class_path", _class_path)
    if "--help" not in words:
        words = _with_checkpoint(command, words)
    quiet()
    one_thread_by_default()
    # The best checkpoint's own `save_last` writes only in epochs that are the best so far; a killed run resumes here.
    every_epoch = KeptEpochs(filename="last", save_top_k=1, enable_version_counter=False)
    try:
        DescentCLI(
            LatentModel,
            DescentDataModule,
            subclass_mode_model=True,
            seed_everything_default=0,
            trainer_defaults={"callbacks": [WriteLogProb(), every_epoch, ShowProgress()]},
            save_config_callback=WholeConfig if command == "fit" else None,
            save_config_kwargs={"overwrite": False},
            parser_kwargs={
                "prog": "descentflow",
                "exit_on_error": False,
                command: {"exit_on_error": False},
            },
            args=[command, *words],
        )
    except MisconfigurationException as error:
        raise ConfigError(
            str(error).splitlines()[0],
            expected="options of the trainer that go together",
            mend="change or leave out one",
        ) from None


def _in_a_line(message: str, command: str) -> str:
    r"""The parser's message without its lines that are the same in all of them.

    Example:
        >>> _in_a_line("Parser key \"data.seed\":\n  Errors:\n    - Expected a <class 'int'>\n  Given value: x", "fit")
        "--data.seed: Expected a <class 'int'>; Given value: x"
    """
    lines = [line.strip(" -") for line in message.splitlines()]
    text = " ".join(f"{line}{';' * (line[-1] != ':')}" for line in lines if line and not NOISE.match(line))
    return re.sub(rf'Parser key "([\w.]+)"|\b{command}\.(?=\w)', lambda key: f"--{key[1] or ''}", text).rstrip(";")


def _replaced(words: list[str], option: str, new: Callable[[str], str]) -> list[str]:
    """Words with another value of an option, given as ``--name value`` or ``--name=value``."""
    return [
        new(word)
        if before == option
        else f"{option}={new(word.partition('=')[2])}"
        if word.startswith(f"{option}=")
        else word
        for before, word in zip(["", *words], words, strict=False)
    ]


def _settings(name: str) -> str:
    """A settings file, the user's own or one that comes along, whose sections hold settings."""
    path = config_file(name)
    settings = read_settings(path)
    for section in ("data", "trainer", "scores", "checkpoint"):
        if not isinstance(content := settings.get(section, ""), dict | str):
            raise ConfigError(
                f"{path}: {section} is {str(content)[:60]}",
                expected="settings by name, or the name of a YAML file of them",
                mend=f"write lines of `NAME: VALUE` indented under `{section}:`, or leave the section out",
            )
    return str(path)


def _class_path(name: str) -> str:
    """The class of a model by its name here or in Python; only its module is imported then.

    Example:
        >>> _class_path("flow"), _class_path("Gaussian"), _class_path("mine.Model")
        ('descentflow.training.models.MaskedAffineFlow', 'descentflow.training.models.Gaussian', 'mine.Model')
    """
    named = IN_PYTHON.get(name, name)
    if named in SETTINGS_OF:
        return f"descentflow.training.models.{named}"
    if name.endswith(".py"):
        return class_in(name)
    if not name.isidentifier():  # the path of a class, or a file or a dictionary of settings
        return name
    near = nearest(name, [*IN_PYTHON, *SETTINGS_OF])
    raise ConfigError(
        f"no model {name}",
        expected=f"{', '.join(IN_PYTHON)}, the path of a class, or a .py file with a model",
        mend=f"did you mean {near}?" if near else "see `descentflow fit --help`",
    )


def _with_checkpoint(command: str, words: list[str]) -> list[str]:
    """Name the model that a checkpoint holds, and let its representation encode whatever flights are scored.

    Neither the checkpoint nor the settings of its run choose a class by its path: they may be anybody's.
    """
    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    for name in ("ckpt_path", "config", "data", "data.descents", "model"):
        parser.add_argument(f"--{name}")
    given = vars(parser.parse_known_args(words)[0])
    checkpoint = given["ckpt_path"]
    if command == "fit":
        if checkpoint is not None and Path(checkpoint).suffix:  # else one of Lightning's words, as last
            read_checkpoint(checkpoint)
        return words
    if checkpoint is None:
        raise ConfigError(
            f"{command} without a checkpoint",
            expected="--ckpt_path FILE (otherwise random parameters would be scored)",
            mend="pass the run's checkpoints/best.ckpt"
            + ("; the rest of descents, df.predict, is `descentflow predict-descent`" if command == "predict" else ""),
        )
    model = str(read_checkpoint(checkpoint)[SECTION].get("model", "")).removesuffix("Density")
    if model not in SETTINGS_OF and given["model"] is None:
        raise CheckpointError(f"{checkpoint}: no model named", expected="a whole checkpoint", mend="fit again")
    kept = [] if given["config"] or given["data"] else _settings_beside(checkpoint, given["data.descents"] is None)
    # Lightning would print a line for each of the hundred scores that are logged, after the table that shows them.
    quiet = ["--verbose", "false"] if command == "test" else []
    named = [] if given["model"] else ["--model", _class_path(model)]
    return [*quiet, *kept, *named, *words, "--data.checkpoint", checkpoint]


def _settings_beside(checkpoint: str, needed: bool) -> list[str]:
    """Settings of data and scores of the run that wrote a checkpoint, if it lies in a run or they are needed."""
    try:
        run = read_settings(run_folder(Path(checkpoint)) / "config.yaml")
    except ConfigError:
        if needed:
            raise
        return []
    return [
        f"--{section}.{name}={value if isinstance(value, str) else json.dumps(value)}"
        for section in ("data", "scores")
        for name, value in dict(run.get(section) or {}).items()
        if value is not None
    ]


def _check_metrics(trainer: Trainer) -> None:
    """Refuse a folder with the metrics of another run, which Lightning's CSVLogger would delete."""
    for logger in trainer.loggers:
        # A folder that ".." leaves again may not be there yet.
        if isinstance(logger, CSVLogger) and Path(normpath(logger.log_dir), "metrics.csv").exists():
            raise ConfigError(
                f"a CSVLogger into {logger.log_dir}, where the metrics.csv of another run is",
                expected="a folder of the run's own: the logger deletes what it finds",
                mend="give the logger another name or version, or leave both out",
            )
