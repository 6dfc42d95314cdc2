"""Checkpoints of a run: written whole, and taken along when the run is resumed in a folder of its own."""

import shutil
import warnings
from pathlib import Path
from typing import Any

import torch
from lightning.fabric.plugins import TorchCheckpointIO
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.cli import SaveConfigCallback

from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.files import remove_left, whole_file
from descentflow.training.run_folders import folder_of


class WholeCheckpoints(TorchCheckpointIO):
    """Writes a checkpoint next to its name and renames it, and removes what a killed run left.

    Example:
        >>> WholeCheckpoints().save_checkpoint({"epoch": 3}, "run/epoch.ckpt")
        >>> torch.load("run/epoch.ckpt", weights_only=True), [path.name for path in Path("run").iterdir()]
        ({'epoch': 3}, ['epoch.ckpt'])
    """

    def save_checkpoint(self, checkpoint: dict[str, Any], path: Any, storage_options: Any = None) -> None:
        """Write a checkpoint.

        Raises:
            DataError: If the disk is full or may not be written.
        """
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            torch.save(checkpoint, temporary)


class WholeConfig(SaveConfigCallback):
    """Writes a run's `config.yaml` whole; that of another run with a checkpoint is not written over.

    Example:
        >>> from lightning.pytorch.cli import LightningArgumentParser
        >>> WholeConfig(LightningArgumentParser(), {}).config_filename
        'config.yaml'
    """

    def setup(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """Write the settings, once, and remove what killed runs left.

        Raises:
            ConfigError: If the folder has the settings and a checkpoint of another run.
            DataError: If they cannot be written.
        """
        if self.already_saved or not trainer.is_global_zero:
            return
        folder = folder_of(trainer)
        path = folder / self.config_filename
        if path.exists() and next(folder.rglob("*.ckpt"), None):
            raise ConfigError(
                f"{path} of another run",
                expected="a folder of its own for each run",
                mend="move it away, or choose another --trainer.default_root_dir",
            )
        folder.mkdir(parents=True, exist_ok=True)
        remove_left(folder.parent, "version_*/**/*")
        with whole_file(path) as temporary:
            self.parser.save(self.config, temporary, skip_none=False, overwrite=True, multifile=self.multifile)
        self.already_saved = True


class KeptEpochs(ModelCheckpoint):
    """Lightning's ModelCheckpoint, which a resumed fit takes the checkpoints of before along with.

    A resumed fit writes into a folder of its own, where Lightning's forgets how good the best epoch was and where its
    file is: the best epoch after the resumption would pass for that of the whole fit.

    Example:
        >>> before, after = KeptEpochs("first", monitor="val/nll"), KeptEpochs("second", monitor="val/nll")
        >>> before.state_key == ModelCheckpoint("first", monitor="val/nll").state_key
        True
    """

    _of: Trainer | None = None

    @property
    def state_key(self) -> str:
        """That of Lightning's, so that checkpoints of either are read."""
        return super().state_key.replace(type(self).__qualname__, ModelCheckpoint.__qualname__, 1)

    def setup(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """As Lightning's, and remember the trainer, which learns only later what it resumes."""
        super().setup(trainer, pl_module, stage)
        self._of = trainer

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """As Lightning's, after the files of the run before are copied into this run's folder."""
        resumed = self._of.ckpt_path if self._of is not None and self._of.state.fn == "fit" else None
        if resumed and self.dirpath is not None and state_dict.get("dirpath") != self.dirpath:
            state_dict = self._taken_along(state_dict, Path(resumed), Path(self.dirpath))
        super().load_state_dict(state_dict)
        self.current_score = state_dict.get("current_score")

    def _taken_along(self, state: dict[str, Any], resumed: Path, folder: Path) -> dict[str, Any]:
        """State with the names that its files have in the folder, into which they are copied."""
        paths = state.get("best_k_models") or {state["best_model_path"]: None}
        new = {old: str(folder / Path(old).name) for old in paths if old}
        for old, here in new.items():
            # The last epoch is the one that is resumed; the best one lies next to it.
            source = resumed if self.monitor is None else resumed.parent / Path(old).name
            if not source.is_file():
                warnings.warn(
                    f"{Path(old).name} is not next to {resumed}: the best epoch of the resumed fit is lost, and "
                    "the best one from now on is kept; to mend it, resume in the folder where the run left its files",
                    DescentflowWarning,
                    stacklevel=2,
                )
                return state
            folder.mkdir(parents=True, exist_ok=True)
            with whole_file(here) as temporary:
                shutil.copyfile(source, temporary)
        best = {new[old]: score for old, score in (state.get("best_k_models") or {}).items()}
        return {
            **state,
            "dirpath": self.dirpath,
            "best_k_models": best,
            "best_model_path": new.get(state["best_model_path"], ""),
            "kth_best_model_path": new.get(state.get("kth_best_model_path", ""), ""),
            "last_model_path": "",
        }
