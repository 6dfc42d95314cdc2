"""Progress of a training on stderr, as every command shows it, and silence for advice that does not apply here."""

import logging
import os
import warnings
from contextlib import ExitStack

from lightning.pytorch import Callback, LightningModule, Trainer

from descentflow.core.progress import Stage, clear_line, stage

NO_ADVICE = ("TPU available", "GPU available: False", "`Trainer.fit` stopped", "\U0001f4a1 Tip")


def quiet() -> None:
    """Silence advice that does not apply here; other messages of Lightning still appear.

    Example:
        >>> quiet()
        >>> warnings.warn("The dataloader does not have many workers", stacklevel=1)  # prints nothing
    """
    # Lightning's own calls of jsonargparse are what is deprecated, not anything a user wrote.
    os.environ.setdefault("JSONARGPARSE_DEPRECATION_WARNINGS", "off")
    for advice in (
        ".*does not have many workers.*",  # the weights are in memory
        ".*The number of training batches.*",  # a closed form has few
        ".*LightningCLI's args parameter.*",  # descentflow's own command line calls it
        ".*treespec, LeafSpec.*",
        ".*callbacks used to create the checkpoint need to be provided.*",  # what stops a fit is no matter of a score
        ".*The dirpath has changed.*",  # test and predict write into a folder of their own
    ):
        warnings.filterwarnings("ignore", message=advice)
    for handler in logging.getLogger("lightning.pytorch").handlers:
        handler.addFilter(_is_no_advice)


def _is_no_advice(record: logging.LogRecord) -> bool:
    # What is said goes where the progress is shown.
    clear_line()
    return not record.getMessage().startswith(NO_ADVICE)


class ShowProgress(Callback):
    """Shows the epochs of `fit`, with the score of the last one, and that flights are scored in the other commands.

    Example:
        >>> from descentflow.training.datamodule import DescentDataModule
        >>> from descentflow.training.fit import fit
        >>> options = {"logger": False, "enable_progress_bar": False, "default_root_dir": "shown"}
        >>> trainer = Trainer(callbacks=[ShowProgress()], accelerator="cpu", **options)
        >>> data = DescentDataModule("descents.parquet")
        >>> scores = trainer.validate(fit(data, "gaussian"), data, verbose=False)
    """

    def __init__(self, doing: str = "training") -> None:
        """Begin without a stage.

        Args:
            doing: What a fit is called.
        """
        self.doing = doing
        self._open = ExitStack()
        self._stage: Stage | None = None

    def _begin(self, trainer: Trainer, text: str, total: int | None = None, unit: str = "") -> None:
        self._end()
        if trainer.is_global_zero:
            self._stage = self._open.enter_context(stage(text, total, unit))

    def _end(self) -> None:
        self._open.close()
        self._stage = None

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Epochs are counted from here, those of a resumed run too."""
        epochs = trainer.max_epochs if trainer.max_epochs and trainer.max_epochs > 0 else None
        self._begin(trainer, self.doing, epochs, "epochs")
        if self._stage is not None:
            self._stage.advance(trainer.current_epoch)

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """An epoch further, with its score where it was validated."""
        if self._stage is not None:
            self._stage.advance()
            score = trainer.callback_metrics.get("val/nll")
            if score is not None:
                self._stage.text = f"{self.doing}, val/nll {float(score):.4g}"

    def on_validation_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Of `validate`; in `fit` it is a part of the epoch."""
        if trainer.state.fn == "validate":
            self._begin(trainer, "scoring flights")

    def on_validation_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """The scores are printed next."""
        if trainer.state.fn == "validate":
            self._end()

    def on_test_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """The likelihood of the held-out flights comes first."""
        self._begin(trainer, "scoring flights")

    on_predict_start = on_test_start

    def on_exception(
        self, trainer: Trainer, pl_module: LightningModule, exception: BaseException | None = None
    ) -> None:
        """End the line: the finding or the error is printed next."""
        self._end()

    on_train_end = on_test_epoch_end = on_predict_epoch_end = on_exception
