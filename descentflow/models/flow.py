"""Training of the flows by maximum likelihood (paper, section 2.3 and appendix C)."""

from abc import ABC
from typing import TypeVar

from jsonargparse.typing import NonNegativeFloat, PositiveFloat, PositiveInt
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import Tensor

from descentflow.densities.flow import FlowDensity, MaskedAffineFlowDensity, SplineFlowDensity
from descentflow.models.base import LatentModel
from descentflow.models.optimizers import adam_with_cosine

F = TypeVar("F", bound=FlowDensity)


class _Flow(LatentModel[F], ABC):
    """What training of every flow shares."""

    learning_rate: float
    weight_decay: float

    def training_step(self, batch: tuple[Tensor, ...], batch_index: int) -> Tensor:
        """Negative log-likelihood of a batch."""
        loss = self.nll(batch)
        self.log("train/nll", loss, on_epoch=True, on_step=False, batch_size=len(batch[0]))
        return loss

    def configure_optimizers(self) -> OptimizerLRSchedulerConfig:
        """AdamW with a cosine that ends with the last epoch."""
        return adam_with_cosine(self, self.learning_rate, self.weight_decay)


class MaskedAffineFlow(_Flow[MaskedAffineFlowDensity]):
    """Trains masked affine flows; see :class:`MaskedAffineFlowDensity`.

    Example:
        >>> Trainer(max_epochs=200).fit(MaskedAffineFlow(n_flows=5), datamodule=data)
    """

    def __init__(
        self,
        n_flows: PositiveInt = 5,
        hidden_per_weight: PositiveInt = 2,
        learning_rate: PositiveFloat = 3e-3,
        weight_decay: NonNegativeFloat = 1e-5,
    ) -> None:
        """Set the hyperparameters.

        Args:
            n_flows: Number of masked affine flows.
            hidden_per_weight: Hidden units of each flow, as a multiple of the number of weights.
            learning_rate: Of Adam, annealed to zero by a cosine over ``trainer.max_epochs``.
            weight_decay: Of AdamW.
        """
        super().__init__()
        self.save_hyperparameters()
        self.n_flows, self.hidden_per_weight = int(n_flows), int(hidden_per_weight)
        # Built-in floats: the optimizer's state keeps them, and a checkpoint holds primitives only.
        self.learning_rate, self.weight_decay = float(learning_rate), float(weight_decay)

    def make(self, dimension: int) -> MaskedAffineFlowDensity:
        """Flows that start at the identity's neighbourhood."""
        return MaskedAffineFlowDensity(dimension, self.n_flows, self.hidden_per_weight)


class SplineFlow(_Flow[SplineFlowDensity]):
    """Trains autoregressive rational-quadratic splines; see :class:`SplineFlowDensity`.

    Example:
        >>> Trainer(max_epochs=150).fit(SplineFlow(n_flows=3), datamodule=data)
    """

    def __init__(
        self,
        n_flows: PositiveInt = 3,
        hidden: PositiveInt = 32,
        n_bins: PositiveInt = 8,
        learning_rate: PositiveFloat = 3e-3,
        weight_decay: NonNegativeFloat = 1e-4,
    ) -> None:
        """Set the hyperparameters.

        Args:
            n_flows: Number of spline flows.
            hidden: Units behind each flow's knots.
            n_bins: Pieces of each spline.
            learning_rate: Of Adam, annealed to zero by a cosine over ``trainer.max_epochs``.
            weight_decay: Of AdamW.
        """
        super().__init__()
        self.save_hyperparameters()
        self.n_flows, self.hidden, self.n_bins = int(n_flows), int(hidden), int(n_bins)
        self.learning_rate, self.weight_decay = float(learning_rate), float(weight_decay)

    def make(self, dimension: int) -> SplineFlowDensity:
        """Flows that start at the identity."""
        return SplineFlowDensity(dimension, self.n_flows, self.hidden, self.n_bins)
