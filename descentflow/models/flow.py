"""Masked affine autoregressive flow from normflows (paper, section 2.3 and appendix C)."""

import normflows as nf
import torch
from jsonargparse.typing import NonNegativeFloat, PositiveFloat, PositiveInt
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import Tensor

from descentflow.models.base import LatentModel
from descentflow.models.optimizers import adam_with_cosine


class MaskedAffineFlow(LatentModel):
    """Masked affine flows over a standard normal, trained by maximum likelihood.

    ``log p(w) = log N(z; 0, I) + log |det dz/dw|`` with z the weights sent through all flows. The paper's sizes:
    5 flows, each with one hidden layer of ``2 d`` units (Papamakarios et al. 2017, arXiv 1705.07057).

    As shipped, normflows evaluates this density one dimension at a time and its scale never exceeds 1.001.
    ``Reverse`` makes the density one pass (and sampling sequential), and an LU-decomposed linear map between
    flows (arXiv 1906.04032) gives the scale back.

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

    def build(self, dimension: int) -> None:
        """Flows that start at the identity's neighbourhood."""
        flows: list[nf.flows.Flow] = []
        for _ in range(self.n_flows):
            affine = nf.flows.MaskedAffineAutoregressive(
                dimension, self.hidden_per_weight * dimension, num_blocks=1, use_residual_blocks=False
            )
            flows += [nf.flows.Reverse(affine), nf.flows.LULinearPermute(dimension)]
        self.flow = nf.NormalizingFlow(nf.distributions.DiagGaussian(dimension, trainable=False), flows)

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d)."""
        log_prob: Tensor = self.flow.log_prob(weights.to(torch.float32))
        return log_prob

    def draw(self, n: int) -> Tensor:
        """Draw (n, d); a draw that is not finite is left for the sampler to count."""
        draws: Tensor = self.flow.sample(n)[0]
        return draws.to(torch.float64)

    def training_step(self, batch: tuple[Tensor, ...], batch_index: int) -> Tensor:
        """Negative log-likelihood of a batch."""
        loss = self.nll(batch)
        self.log("train/nll", loss, on_epoch=True, on_step=False, batch_size=len(batch[0]))
        return loss

    def configure_optimizers(self) -> OptimizerLRSchedulerConfig:
        """AdamW with a cosine that ends with the last epoch."""
        return adam_with_cosine(self, self.learning_rate, self.weight_decay)
