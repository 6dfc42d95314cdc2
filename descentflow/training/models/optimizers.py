"""Optimisers: none but in name, of closed forms, or Adam with a cosine schedule."""

from dataclasses import dataclass
from math import cos, pi

import torch
from jsonargparse.typing import NonNegativeFloat, PositiveInt
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import nn

from descentflow.core.arguments import checked_settings
from descentflow.core.errors import ConfigError
from descentflow.training.datamodule import data_of


@checked_settings
@dataclass(frozen=True)
class FlowSteps:
    """Training of a flow.

    Attributes:
        weight_decay: Of AdamW.
        shrinkage: Added to that, divided by the number of training flights: the fewer there are, the harder a whitened
            flow is pulled towards its Gaussian.
        caution: Standard errors by which an epoch must beat the Gaussian on the validation flights.
        n_draws: Weights drawn of each flight, given what it shows, in each epoch.
        max_steps: Steps of the optimiser at most, so that many flights take fewer epochs: training ends with the last
            whole epoch in them, if that comes before ``trainer.max_epochs``.

    Example:
        >>> FlowSteps(shrinkage=600.0).max_steps
        3000
    """

    weight_decay: NonNegativeFloat = 1e-5
    shrinkage: NonNegativeFloat = 300.0
    caution: NonNegativeFloat = 1.0
    n_draws: PositiveInt = 8
    max_steps: PositiveInt | None = 3000


def no_steps(module: LightningModule) -> torch.optim.Optimizer:
    """An optimizer that moves nothing, for parameters that are set in closed form.

    Lightning advances ``global_step``, on which its checkpoints depend, only when an optimizer steps; a model
    without one would never be saved.

    Example:
        >>> optimizer = no_steps(nn.Linear(2, 1))
        >>> optimizer.step(), optimizer.defaults["lr"]
        (None, 0.0)
    """
    return torch.optim.SGD(module.parameters(), lr=0.0)


UNDECAYED = ("bias", "unconstrained_upper_diag")
"""Parameters that are not zero where a flow is the identity, or that only shift: weight decay leaves them alone."""


def adam_with_cosine(
    module: LightningModule,
    learning_rate: float,
    weight_decay: float = 0.0,
    *,
    still_first: bool = False,
    max_steps: int | None = None,
) -> OptimizerLRSchedulerConfig:
    """AdamW whose learning rate falls to zero by a cosine that ends with the last epoch.

    Args:
        module: What is trained.
        learning_rate: At the start.
        weight_decay: Of all parameters but :data:`UNDECAYED`.
        still_first: Train nothing in the first epoch (unless it is the only one), so that the start is validated too.
        max_steps: The last epoch is the last whole one in so many steps, if that comes before ``trainer.max_epochs``.

    Raises:
        ConfigError: If no epoch is the last: the cosine would end at once, and the fit never.

    Example:
        >>> from lightning.pytorch import Trainer
        >>> module = LightningModule()
        >>> module.layer, module.trainer = nn.Linear(2, 1), Trainer(max_epochs=10, accelerator="cpu", logger=False)
        >>> groups = adam_with_cosine(module, 1e-3, weight_decay=0.1)["optimizer"].param_groups
        >>> [group["weight_decay"] for group in groups]  # of the weights, and of the bias
        [0.1, 0.0]
    """
    groups: dict[bool, list[nn.Parameter]] = {True: [], False: []}
    for name, parameter in module.named_parameters():
        groups[not name.endswith(UNDECAYED)].append(parameter)
    decayed = {True: weight_decay, False: 0.0}
    # Fused: of a flow's fifty small parameters, one after the other would take as long as the gradients.
    optimizer = torch.optim.AdamW(
        [{"params": groups[key], "weight_decay": decayed[key]} for key in groups if groups[key]],
        lr=learning_rate,
        fused=True,
    )
    epochs = _whole_epochs(module.trainer, max_steps)
    still = still_first and epochs > 1

    def rate(epoch: int) -> float:
        if still and epoch == 0:
            return 0.0
        return 0.5 * (1 + cos(pi * min((epoch - still) / (epochs - still), 1.0)))

    return {"optimizer": optimizer, "lr_scheduler": torch.optim.lr_scheduler.LambdaLR(optimizer, rate)}


def _whole_epochs(trainer: Trainer, max_steps: int | None) -> int:
    """Epochs of a trainer, which end with the last whole one in so many steps: a part of one is not validated.

    Not Lightning's ``max_steps``, with which a resumed fit goes through its first epoch without validation.
    """
    if max_steps is not None:
        most = max(max_steps // len(data_of(trainer).train_dataloader()), 1)
        asked = trainer.max_epochs
        trainer.fit_loop.max_epochs = most if asked is None or asked < 0 else min(asked, most)
    elif trainer.max_epochs is None or trainer.max_epochs < 0:
        raise ConfigError(
            "a fit without a last epoch (max_epochs -1), with which its learning rate ends",
            expected="a number of epochs",
            mend="pass --trainer.max_epochs 150 (Trainer(max_epochs=150)), with early stopping too",
        )
    return max(trainer.max_epochs or 1, 1)
