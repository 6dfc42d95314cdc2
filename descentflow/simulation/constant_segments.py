"""Constant vertical rates from the top of descent: slow first stretches, and turboprops' two constant rates.

A stretch ends at a pressure altitude, not after a time, and the next begins there; below the last one the flight goes
on at idle. Rates keep clear of the multiples of 100 ft/min that a vertical-speed selector knows: the paper's cleaning
left such stretches in its data, and `prepare` drops constant rates that were selected.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.core.units import FL_M, FPM_MPS
from descentflow.simulation.world_config import WorldConfig

STREAM = 5
"""Of random numbers: worlds without constant rates keep every other draw."""
CLEAR_FPM = 30.0
"""Least distance of a constant rate from a multiple of 100 ft/min."""


@dataclass(frozen=True)
class ConstantRates:
    """Two stretches of each flight, from above, both of shape (n, 2); NaN where there is none.

    Example:
        >>> segments = ConstantRates(torch.tensor([[-4.0, torch.nan]]), torch.tensor([[9000.0, torch.nan]]))
        >>> segments.rate_at_mps(torch.tensor([10_000.0])), segments.rate_at_mps(torch.tensor([8_000.0]))
        (tensor([-4.]), tensor([nan]))
    """

    rate_mps: Tensor
    """Rate of pressure altitude, negative."""
    low_m: Tensor
    """Pressure altitude at which the stretch ends; below that of the stretch before it."""

    def rows(self, index: Tensor) -> "ConstantRates":
        """Return the flights of an index tensor."""
        return ConstantRates(self.rate_mps[index], self.low_m[index])

    def rate_at_mps(self, altitude_m: Tensor) -> Tensor:
        """Vertical rate (m/s) flown at a pressure altitude (m), both of shape (n,); NaN outside the segments."""
        inside = altitude_m[:, None] > self.low_m
        first, second = self.rate_mps[:, 0], self.rate_mps[:, 1]
        return torch.where(inside[:, 0], first, torch.where(inside[:, 1], second, torch.nan))


def draw_constant_rates(
    numbers: Sequence[int], seed: int, config: WorldConfig, top_m: Tensor, bottom_m: Tensor
) -> ConstantRates | None:
    """Draw the constant-rate segments of flights from a stream of random numbers of their own.

    Args:
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        config: Shares of flights and ranges.
        top_m: (n,) pressure altitude of the cruise.
        bottom_m: (n,) end of the descent.

    Returns:
        Stretches; None if the world has no such flights.

    Example:
        >>> top_m, bottom_m = torch.full((3,), 11_000.0), torch.full((3,), 2_700.0)
        >>> draw_constant_rates(range(3), 0, WorldConfig(two_rates_share=1.0), top_m, bottom_m).rate_mps.shape
        torch.Size([3, 2])
        >>> draw_constant_rates(range(3), 0, WorldConfig(), top_m, bottom_m) is None
        True
    """
    if not (config.slow_start_share or config.two_rates_share) or not numbers:
        return None
    uniform = torch.from_numpy(np.stack([np.random.default_rng((seed, k, STREAM)).random(8) for k in numbers]))
    two = uniform[:, 0] < config.two_rates_share
    slow = ~two & (uniform[:, 1] < config.slow_start_share)
    height = top_m - bottom_m
    missing = torch.full_like(top_m, torch.nan)
    # A slow start leaves room for idle descent below it.
    slow_low = top_m - torch.minimum(_ranged(config.slow_start_fl, uniform[:, 2]) * FL_M, 0.6 * height)
    switch = _ranged(config.switch_fl, uniform[:, 3]) * FL_M
    first = torch.where(two, _rate_mps(config.first_rate_fpm, uniform[:, 4], uniform[:, 5]), missing)
    first = torch.where(slow, _rate_mps(config.slow_start_fpm, uniform[:, 4], uniform[:, 5]), first)
    second = torch.where(two, _rate_mps(config.second_rate_fpm, uniform[:, 6], uniform[:, 7]), missing)
    low = torch.where(two, switch, torch.where(slow, slow_low, missing))
    last = torch.where(two, bottom_m, missing)
    return ConstantRates(torch.stack([first, second], 1), torch.stack([low, last], 1))


def _ranged(limits: tuple[float, float], share: Tensor) -> Tensor:
    return limits[0] + (limits[1] - limits[0]) * share


def _rate_mps(limits_fpm: tuple[float, float], share: Tensor, within: Tensor) -> Tensor:
    """A rate of descent clear of the multiples of 100 ft/min, in the hundred that the range's draw lies in."""
    hundreds = (_ranged(limits_fpm, share) / 100).floor()
    return -(100 * hundreds + CLEAR_FPM + (100 - 2 * CLEAR_FPM) * within) * FPM_MPS
