"""The base of every latent model: what a density over the weights offers to training, sampling and checkpoints."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import torch
from lightning.pytorch import LightningModule
from torch import Tensor

from descentflow import __version__
from descentflow.data.representation import Representation
from descentflow.errors import CheckpointError, ConfigError

SECTION = "descentflow"
"""Key of a checkpoint under which everything stands that Lightning does not save itself."""
FORMAT = 1
"""Version of that section."""


class LatentModel(LightningModule, ABC):
    """A density over standardised weights (paper, section 2.3).

    A subclass says how the density is built for d weights (:meth:`build`), its log density, how to draw from it,
    and how one training step improves it. Everything else, the representation in the checkpoint included, stands
    here.

    Example:
        >>> model = load_model("best.ckpt")
        >>> weights = model.sample(1000, seed=0)  # (1000, d)
        >>> model.log_prob(weights).mean()
    """

    models: ClassVar[dict[str, type["LatentModel"]]] = {}
    """Every known model by the name that checkpoints carry."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Make the subclass known to checkpoints by its name."""
        super().__init_subclass__(**kwargs)
        LatentModel.models[cls.__name__] = cls

    def __init__(self, **kwargs: Any) -> None:
        """Start without a density: it is built once the number of weights is known.

        Args:
            **kwargs: Hyperparameters of a subclass; Lightning finds them through this signature.
        """
        super().__init__()
        self._representation: Representation | None = None

    @abstractmethod
    def build(self, dimension: int) -> None:
        """Create the parameters for ``dimension`` weights."""

    @abstractmethod
    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d), in nats."""

    @abstractmethod
    def draw(self, n: int) -> Tensor:
        """Draw (n, d) standardised weights with torch's global generator; call :meth:`sample` instead."""

    @torch.no_grad()
    def sample(self, n: int, seed: int) -> Tensor:
        """Draw (n, d) standardised weights, the same for the same seed, leaving the global generator as it was."""
        with seeded(seed, self.device):
            return self.draw(n)

    @property
    def representation(self) -> Representation:
        """Bases, scaler, bounds and split.

        Raises:
            ConfigError: Before the model has seen a DataModule or a checkpoint.
        """
        if self._representation is None:
            raise ConfigError(
                "a latent model without a representation",
                expected="a model that was fitted or loaded from a checkpoint",
                mend="fit it, or load it with descentflow.models.checkpoint.load_model",
            )
        return self._representation

    def attach(self, representation: Representation) -> None:
        """Take the representation and build the density for its number of weights."""
        first = self._representation is None
        self._representation = representation.to(self.device)
        if first:
            self.build(representation.decoder.dimension)

    def setup(self, stage: str) -> None:
        """Take the representation of the DataModule (Lightning calls this)."""
        if self._representation is None:
            self.attach(self.trainer.datamodule.representation)  # type: ignore[attr-defined]

    def nll(self, batch: tuple[Tensor, ...]) -> Tensor:
        """Mean negative log-likelihood of a batch of standardised weights, in nats a flight."""
        return -self.log_prob(batch[0]).mean()

    def validation_step(self, batch: tuple[Tensor, ...], batch_index: int) -> None:
        """Log the NLL of flights that no parameter was fitted to."""
        self.log("val/nll", self.nll(batch), prog_bar=True, on_epoch=True, batch_size=len(batch[0]))

    def test_step(self, batch: tuple[Tensor, ...], batch_index: int) -> None:
        """Log the NLL of the test flights."""
        self.log("test/nll", self.nll(batch), on_epoch=True, batch_size=len(batch[0]))

    def predict_step(self, batch: tuple[Tensor, ...], batch_index: int) -> Tensor:
        """Log density of each flight: the smaller, the less usual its descent."""
        return self.log_prob(batch[0])

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add what sampling needs besides the parameters, and leave nothing that is not a tensor or a primitive."""
        # The command line's PositiveInt and the like are classes of their own, which weights_only refuses.
        if "hyper_parameters" in checkpoint:
            checkpoint["hyper_parameters"] = {k: _primitive(v) for k, v in checkpoint["hyper_parameters"].items()}
        checkpoint[SECTION] = {
            "format": FORMAT,
            "version": __version__,
            "model": type(self).__name__,
            "representation": self.representation.to_state(),
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Restore the representation, and refuse a checkpoint of other flights when a fit is resumed."""
        saved = Representation.from_state(checkpoint[SECTION]["representation"])
        if self._representation is not None and self._representation.split != saved.split:
            raise CheckpointError(
                "a checkpoint that was trained on other flights than those of data.descents",
                expected="the same prepared descents, filters and seed as in the run that is resumed",
                mend="use that run's own config.yaml and data, or start a new fit",
            )
        self.attach(saved)
        self.shape_from_checkpoint(checkpoint)

    def shape_from_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Give parameters whose shape was chosen during training the shape of the saved ones; nothing by default."""


def _primitive(value: Any) -> Any:
    """The built-in number behind a restricted one."""
    for kind in (bool, int, float, str):
        if isinstance(value, kind):
            return kind(value)
    return value


@contextmanager
def seeded(seed: int, device: torch.device) -> Iterator[None]:
    """Seed torch's global generators inside the block and restore them after it."""
    cuda = [device] if device.type == "cuda" else []
    with torch.random.fork_rng(devices=cuda):
        torch.manual_seed(seed)
        yield
