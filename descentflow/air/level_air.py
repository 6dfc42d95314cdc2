"""Temperature deviation and wind along the track of flights, on flight levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.physics.energy import slope_per_m


@dataclass(frozen=True)
class LevelAir:
    """Air of n flights on L ascending levels, float64.

    Attributes:
        deviation_k: (n, L) temperature minus that of the standard atmosphere, K.
        tailwind_mps: (n, L) wind along the track, positive from behind; only its growth with height enters the energy
            equation.

    Example:
        >>> warm = LevelAir.uniform(torch.arange(150, 351), deviation_k=10.0)
        >>> warm.deviation_k.shape, float(warm.tailwind_mps.abs().max())
        (torch.Size([1, 201]), 0.0)
    """

    deviation_k: Tensor
    tailwind_mps: Tensor

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.deviation_k)

    @classmethod
    def uniform(cls, levels_fl: Tensor, deviation_k: float = 0.0) -> "LevelAir":
        """One air with the same deviation at every level, and no wind."""
        still = torch.zeros(1, len(levels_fl), dtype=torch.float64)
        return cls(still + deviation_k, still)

    def rows(self, index: Sequence[int] | Tensor) -> "LevelAir":
        """The airs at these positions."""
        chosen = torch.as_tensor(index, dtype=torch.long)
        return LevelAir(self.deviation_k[chosen], self.tailwind_mps[chosen])

    def levels(self, low: int, high: int) -> "LevelAir":
        """The same airs on the levels from position ``low`` up to and without ``high``."""
        return LevelAir(self.deviation_k[:, low:high], self.tailwind_mps[:, low:high])

    def slopes(self, altitude_m: Tensor) -> tuple[Tensor, Tensor]:
        """Derivatives (n, L) of both by pressure altitude (L,): K per m, and m/s per m."""
        return slope_per_m(self.deviation_k, altitude_m), slope_per_m(self.tailwind_mps, altitude_m)
