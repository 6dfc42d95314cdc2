"""An optimizer whose step is somebody else's closed form, so that Lightning counts and checkpoints it."""

from collections.abc import Callable, Iterable
from typing import Any

import torch
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
