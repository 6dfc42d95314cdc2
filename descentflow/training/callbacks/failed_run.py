"""One run a folder, its settings written whole, and nothing left of a run that came to nothing."""

import os
from contextlib import suppress
from pathlib import Path

from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Callback
from lightning.pytorch.cli import SaveConfigCallback

from descentflow.core.errors import ConfigError
from descentflow.core.files import Claim, remove_left, whole_file
from descentflow.training.run_folders import folder_of

WRITTEN = ("hparams.yaml", "metrics.csv", f"events.out.tfevents.*.{os.getpid()}.*")
"""Files that TensorBoard and CSV loggers of this process have written into the folder of a run."""
LOCK = ".run.descentflow-part0.lock"
"""File of a run's folder that the run at work in it has locked; that of a killed run goes with its temporary files."""


class RemoveFailedRun(Callback):
    """Removes what a run has made if it fails or is interrupted before it has a checkpoint or scores.

    Only files that this run wrote go, and only folders that it made and that are empty then: loggers such as MLflow and
    Weights & Biases share their folder with other runs, and a folder that was there before may be anybody's.

    Example:
        >>> from lightning.pytorch.loggers import CSVLogger
        >>> trainer = Trainer(logger=CSVLogger("failing"), callbacks=[RemoveFailedRun()], accelerator="cpu")
        >>> failed = RemoveFailedRun()
        >>> failed.note(trainer)
        >>> trainer.logger.log_metrics({"a": 1.0})
        >>> failed.on_exception(trainer, None, ValueError())
        >>> Path(trainer.logger.log_dir).exists()
        False
    """

    def __init__(self) -> None:
        """Begin without a folder."""
        self._of_another = False
        self._claim: Claim | None = None
        self._absent: list[Path] = []
        self._before: list[Path] | None = None

    def note(self, trainer: Trainer) -> None:
        """Note which folders of the run are not there yet; without it, none is removed.

        It is called before the loggers write: a logger that shares its folder is not asked, for it would begin a run.
        """
        if trainer.loggers and trainer.loggers[0].log_dir:
            self._absent, self._before = _absent(folder_of(trainer)), _written(folder_of(trainer))

    def setup(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """Claim the folder, which two runs that begin at the same moment would both take for the next free one.

        What killed runs left half written in the folders beside it is removed.

        Raises:
            ConfigError: If another run has it.
        """
        if not trainer.is_global_zero or not trainer.loggers or self._claim is not None:
            return
        folder = folder_of(trainer)
        self._absent = self._absent or _absent(folder)
        self._before = _written(folder) if self._before is None else self._before
        folder.mkdir(parents=True, exist_ok=True)
        self._claim = Claim(folder / LOCK)
        if not self._claim.take():
            self._of_another = True
            raise ConfigError(
                f"another run is at work in {folder}", expected="one a folder", mend="start this one again"
            )
        # Of killed runs, whose files nobody writes again: a run has a folder of its own.
        remove_left(folder.parent, "version_*/**/*")

    def teardown(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """Let the folder go."""
        self._let_go()

    def _let_go(self) -> None:
        if self._claim is not None:
            self._claim.let_go()
            self._claim = None

    def on_exception(self, trainer: Trainer, pl_module: LightningModule, exception: BaseException) -> None:
        """Remove what the run wrote if nothing in it is of use."""
        if self._of_another or not trainer.is_global_zero:
            return
        for logger in trainer.loggers:
            logger.finalize("failed")
        callbacks = trainer.callbacks  # type: ignore[attr-defined]
        settings = [one for one in callbacks if isinstance(one, WholeConfig) and one.already_saved]
        if settings and not _is_of_use(folder_of(trainer)):
            (folder_of(trainer) / settings[0].config_filename).unlink(missing_ok=True)
        if self._absent and not _is_of_use(self._absent[0]) and self._is_alone(self._absent[0]):
            self._remove()
        elif self._before is not None and not self._absent:
            folder = folder_of(trainer)
            if not _is_of_use(folder) and self._is_alone(folder):
                for path in set(_written(folder)) - set(self._before):
                    path.unlink()
        self._let_go()

    def _is_alone(self, folder: Path) -> bool:
        """True where no other run has claimed the folder: one that began at the same moment may have."""
        if self._claim is not None or not folder.is_dir():
            return folder.is_dir()
        self._claim = Claim(folder / LOCK)
        return self._claim.take()

    def _remove(self) -> None:
        """Remove this run's files, and the folders that it made if nothing else is in them."""
        folder = self._absent[0]
        for path in _written(folder):
            path.unlink()
        remove_left(folder)
        self._let_go()
        for one in (folder / "checkpoints", *self._absent):
            # A folder with anything else in it stays.
            with suppress(OSError):
                one.rmdir()


class WholeConfig(SaveConfigCallback):
    """Writes a run's `config.yaml` whole; one that is there already is that of another run.

    Example:
        >>> from jsonargparse import ArgumentParser, Namespace
        >>> parser, trainer = ArgumentParser(), Trainer(default_root_dir="of_a_run", logger=False, accelerator="cpu")
        >>> _ = parser.add_argument("--seed", type=int)
        >>> WholeConfig(parser, Namespace(seed=3)).setup(trainer, None, "fit")
        >>> Path("of_a_run/config.yaml").read_text().split()
        ['seed:', '3']
        >>> WholeConfig(parser, Namespace(seed=4)).setup(trainer, None, "fit")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: of_a_run/config.yaml of another run; expected ...; to mend it, ...
    """

    def setup(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """Write the settings, once.

        Raises:
            ConfigError: If the folder has settings already.
        """
        if self.already_saved or not trainer.is_global_zero:
            return
        folder = folder_of(trainer)
        path = folder / self.config_filename
        if path.exists():
            raise ConfigError(
                f"{path} of another run",
                expected="a folder of its own for each run",
                mend="move it away, or choose another --trainer.default_root_dir",
            )
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            self.parser.save(self.config, temporary, skip_none=False, overwrite=True, multifile=self.multifile)
        self.already_saved = True


def _absent(folder: Path) -> list[Path]:
    """The folder and the two above, as far as they do not exist."""
    return [one for one in (folder, *folder.parents[:2]) if not one.exists()]


def _written(folder: Path) -> list[Path]:
    """Files of loggers of this process in a folder."""
    return [path for name in WRITTEN for path in folder.glob(name)]


def _is_of_use(folder: Path) -> bool:
    scores = ("scores.csv", "log_prob.csv")
    return any(path.name[0] != "." for path in folder.rglob("*.ckpt")) or any(
        (folder / name).is_file() for name in scores
    )
