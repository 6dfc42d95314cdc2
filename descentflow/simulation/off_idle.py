"""Stretches flown above or below the idle path: thrust kept to stretch the descent, speed brakes to regain the path.

A flight management system plans the path with a forecast wind and sets thrust or asks for brakes where the real one
takes the flight off it; crews do the same when they are cleared down early or late, and for anti-ice.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.simulation.injected import inside
from descentflow.simulation.world_config import WorldConfig

STREAM = 11
"""Of random numbers: worlds without such stretches keep every other draw."""
MOST = 2
"""Stretches of either kind of a flight."""
_DRAWS = 4


@dataclass(frozen=True)
class OffIdle:
    """Stretches of each flight, all of shape (n, stretches).

    Example:
        >>> ends = torch.tensor([[8000.0]]), torch.tensor([[7000.0]])
        >>> brakes = OffIdle(torch.tensor([[0.0]]), torch.tensor([[0.5]]), *ends)
        >>> brakes.drag_gain(torch.tensor([7500.0])), brakes.drag_gain(torch.tensor([6000.0]))
        (tensor([1.5000]), tensor([1.]))
    """

    thrust_share: Tensor
    """Thrust above idle, in units of drag minus idle thrust; 0 for none."""
    brake_gain: Tensor
    """Share by which brakes raise CD0; 0 for none."""
    high_m: Tensor
    """Pressure altitudes between which it lasts."""
    low_m: Tensor

    def rows(self, index: Tensor) -> "OffIdle":
        """Return the flights of an index tensor."""
        return OffIdle(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def power(self, altitude_m: Tensor) -> Tensor:
        """Thrust above idle at pressure altitudes (n,), in units of drag minus idle thrust."""
        return self._largest(self.thrust_share, altitude_m)

    def drag_gain(self, altitude_m: Tensor) -> Tensor:
        """Factor of CD0 at pressure altitudes (n,)."""
        return 1 + self._largest(self.brake_gain, altitude_m)

    def _largest(self, values: Tensor, altitude_m: Tensor) -> Tensor:
        return (values * inside(altitude_m[:, None], self.low_m, self.high_m)).amax(1)


def draw_off_idle(
    numbers: Sequence[int], seed: int, config: WorldConfig, top_m: Tensor, bottom_m: Tensor
) -> OffIdle | None:
    """Draw the stretches of flights from a stream of random numbers of their own.

    Args:
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        config: Shares of flights, sizes and heights.
        top_m: (n,) top of descent.
        bottom_m: (n,) its end.

    Returns:
        The stretches, first those with thrust, then those with brakes; None if the world has none.

    Example:
        >>> top_m, bottom_m = torch.full((3,), 11_000.0), torch.full((3,), 4_000.0)
        >>> draw_off_idle(range(3), 0, WorldConfig(brakes_share=1.0), top_m, bottom_m).brake_gain.shape
        torch.Size([3, 4])
        >>> draw_off_idle(range(3), 0, WorldConfig(), top_m, bottom_m) is None
        True
    """
    if not (config.thrust_share or config.brakes_share) or not numbers:
        return None
    rows = [np.random.default_rng((seed, k, STREAM)).random((2 * MOST, _DRAWS)) for k in numbers]
    has, size, level, depth = torch.from_numpy(np.stack(rows)).unbind(2)
    thrust = torch.where(has < config.thrust_share, _ranged(config.thrust_of_needed, size), 0.0)
    brakes = torch.where(has < config.brakes_share, _ranged(config.brake_gain, size), 0.0)
    kind = torch.arange(2 * MOST) < MOST
    high = bottom_m[:, None] + (top_m - bottom_m)[:, None] * level
    low = high - _ranged(config.off_idle_fl, depth) * FL_M
    return OffIdle(torch.where(kind, thrust, 0.0), torch.where(kind, 0.0, brakes), high, low)


def _ranged(limits: tuple[float, float], share: Tensor) -> Tensor:
    return limits[0] + (limits[1] - limits[0]) * share
