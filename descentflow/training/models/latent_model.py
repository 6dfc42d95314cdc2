"""The base of every model: what training, validation and checkpoints of a latent density have in common."""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import lightning
import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Timer
from torch import Tensor

from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.counter_random import seed_for_index
from descentflow.core.errors import CheckpointError, ConfigError, DescentflowWarning
from descentflow.core.files import whole_file
from descentflow.densities.checkpoint import OUTCOME, content_of, density_in, density_of, outcome_of, section_of
from descentflow.densities.density import Density
from descentflow.reporting.in_notebook import InNotebook
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.read_checkpoint import HELD_OUT, SECTION
from descentflow.representation.representation import Representation
from descentflow.training.datamodule import DescentDataModule, data_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

D = TypeVar("D", bound=Density)
TRAINING = "training"
"""Key of a checkpoint under which the fit's seed is kept, and whether it had stopped."""
PRECISIONS = ("32-true", "64-true")
"""Of Lightning's trainer, in which all models train."""
Batch = tuple[WeightEvidence, Tensor]
"""Observed part of some flights, and their encoded context (n, c)."""


class LatentModel(LightningModule, InNotebook, ABC, Generic[D]):
    """Trains one kind of :class:`descentflow.densities.Density` (paper, section 2.3).

    A subclass defines how the density is made for d weights (:meth:`make`) and how one training step improves it.
    Everything else is here, the representation in the checkpoint included.

    Example:
        >>> from descentflow.training.fit import fit
        >>> from descentflow.training.models.gaussian_model import Gaussian
        >>> model = fit("descents.parquet", Gaussian())
        >>> isinstance(model, LatentModel), type(model.density).__name__
        (True, 'GaussianDensity')
        >>> model.sample(10, seed=0).shape == (10, model.density.dimension)
        True
    """

    def __init__(self, **kwargs: Any) -> None:
        """Start without a density: it is made once the number of weights is known.

        Args:
            **kwargs: Hyperparameters of a subclass; Lightning finds them through this signature.
        """
        super().__init__()
        self._density: D | None = None
        self.outcome = ""
        """Description of the fit's end; empty before it."""
        self.chosen = ""
        """Reason for this kind of density; empty where a user named it."""
        self._seed, self._had_stopped = 0, False
        # In a tuple, for it is no part of this module: its parameters are not among these.
        self._final: tuple[D, ...] = ()

    @abstractmethod
    def make(self, dimension: int, n_context: int = 0) -> D:
        """The density for ``dimension`` weights and ``n_context`` numbers of context, before training."""

    @property
    def is_made(self) -> bool:
        """True once there is a density."""
        return self._density is not None

    @property
    def density(self) -> D:
        """The density that is trained.

        Raises:
            ConfigError: Before the model has seen a DataModule or a checkpoint.
        """
        if self._density is None:
            raise ConfigError(
                "a latent model without a density",
                expected="a model that was fitted or loaded from a checkpoint",
                mend="fit it, or load what it wrote with descentflow.densities.checkpoint.load_model",
            )
        return self._density

    @property
    def final(self) -> D | None:
        """The density fitted again to all flights, which is sampled; None where flights stay held out."""
        return self._final[0] if self._final else None

    def keep_final(self, density: D) -> None:
        """Take the density that was fitted to all flights."""
        density.refitted_from(self.density)
        self._final = (density,)

    def choose_as(self, fitted: "LatentModel[D]") -> None:
        """Take over what a fit of the same settings has chosen, so that this one need not; nothing in most models."""

    @property
    def representation(self) -> Representation:
        """Bases, scaler, bounds and split."""
        return self.density.representation

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats, at context (n, c) if it takes one."""
        return self.density.log_prob(weights, context)

    def sample(self, n: int, seed: int, context: Tensor | None = None) -> Tensor:
        """Draw (n, d) standardised weights, the same for the same seed."""
        return self.density.sample(n, seed, context)

    def attach(self, representation: Representation) -> None:
        """Take the representation, and make the density for its number of weights if there is none yet."""
        if not self.is_made:
            self._density = self.make(representation.decoder.dimension, representation.n_context).to(self.device)
        self.density.attach(representation)

    def setup(self, stage: str) -> None:
        """Take the representation of the DataModule, and torch's seed (Lightning calls this).

        Raises:
            ConfigError: If there is no DescentDataModule, or it has other components than a model that has some.
        """
        check_precision(self.trainer)
        if not self.is_made:
            self.attach(data_of(self.trainer).representation)
        elif isinstance(data := getattr(self.trainer, "datamodule", None), DescentDataModule):
            _check_same_weights(self.representation, data.representation)
        self._seed = torch.initial_seed()

    def seed_of_batch(self, batch_index: int) -> int:
        """Seed of what a training step draws: by seed, epoch and batch alone, so that a resumed fit draws it too."""
        return seed_for_index(self._seed, self.current_epoch, batch_index)

    def end_with_this_step(self) -> None:
        """End the fit, all parameters being set: Lightning saves nothing before an optimizer has stepped."""
        self.optimizers().step()  # type: ignore[union-attr]
        self.trainer.should_stop = True

    def on_train_start(self) -> None:
        """End at once if the fit that is resumed had stopped: another epoch would be one too many."""
        if self._had_stopped:
            self.trainer.should_stop = True
            warnings.warn(
                "the fit that is resumed had ended by itself: nothing is trained any more; to train on, begin a new "
                "fit with other settings of stopping",
                DescentflowWarning,
                stacklevel=2,
            )

    @checked_arguments
    def save(self, path: Output) -> None:
        """Write a checkpoint, whole or not at all; :func:`descentflow.densities.checkpoint.load_model` reads it.

        Where there is a final fit it is that one's, with the held-out fit inside.

        Raises:
            ConfigError: If the model has not been fitted.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> from descentflow.training.fit import fit
            >>> fit("descents.parquet", "gaussian").save("fitted.ckpt")
            >>> type(load_model("fitted.ckpt")).__name__
            'GaussianDensity'
        """
        content = content_of((self.final or self.density).cpu())
        content["hyper_parameters"] = {name: _primitive(value) for name, value in self.hparams.items()}
        content["pytorch-lightning_version"] = lightning.__version__
        content[OUTCOME] = self.outcome
        with whole_file(Path(path)) as temporary:
            torch.save(content, temporary)

    def restore(self, content: dict[str, Any]) -> None:
        """Take density, representation and parameters of a checkpoint's content, ready to sample on the CPU."""
        self.cpu()
        self.on_load_checkpoint(content)
        self.load_state_dict(content["state_dict"])
        self.outcome = outcome_of(content)
        self.eval()

    def notebook_figure(self) -> "Figure | None":
        """The components of drag and speed; nothing before the fit."""
        if not self.is_made:
            return None
        from descentflow.evaluation.figures.components import components_figure  # matplotlib loads where it draws

        decoder = (self.final or self.density).representation.decoder
        return components_figure(decoder.drag_basis, decoder.cas_basis, decoder.levels_fl, decoder.drag_scale)

    def __repr__(self) -> str:
        """Model and data in two lines; not the tree of modules."""
        if self._density is None or self._density._representation is None:
            return f"{type(self).__name__}, not fitted yet"
        representation = self.representation
        decoder = representation.decoder
        lines = [
            f"{type(self).__name__} of {decoder.dimension} weights ({decoder.sizes}) on "
            f"FL{decoder.levels_fl[0]:.0f}-{decoder.levels_fl[-1]:.0f}, {decoder.aircraft.typecode}",
            f"{len(representation.split.train)} flights trained it, {len(representation.split.validation)} validated it"
            + (f": {self.outcome}" if self.outcome else ""),
        ]
        if self.final is not None:
            lines.append(f"sampled: the final fit, to {self.final.representation.split.describe()}")
        if representation.n_context:
            lines.append(f"conditioned on {representation.context.describe()}")
        if self.chosen:
            lines.append(self.chosen)
        return "\n".join(lines)

    def log_observed(self, evidence: WeightEvidence, context: Tensor | None = None) -> Tensor:
        """Log-likelihood (n,) of what was observed of n flights, see :meth:`~descentflow.densities.Density`."""
        return self.density.log_observed(evidence, context)

    def nll(self, batch: Batch) -> Tensor:
        """Mean negative log-likelihood of what was observed of a batch of flights, in nats per flight."""
        return -self.log_observed(*batch).mean()

    @contextmanager
    def converging(self) -> Iterator[None]:
        """Report a matrix that has lost its rank in floating point as training that diverged."""
        try:
            yield
        except torch.linalg.LinAlgError:  # type: ignore[attr-defined]  # torch documents it; its stubs lack it
            raise self._diverged() from None

    def on_validation_epoch_start(self) -> None:
        """Refuse parameters that are no longer finite, before they are scored and kept.

        Raises:
            ConfigError: If training has diverged.
        """
        if self.automatic_optimization and self.trainer.state.fn == "fit":
            self.check_finite()

    def check_finite(self) -> None:
        """Refuse parameters that are no longer finite.

        Raises:
            ConfigError: If training has diverged.
        """
        if not all(bool(parameter.isfinite().all()) for parameter in self.parameters()):
            raise self._diverged()

    def _diverged(self) -> ConfigError:
        return ConfigError(
            f"parameters without a likelihood in epoch {self.trainer.current_epoch + 1}: training diverged",
            expected="parameters that stay finite",
            mend=f"lower the learning rate (--model.learning_rate), {self.hparams.get('learning_rate')} here",
        )

    def validation_step(self, batch: Batch, batch_index: int) -> None:
        """Log the NLL of flights that no parameter was fitted to."""
        with self.converging():
            nll = self.nll(batch)
        self.log("val/nll", nll, prog_bar=True, on_epoch=True, sync_dist=True, batch_size=len(batch[0]))

    def test_step(self, batch: Batch, batch_index: int) -> None:
        """Log the NLL of the test flights."""
        self.log("test/nll", self.nll(batch), on_epoch=True, sync_dist=True, batch_size=len(batch[0]))

    def predict_step(self, batch: Batch, batch_index: int) -> Tensor:
        """Log-likelihood of what was observed of each flight: the smaller, the less usual its descent."""
        return self.log_observed(*batch)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add what sampling needs besides the parameters, and leave nothing that is not a tensor or a primitive."""
        # The command line's PositiveInt and the like are classes of their own, which weights_only refuses.
        if "hyper_parameters" in checkpoint:
            checkpoint["hyper_parameters"] = {k: _primitive(v) for k, v in checkpoint["hyper_parameters"].items()}
        checkpoint[SECTION] = section_of(self.density)
        # What a timer stops is not at its end.
        callbacks = self.trainer.callbacks  # type: ignore[attr-defined]
        stopped = self.trainer.should_stop and not any(isinstance(callback, Timer) for callback in callbacks)
        checkpoint[TRAINING] = {"seed": self._seed, "stopped": stopped}

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Restore density and representation; refuse one of another model or other flights when a fit resumes."""
        finals = [density_in(checkpoint)] if HELD_OUT in checkpoint else []
        # What is trained on and scored is the held-out fit; Lightning loads its parameters from the same dictionary.
        checkpoint.update(checkpoint.get(HELD_OUT, {}))
        saved: D = density_of(checkpoint[SECTION])  # type: ignore[assignment]
        if self.is_made:
            self._check_same_model(saved, checkpoint.get("hyper_parameters") or {})
            _check_same_weights(saved.representation, self.representation)
            self._resume(checkpoint.get(TRAINING, {}))
        self._density = saved.to(self.device)
        for final in finals:
            self.keep_final(final)  # type: ignore[arg-type]

    @property
    def _fits(self) -> bool:
        return self._trainer is not None and self.trainer.state.fn == "fit"

    def _check_same_model(self, saved: D, settings: dict[str, Any]) -> None:
        """Refuse a checkpoint of another model, or to go on fitting with other settings; Lightning would take them."""
        before, now = (type(density).__name__.removesuffix("Density") for density in (saved, self.density))
        given = {name: value for name, value in self.hparams.items() if name in settings and name[0] != "_"}
        other = [f"{n} {settings[n]} (the options: {value})" for n, value in given.items() if settings[n] != value]
        if before != now or (self._fits and other):
            raise CheckpointError(
                f"a checkpoint of a {before}, where the options ask for a {now}"
                if before != now
                else f"a checkpoint of a {before} of other settings: {', '.join(other)}",
                expected="the model of the run that is resumed, with its settings",
                mend="use that run's own config.yaml, or leave --ckpt_path out and start a new fit",
            )

    def _resume(self, before: dict[str, Any]) -> None:
        """Take up what the fit had come to; say so if what is drawn from now on is not what it would have drawn."""
        self._had_stopped = bool(before.get("stopped"))
        if self._fits and before.get("seed") != self._seed:
            seed = before.get("seed", "that was not kept")
            warnings.warn(
                f"a fit of seed {seed} is resumed with seed {self._seed}: it does not end with what the other "
                "would have ended with undisturbed; to mend it, use the run's own config.yaml, or begin again",
                DescentflowWarning,
                stacklevel=2,
            )


def _check_same_weights(fitted: Representation, given: Representation) -> None:
    """Refuse weights of other flights or components than those that a model was fitted to."""
    if fitted.split != given.split:
        got = "a model that was trained on other flights than those of data.descents"
    elif fitted.decoder.sizes != given.decoder.sizes:
        got = f"a model of weights {fitted.decoder.sizes}, where the options of data make {given.decoder.sizes}"
    else:
        return
    raise ConfigError(
        got,
        expected="its descents, seed, data.fpca, data.explained_variance and data.cas_explained_variance",
        mend="use its run's config.yaml, its DataModule or DescentDataModule(..., checkpoint=FILE), or fit a new model",
    )


def check_precision(trainer: Trainer) -> None:
    """Refuse to train in half precision: triangular matrices cannot be solved in it.

    Raises:
        ConfigError: If the trainer's precision is neither 32 nor 64 bits.

    Example:
        >>> check_precision(Trainer(precision="bf16-mixed", accelerator="cpu", logger=False))
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: precision bf16-mixed; expected 32-true or 64-true; to mend it, ...
    """
    if trainer.precision not in PRECISIONS:
        raise ConfigError(
            f"precision {trainer.precision}",
            expected=" or ".join(PRECISIONS),
            mend="leave --trainer.precision out: densities choose their own, in which they are exact enough",
        )


def training_flights(model: LatentModel[Any]) -> tuple[WeightEvidence, Tensor]:
    """Evidence of all training flights, and their context, on the model's device.

    Example:
        >>> from lightning.pytorch import Trainer
        >>> from descentflow.training.datamodule import DescentDataModule
        >>> from descentflow.training.models.gaussian_model import Gaussian
        >>> data, model = DescentDataModule("descents.parquet"), Gaussian()
        >>> data.setup()
        >>> model.attach(data.representation)
        >>> model.trainer = Trainer(accelerator="cpu", logger=False)
        >>> model.trainer.datamodule = data
        >>> len(training_flights(model)[0]), training_flights(model)[1].shape[1]
        (86, 0)
    """
    data = data_of(model.trainer)
    evidence = data.evidence("train").to(model.device)
    return evidence, data.contexts("train").to(evidence.points)


def _primitive(value: Any) -> Any:
    """The built-in number behind a restricted one, of settings in groups too."""
    if isinstance(value, dict):
        return {name: _primitive(one) for name, one in value.items()}
    for kind in (bool, int, float, str):
        if isinstance(value, kind):
            return kind(value)
    return value
