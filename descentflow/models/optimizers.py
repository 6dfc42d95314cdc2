"""How parameters are set: by somebody's closed form, or by Adam with a cosine."""

from collections.abc import Callable, Iterable
from typing import Any

import torch
from lightning.pytorch import LightningModule
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import nn


class ClosedForm(torch.optim.Optimizer):
    """Run the closure that sets the parameters, and nothing else.

    Lightning advances ``global_step``, on which its checkpoints depend, only when an optimizer steps; a model
    without one would never be saved.
    """

    def __init__(self, parameters: Iterable[nn.Parameter]) -> None:
        """Register the parameters that the closure sets."""
        super().__init__(parameters, {})

    def step(self, closure: Callable[[], Any] | None = None) -> None:  # type: ignore[override]
        """Set the parameters.

        Args:
            closure: The closed-form update (for instance an M step).
        """
        if closure is not None:
            closure()


def adam_with_cosine(
    module: LightningModule, learning_rate: float, weight_decay: float = 0.0
) -> OptimizerLRSchedulerConfig:
    """AdamW whose learning rate falls to zero by a cosine that ends with ``trainer.max_epochs``."""
    optimizer = torch.optim.AdamW(module.parameters(), lr=learning_rate, weight_decay=weight_decay)
    epochs = max(module.trainer.max_epochs or 1, 1)
    return {"optimizer": optimizer, "lr_scheduler": torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, T_max=epochs)}
