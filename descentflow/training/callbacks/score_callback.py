"""Rejection sampling and scores while a model trains, and in full when it is tested."""

from io import BytesIO
from typing import Any

from jsonargparse.typing import NonNegativeInt, PositiveInt
from lightning.pytorch import Callback, LightningModule, Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.utilities import rank_zero_info, rank_zero_warn
from matplotlib.image import imread

from descentflow.core.errors import SamplingError
from descentflow.core.progress import stage
from descentflow.evaluation.evaluate import N_SPLITS, evaluate_profiles
from descentflow.evaluation.evaluation_report import Evaluation
from descentflow.evaluation.metrics.scores import n_comparisons
from descentflow.representation.flight_parts import Part
from descentflow.training.datamodule import data_of
from descentflow.training.models.latent_model import LatentModel
from descentflow.training.run_folders import folder_of

FEW_SPLITS = 20
"""Random splits behind each noise floor while a model trains."""


class ScoreCallback(Callback):
    """Sample, score and draw: every k epochs of `fit` on validation flights, and in `test` on test flights.

    Acceptance, rejections by rule and every score with its floor are logged by the model, so that loggers, checkpoints
    and early stopping have them by name (``val/score/...``, ``test/score/...``). TensorBoard has each score with its
    floor in one chart, and the figures. `test` also writes `scores.csv`, `rejections.json` and the figures into the
    run's folder. Of several processes the first one scores.

    Example:
        >>> from descentflow.training.datamodule import DescentDataModule
        >>> from descentflow.training.fit import fit
        >>> data = DescentDataModule("descents.parquet")
        >>> options = {"logger": False, "enable_progress_bar": False, "default_root_dir": "scored"}
        >>> trainer = Trainer(callbacks=[ScoreCallback(n_test_samples=100)], accelerator="cpu", **options)
        >>> scores = trainer.test(fit(data, "gaussian"), data, verbose=False)
        >>> Path("scored/scores.csv").is_file()
        True
    """

    def __init__(
        self,
        every_n_epochs: NonNegativeInt = 0,
        n_samples: PositiveInt = 2000,
        n_test_samples: PositiveInt = 10_000,
        seed: int = 0,
    ) -> None:
        """Set how often and how much.

        Args:
            every_n_epochs: Score after every k-th epoch of `fit`; 0 scores after the last one only, unless early
                stopping makes it the last. With 1, other callbacks can monitor a score.
            n_samples: Samples in `fit`.
            n_test_samples: Samples in `test` (the paper's 10,000).
            seed: Of the sampling.
        """
        self.every_n_epochs, self.n_samples, self.n_test_samples = every_n_epochs, n_samples, n_test_samples
        self.seed = seed

    def on_validation_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Score against the validation flights in the epochs that are due, before other callbacks ask for scores."""
        if trainer.state.fn != "fit" or trainer.sanity_checking or not self._due(trainer):
            return
        if len(data_of(trainer).profiles("validation")) == 0:
            # All flights but the test flights train, as in the paper: nothing to score against yet.
            return
        evaluation = None
        try:
            evaluation = self._evaluate(trainer, pl_module, "validation", self.n_samples, FEW_SPLITS)
        except SamplingError as error:
            # An untrained density may propose nothing plausible; the fit goes on.
            rank_zero_warn(f"epoch {trainer.current_epoch}: not scored, {error}")
        self._log(trainer, pl_module, evaluation, "val")

    def on_test_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Score against the test flights, write the files and print the table."""
        evaluation = self._evaluate(trainer, pl_module, "test", self.n_test_samples, N_SPLITS)
        self._log(trainer, pl_module, evaluation, "test")
        if evaluation is not None:
            folder = folder_of(trainer)
            with stage("drawing figures and writing"):
                evaluation.write(folder)
            rank_zero_info(f"{evaluation.rejections}\n{evaluation.scores}\nwrote {folder / 'scores.csv'} and figures")

    def _due(self, trainer: Trainer) -> bool:
        epoch = trainer.current_epoch + 1
        last = epoch == trainer.max_epochs or trainer.should_stop
        return last or (self.every_n_epochs > 0 and epoch % self.every_n_epochs == 0)

    def _evaluate(
        self, trainer: Trainer, module: LightningModule, part: Part, n: int, n_splits: int
    ) -> Evaluation | None:
        """The scores in the first process; None in the others."""
        if not trainer.is_global_zero:
            return None
        assert isinstance(module, LatentModel)
        flights = data_of(trainer).flights(part)
        with stage("scoring samples") as shown:
            return evaluate_profiles(
                module.density,
                module.representation,
                flights.profiles,
                context=flights.context,
                n=n,
                seed=self.seed,
                name=type(module).__name__,
                n_splits=n_splits,
                costly=part == "test",
                progress=shown.part("drawing descents", n, "descents"),
                score_progress=shown.part("scoring samples", n_comparisons(n_splits), "comparisons"),
            )

    def _log(self, trainer: Trainer, module: LightningModule, evaluation: Evaluation | None, kind: str) -> None:
        """Log the scores of the first process in all processes: a callback in each may monitor them."""
        values: dict[str, Any] = trainer.strategy.broadcast({} if evaluation is None else _values(evaluation, kind))
        module.log_dict(values, sync_dist=True, batch_size=1)
        for logger in trainer.loggers:
            if evaluation is not None and isinstance(logger, TensorBoardLogger):
                self._show(logger, evaluation, kind, trainer.global_step)

    def _show(self, logger: TensorBoardLogger, evaluation: Evaluation, kind: str, step: int) -> None:
        """The figures."""
        with stage("drawing figures"):
            for name, picture in evaluation.pictures.items():
                image = imread(BytesIO(picture), format="png")[:, :, :3]
                logger.experiment.add_image(f"{kind}/{name}", image, step, dataformats="HWC")


def _values(evaluation: Evaluation, kind: str) -> dict[str, float]:
    """Names and values for loggers."""
    drawn = max(evaluation.rejections.drawn, 1)
    return {
        **{f"{kind}/score/{name}": value for name, value in evaluation.scores.scalars().items()},
        f"{kind}/acceptance": evaluation.rejections.acceptance,
        **{f"{kind}/rejected/{rule}": count / drawn for rule, count in evaluation.rejections.broken.items()},
    }
