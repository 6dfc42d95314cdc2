"""Training settings of a model: its YAML file, over the defaults of the command line, or a Python file of a user."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from lightning.pytorch import Callback

from descentflow.configs.packaged_config import config_file
from descentflow.core.errors import ConfigError, nearest
from descentflow.core.user_files import module_of_file, read_settings
from descentflow.densities import MODULES
from descentflow.densities.density import Density
from descentflow.densities.kinds import KINDS
from descentflow.training import models
from descentflow.training.models.latent_model import LatentModel


def model_of_file(path: str | Path) -> type[LatentModel[Any]]:
    """The model that a file defines: its one subclass of :class:`.LatentModel` that is not abstract.

    Args:
        path: Of a Python file, which is run. Its densities are known to checkpoints from then on.

    Raises:
        ConfigError: If there is no such file, it fails, or it has no model, several, or a name that is taken.

    Example:
        >>> _ = Path("own_density.py").write_text('''
        ... from descentflow.densities.gaussian import GaussianDensity
        ... from descentflow.training.models.gaussian_model import Gaussian
        ... class NarrowDensity(GaussianDensity):
        ...     pass
        ... class Narrow(Gaussian):
        ...     def make(self, dimension, n_context=0):
        ...         return NarrowDensity(dimension, n_context)
        ... ''')
        >>> model_of_file("own_density.py").__name__
        'Narrow'
        >>> _ = Density.kinds.pop("NarrowDensity")  # it shall not be known to other examples
    """
    before = dict(Density.kinds)
    try:
        return _only_model(path)
    except ConfigError:
        for name in Density.kinds.keys() - before.keys():
            del Density.kinds[name]
        Density.kinds.update(before)  # a name of the package that the file took is the package's again
        raise


def _only_model(path: str | Path) -> type[LatentModel[Any]]:
    module = module_of_file(path, "a density and its model")
    own = [kind for kind in vars(module).values() if inspect.isclass(kind) and kind.__module__ == module.__name__]
    kinds = [kind for kind in own if issubclass(kind, LatentModel) and not inspect.isabstract(kind)]
    taken = [kind.__name__ for kind in own if kind.__name__ in {*MODULES, *models.MODULES}]
    if taken or len(kinds) != 1:
        what = f"{taken[0]}, a name that is taken" if taken else f"{len(kinds) or 'no'} models"
        raise ConfigError(
            f"{path}: {what}",
            expected="one class that derives from descentflow.training.models.LatentModel, with a name of its own",
            mend="rename it" if taken else "keep one model in a file, as the page on densities does",
        )
    return kinds[0]


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
        made: LatentModel[Any] = _class_at(self.class_path)(**self.model)
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
