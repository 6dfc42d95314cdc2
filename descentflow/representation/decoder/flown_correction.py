"""Protocol of changes to descents after they were flown."""

from typing import Any, Protocol

from descentflow.core.counter_random import DrawNumbers
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories


class FlownCorrection(Protocol):
    """A change of descents after they were flown, for instance by the effects that a diagnosis found.

    Example:
        >>> from dataclasses import replace
        >>> import torch
        >>> class Slower:
        ...     def apply(self, aircraft, flown, draws):
        ...         return replace(flown, time_s=1.1 * flown.time_s)
        ...     def to_state(self):
        ...         return {"kind": "slower"}
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder, weights = model.representation.decoder, model.sample(3, seed=0)
        >>> before = decoder(weights).time_s
        >>> decoder.correction = Slower()
        >>> torch.equal(decoder(weights).time_s, 1.1 * before)
        True
    """

    def apply(self, aircraft: PerformanceModel, flown: Trajectories, draws: DrawNumbers) -> Trajectories:
        """The corrected descents; ``draws`` numbers them, for effects that only a share of the flights has."""

    def to_state(self) -> dict[str, Any]:
        """Primitives for a checkpoint."""
