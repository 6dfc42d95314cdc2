"""Changes of the planned speed on the way down: controllers' speed instructions, a revised cost index, turbulence.

A change is a share of the planned CAS (and, above the crossover, of the Mach number) that is taken up over a stretch of
height and kept from there on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from torch import Tensor

from descentflow.core.units import FL_M, FT_M, KT_MPS
from descentflow.simulation.world_config import WorldConfig

STREAM = 10
"""Of random numbers: worlds without changes of speed keep every other draw."""
MOST = 2
"""Changes of a flight."""
SLOWEST = 0.8
"""No change leads below this share of the planned speed: some 1.3 times the stall speed of a clean jet at 250 kt."""
FASTEST_GAIN_KT_PER_KFT = 10.0
"""Speed is gained no faster: at 250 m/s, 12 kt of TAS in 1,000 ft make an idle descent twice as steep."""
_DRAWS = 5


@dataclass(frozen=True)
class SpeedChanges:
    """Changes of each flight, all of shape (n, :data:`MOST`); 0 for none.

    Example:
        >>> slower = SpeedChanges(torch.tensor([[-0.1]]), torch.tensor([[8000.0]]), torch.tensor([[7000.0]]))
        >>> [slower.factor(torch.tensor([altitude_m])) for altitude_m in (9000.0, 7500.0, 6000.0)]
        [tensor([1.]), tensor([0.9500]), tensor([0.9000])]
    """

    share: Tensor
    """Change in units of the planned CAS, negative for a slow-down."""
    high_m: Tensor
    """Pressure altitude where it begins."""
    low_m: Tensor
    """Pressure altitude where it is complete."""

    def rows(self, index: Tensor) -> "SpeedChanges":
        """Return the flights of an index tensor."""
        return SpeedChanges(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def factor(self, altitude_m: Tensor) -> Tensor:
        """Speed wanted at pressure altitudes (n,) in units of the planned one."""
        done = ((self.high_m - altitude_m[:, None]) / (self.high_m - self.low_m)).clamp(0.0, 1.0)
        return (1 + (self.share * done).sum(1)).clamp(min=SLOWEST)


def draw_speed_changes(
    numbers: Sequence[int], seed: int, config: WorldConfig, cas_mps: Tensor, top_m: Tensor
) -> SpeedChanges | None:
    """Draw the changes of speed of flights from a stream of random numbers of their own.

    Args:
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        config: Share of flights, sizes and levels.
        cas_mps: (n,) planned CAS.
        top_m: (n,) top of descent; no change begins above it.

    Returns:
        The changes; None if the world has none.

    Example:
        >>> cas_mps, top_m = torch.full((3,), 140.0), torch.full((3,), 11_000.0)
        >>> draw_speed_changes(range(3), 0, WorldConfig(speed_change_share=1.0), cas_mps, top_m).share.abs() > 0
        tensor([[True, True],
                [True, True],
                [True, True]])
        >>> draw_speed_changes(range(3), 0, WorldConfig(), cas_mps, top_m) is None
        True
    """
    if not config.speed_change_share or not numbers:
        return None
    rows = [np.random.default_rng((seed, k, STREAM)).random((MOST, _DRAWS)) for k in numbers]
    has, faster, size, level, slope = torch.from_numpy(np.stack(rows)).unbind(2)
    change_mps = _ranged(config.speed_change_kt, size) * KT_MPS
    high = _ranged(config.speed_change_fl, level) * FL_M
    faster = faster < config.faster_share
    kt_per_kft = _ranged(config.speed_change_kt_per_kft, slope)
    kt_per_kft = torch.where(faster, kt_per_kft.clamp(max=FASTEST_GAIN_KT_PER_KFT), kt_per_kft)
    depth = change_mps / (kt_per_kft * KT_MPS) * 1000 * FT_M
    taken = (has < config.speed_change_share) & (high < top_m[:, None])
    signed = torch.where(faster, change_mps, -change_mps)
    return SpeedChanges(torch.where(taken, signed / cas_mps[:, None], 0.0), high, high - depth)


def _ranged(limits: tuple[float, float], share: Tensor) -> Tensor:
    return limits[0] + (limits[1] - limits[0]) * share
