"""Progress of a training on stderr, as every command shows it."""

from contextlib import ExitStack

from lightning.pytorch import Callback, LightningModule, Trainer

from descentflow.core.progress import Stage, stage


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
