"""Folders of the trainer's commands: `fit` writes into one of its own, the others into that of the run they score."""

from inspect import signature
from pathlib import Path
from typing import Any

from lightning.pytorch import LightningModule, Trainer

from descentflow.core.errors import ConfigError
from descentflow.core.files import check_folder, write_whole
from descentflow.core.user_files import settings_text
from descentflow.training.data_settings import DataSettings
from descentflow.training.datamodule import DescentDataModule

SETTINGS = "config.yaml"
"""File of a run's settings."""
UNNAMED = "default"
"""Stands for the model's name in the folder of a run."""
USUAL_FOLDER = "runs"
"""Folder of runs by default."""


def name_run(config: Any) -> None:
    """Put a fit's folder into ``--trainer.default_root_dir``, and name it after the model unless it has a name.

    Args:
        config: Settings of the command, changed in place.

    Raises:
        DataError: If the folder cannot be written.

    Example:
        >>> from types import SimpleNamespace as Settings
        >>> logger = Settings(class_path="TensorBoardLogger", init_args={"save_dir": "runs", "name": UNNAMED})
        >>> model = Settings(class_path="descentflow.training.models.Gaussian")
        >>> name_run(Settings(model=model, trainer=Settings(logger=logger, default_root_dir="here")))
        >>> logger.init_args["save_dir"], logger.init_args["name"]
        ('here', 'Gaussian')
    """
    options = _logger_options(config)
    if not options:
        return
    if options.get("name") == UNNAMED:
        options["name"] = config.model.class_path.rsplit(".", 1)[-1]
    if options.get("save_dir") == USUAL_FOLDER and config.trainer.default_root_dir is not None:
        options["save_dir"] = str(config.trainer.default_root_dir)
    check_folder(options["save_dir"])
    _without_false_score(config)


def write_into_run(config: Any, command: str, run: Path) -> None:
    """Let `test` and `predict` write into the folder of that name in the run that they score; `validate` only prints.

    Args:
        config: Settings of the command, changed in place.
        command: Which.
        run: Folder of the run.

    Raises:
        DataError: If that folder cannot be written.

    Example:
        >>> from types import SimpleNamespace as Settings
        >>> logger = Settings(class_path="TensorBoardLogger", init_args={"save_dir": "runs", "name": "gaussian"})
        >>> write_into_run(Settings(trainer=Settings(logger=logger)), "test", Path("runs/gaussian/version_0"))
        >>> logger.init_args["save_dir"], logger.init_args["version"]
        ('runs/gaussian/version_0', 'test')
    """
    if command == "validate":
        config.trainer.logger = False
        return
    check_folder(run / command)
    options = _logger_options(config)
    if not options:
        config.trainer.default_root_dir = str(run / command)
        return
    for name, value in {"save_dir": str(run), "name": "", "version": command}.items():
        options[name] = value
    _without_false_score(config)


def folder_of(trainer: Trainer) -> Path:
    """The folder in which a run's settings, checkpoints and scores belong.

    It is Lightning's ``log_dir`` for TensorBoard and CSV. Other loggers (MLflow, Weights & Biases) share one folder
    between runs. There it is the one of the run's own name and version, in which Lightning puts the checkpoints.
    Without a logger it is ``default_root_dir``. No process waits for another here, as in Lightning's own ``log_dir``.

    Example:
        >>> from lightning.pytorch.loggers import CSVLogger
        >>> folder_of(Trainer(logger=CSVLogger("logs", name="mine"), accelerator="cpu")).as_posix()
        'logs/mine/version_0'
    """
    if not trainer.loggers:
        return Path(trainer.default_root_dir)
    logger = trainer.loggers[0]
    if logger.log_dir:
        return Path(logger.log_dir)
    version = logger.version if isinstance(logger.version, str) else f"version_{logger.version}"
    return Path(logger.save_dir or trainer.default_root_dir) / str(logger.name) / version


def run_folder(checkpoint: Path) -> Path:
    """The folder of a run, known by its settings: that of its checkpoint, or the one above.

    Raises:
        ConfigError: If neither has settings.

    Example:
        >>> run_folder(Path("else/where/best.ckpt"))
        Traceback (most recent call last):
        ...
        descentflow.core.errors.ConfigError: no config.yaml next to else/where/best.ckpt or one folder up; ...
    """
    for folder in (checkpoint.parent, checkpoint.parent.parent):
        if (folder / "config.yaml").is_file():
            return folder
    raise ConfigError(
        f"no config.yaml next to {checkpoint} or one folder up",
        expected="the settings of the run that wrote it",
        mend="pass the descents, --data.descents FILE, or its settings, --config FILE",
    )


def check_new_run(folder: Path) -> None:
    """Refuse a folder for a run that has one already, or cannot be written.

    Raises:
        ConfigError: If it has settings of a run.
        DataError: If it cannot be written.

    Example:
        >>> check_new_run(Path("runs/mine"))
    """
    if (folder / SETTINGS).exists():
        raise ConfigError(
            f"{folder} of another run", expected="a folder of its own for each run", mend="choose another folder"
        )
    check_folder(folder)


def write_settings(
    folder: Path, seed: int, model: LightningModule, data: DescentDataModule, others: dict[str, Any]
) -> None:
    """Write the settings of a fit from Python as the command line writes those of its own.

    Args:
        folder: Of the run.
        seed: Of the fit.
        model: Whose hyperparameters are written.
        data: Whose options are written, where they are not the defaults; descents in memory have no name.
        others: Other sections.

    Example:
        >>> from descentflow.training.models.gaussian_model import Gaussian
        >>> write_settings(Path("."), 0, Gaussian(), DescentDataModule("descents.parquet", air="measured"), {})
        >>> Path("config.yaml").read_text().split("data:")[1].split()
        ['descents:', 'descents.parquet', 'air:', 'measured']
    """
    values, usual = vars(data) | vars(data.settings), vars(DataSettings())
    usual = {name: one.default for name, one in signature(type(data)).parameters.items() if name in values} | usual
    options = {name: values[name] for name, default in usual.items() if values[name] != default}
    kind = type(model)
    settings = {
        "seed_everything": seed,
        "model": {"class_path": f"{kind.__module__}.{kind.__qualname__}", "init_args": dict(model.hparams)},
        "data": {name: _as_yaml(value) for name, value in options.items() if _as_yaml(value) is not None},
        **others,
    }
    write_whole(folder / SETTINGS, settings_text(settings))


def _as_yaml(value: Any) -> Any:
    """Value of an option in YAML: paths are text, and descents in memory are nothing."""
    if isinstance(value, list | tuple):
        return [_as_yaml(item) for item in value]
    plain = int | float | str | bool
    return value if isinstance(value, plain) else str(value) if isinstance(value, Path) else None


def _logger_options(config: Any) -> Any:
    """Options of the one logger with a folder; empty if there is none."""
    options = getattr(config.trainer.logger, "init_args", None)
    return {} if options is None or "save_dir" not in options else options


def _without_false_score(config: Any) -> None:
    """Keep TensorBoard from opening on a score of -1 that nobody measured."""
    if config.trainer.logger.class_path.endswith("TensorBoardLogger"):
        config.trainer.logger.init_args["default_hp_metric"] = False
