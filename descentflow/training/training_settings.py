"""Training settings of a model: its YAML file, over the defaults of the command line."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from lightning.pytorch import Callback

from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import ConfigError, nearest
from descentflow.core.user_files import read_settings
from descentflow.densities.kinds import KINDS
from descentflow.training.data_settings import grouped, groups_of
from descentflow.training.models.latent_model import LatentModel
from descentflow.training.own_model import model_of_file

NAMES = {kind.name: kind.settings for kind in KINDS}
"""Name of a model -> the packaged settings file that trains it."""
SETTINGS_OF = {kind.model: kind.settings for kind in KINDS}
"""Class of a model -> the packaged settings file with which an instance of it is trained."""
CHECKPOINT_DEFAULTS = {"monitor": "val/nll", "filename": "best", "auto_insert_metric_name": False}
TRAINER_DEFAULTS = {
    "max_epochs": 200,
    "num_sanity_val_steps": 0,
    "log_every_n_steps": 1,
    "devices": 1,
    "accelerator": "cpu",
}
"""Of the Trainer. A GPU is no faster with a few weights a flight: 47 s and 42 s of an A320's flow on an H200."""


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a model and of its training in a file.

    Attributes:
        class_path: Where the model's class is.
        model: Its hyperparameters; those that are absent keep the class's defaults.
        data: Options of :class:`~descentflow.training.datamodule.DescentDataModule`.
        checkpoint: Options of Lightning's ModelCheckpoint: what decides which epoch was the best.
        trainer: Options of Lightning's Trainer, without callbacks and logger.
        callbacks: Class path and arguments of each callback.

    Example:
        >>> settings = TrainingSettings("descentflow.training.models.Gaussian", model={"jitter": 1e-4})
        >>> settings.new_model().jitter, settings.checkpoint["monitor"]
        (0.0001, 'val/nll')
    """

    class_path: str = ""
    model: dict[str, Any] = field(default_factory=dict)
    data: dict[str, Any] = field(default_factory=dict)
    checkpoint: dict[str, Any] = field(default_factory=lambda: dict(CHECKPOINT_DEFAULTS))
    trainer: dict[str, Any] = field(default_factory=lambda: dict(TRAINER_DEFAULTS))
    callbacks: tuple[tuple[str, dict[str, Any]], ...] = ()

    def as_sections(self) -> dict[str, Any]:
        """Sections ``checkpoint`` and ``trainer`` of a settings file."""
        callbacks = [{"class_path": path, "init_args": arguments} for path, arguments in self.callbacks]
        return {"checkpoint": self.checkpoint, "trainer": {**self.trainer, "callbacks": callbacks}}

    def new_model(self) -> LatentModel[Any]:
        """A model of the settings, not trained yet."""
        kind = _class_at(self.class_path)
        made: LatentModel[Any] = kind(**grouped(self.model, groups_of(kind)))
        return made

    def new_callbacks(self) -> list[Callback]:
        """The callbacks of the settings."""
        return [_class_at(path)(**arguments) for path, arguments in self.callbacks]


def training_settings(name: str | Path) -> TrainingSettings:
    """Read the settings of a model.

    Args:
        name: ``gaussian``, ``mixture`` or ``flow``, or the class's name; a YAML file as
            ``descentflow fit --config`` takes it (:func:`~descentflow.configs.packaged_config.config_file`); or a
            Python file with a model of one's own, which is run.

    Raises:
        ConfigError: If there are no such settings, or they name no model.

    Example:
        >>> settings = training_settings("flow")
        >>> settings.class_path, settings.model["n_flows"], settings.trainer["max_epochs"]
        ('descentflow.training.models.MaskedAffineFlow', 5, 150)
    """
    if Path(name).suffix == ".py":
        own = model_of_file(name)
        return TrainingSettings(f"{own.__module__}.{own.__name__}")
    try:
        path = config_file((NAMES | SETTINGS_OF).get(str(name), name))
    except (ConfigError, OSError) as error:  # no file has a name of hundreds of letters
        near = nearest(str(name).lower(), NAMES)
        raise ConfigError(
            f"a model {str(name)!r}",
            expected=f"{', '.join(NAMES)}, a model such as Gaussian(), a YAML file of settings, or a model's .py file",
            mend=f"did you mean {near!r}?" if near else "choose one of them",
        ) from error
    settings = read_settings(path)
    model = settings.get("model")
    if not isinstance(model, Mapping) or "class_path" not in model:
        raise ConfigError(f"{path} without a model", expected="model: class_path: ...", mend="name the model's class")
    trainer = dict(settings.get("trainer") or {})
    # A fit from Python writes no logs: where they would go is a matter of the command line.
    trainer.pop("logger", None)
    callbacks = trainer.pop("callbacks", None) or []
    return TrainingSettings(
        model["class_path"],
        dict(model.get("init_args") or {}),
        dict(settings.get("data") or {}),
        CHECKPOINT_DEFAULTS | (settings.get("checkpoint") or {}),
        TRAINER_DEFAULTS | trainer,
        tuple((callback["class_path"], dict(callback.get("init_args") or {})) for callback in callbacks),
    )


def settings_of(model: LatentModel[Any]) -> TrainingSettings:
    """The settings with which a model that was made in Python is trained: those of its class, or else the defaults.

    Example:
        >>> from descentflow.training.models import Gaussian
        >>> settings_of(Gaussian()).trainer["max_epochs"]
        1
    """
    name = type(model).__name__
    return training_settings(name) if name in SETTINGS_OF else TrainingSettings()


def _class_at(path: str) -> Any:
    module, _, name = path.rpartition(".")
    try:
        return getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"class {path}", expected="one that can be imported", mend="correct class_path") from error
