"""Changes that a flight plans on its way down: constant rates from the top, other speeds, and stretches off idle.

Constant rates are slow first stretches, and turboprops' two rates. A stretch ends at a pressure altitude, not after a
time, and the next begins there; below the last one the flight goes on at idle. Rates keep clear of the multiples of 100
ft/min that a vertical-speed selector knows: the paper's cleaning left such stretches in its data, and `prepare` drops
constant rates that were selected.

A change of speed is a controller's instruction, a revised cost index, or turbulence: a share of the planned CAS (and,
above the crossover, of the Mach number) that is taken up over a stretch of height and kept from there on.

Off idle, thrust is kept to stretch the descent, or speed brakes regain the path. A flight management system plans the
path with a forecast wind and sets thrust or asks for brakes where the real one takes the flight off it; crews do the
same when they are cleared down early or late, and for anti-ice.

Each kind has a stream of random numbers of its own, so that worlds without it keep every other draw; its tables have no
columns then.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.simulation.injected import FlightRows, inside
from descentflow.simulation.world_config import WorldConfig

RATE_STREAM, SPEED_STREAM, OFF_IDLE_STREAM = 5, 10, 11
"""Of random numbers."""
CLEAR_FPM = 30.0
"""Least distance of a constant rate from a multiple of 100 ft/min."""
MOST_CHANGES = 2
"""Changes of speed of a flight, and stretches with thrust, and with brakes."""
SLOWEST_SHARE = 0.8
"""No change leads below this share of the planned speed: some 1.3 times the stall speed of a clean jet at 250 kt."""
FASTEST_GAIN_KT_PER_KFT = 10.0
"""Speed is gained no faster: at 250 m/s, 12 kt of TAS in 1,000 ft make an idle descent twice as steep."""


@dataclass(frozen=True)
class ConstantRates(FlightRows):
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

    def rate_at_mps(self, altitude_m: Tensor) -> Tensor:
        """Vertical rate (m/s) flown at a pressure altitude (m), both of shape (n,); NaN outside the segments."""
        rate = torch.full_like(altitude_m, torch.nan)
        for k in reversed(range(self.rate_mps.shape[1])):
            rate = torch.where(altitude_m > self.low_m[:, k], self.rate_mps[:, k], rate)
        return rate


@dataclass(frozen=True)
class SpeedChanges(FlightRows):
    """Changes of each flight, all of shape (n, :data:`MOST_CHANGES`); 0 for none.

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

    def factor(self, altitude_m: Tensor) -> Tensor:
        """Speed wanted at pressure altitudes (n,) in units of the planned one."""
        done = ((self.high_m - altitude_m[:, None]) / (self.high_m - self.low_m)).clamp(0.0, 1.0)
        return (1 + (self.share * done).sum(1)).clamp(min=SLOWEST_SHARE)


@dataclass(frozen=True)
class OffIdle(FlightRows):
    """Stretches of each flight, all of shape (n, stretches): first those with thrust, then those with brakes.

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

    def power(self, altitude_m: Tensor) -> Tensor:
        """Thrust above idle at pressure altitudes (n,), in units of drag minus idle thrust."""
        return self._largest(self.thrust_share, altitude_m)

    def drag_gain(self, altitude_m: Tensor) -> Tensor:
        """Factor of CD0 at pressure altitudes (n,)."""
        return 1 + self._largest(self.brake_gain, altitude_m)

    def _largest(self, values: Tensor, altitude_m: Tensor) -> Tensor:
        own = values * inside(altitude_m[:, None], self.low_m, self.high_m)
        return torch.cat([torch.zeros_like(altitude_m)[:, None], own], 1).amax(1)


def draw_constant_rates(
    numbers: Sequence[int], seed: int, config: WorldConfig, top_m: Tensor, bottom_m: Tensor
) -> ConstantRates:
    """Draw the constant-rate segments of flights from a stream of random numbers of their own.

    Args:
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        config: Shares of flights and ranges.
        top_m: (n,) pressure altitude of the cruise.
        bottom_m: (n,) end of the descent.

    Returns:
        The stretches.

    Example:
        >>> top_m, bottom_m = torch.full((3,), 11_000.0), torch.full((3,), 2_700.0)
        >>> draw_constant_rates(range(3), 0, WorldConfig(two_rates_share=1.0), top_m, bottom_m).rate_mps.shape
        torch.Size([3, 2])
    """
    if not (config.slow_start_share or config.two_rates_share):
        return ConstantRates(*_no_columns(numbers, 2))
    uniform = uniform_of(numbers, seed, (RATE_STREAM,), 8)
    two = uniform[:, 0] < config.two_rates_share
    slow = ~two & (uniform[:, 1] < config.slow_start_share)
    height = top_m - bottom_m
    missing = torch.full_like(top_m, torch.nan)
    # A slow start leaves room for idle descent below it.
    slow_low = top_m - torch.minimum(ranged(config.slow_start_fl, uniform[:, 2]) * FL_M, 0.6 * height)
    switch = ranged(config.switch_fl, uniform[:, 3]) * FL_M
    first = torch.where(two, _rate_mps(config.first_rate_fpm, uniform[:, 4], uniform[:, 5]), missing)
    first = torch.where(slow, _rate_mps(config.slow_start_fpm, uniform[:, 4], uniform[:, 5]), first)
    second = torch.where(two, _rate_mps(config.second_rate_fpm, uniform[:, 6], uniform[:, 7]), missing)
    low = torch.where(two, switch, torch.where(slow, slow_low, missing))
    last = torch.where(two, bottom_m, missing)
    return ConstantRates(torch.stack([first, second], 1), torch.stack([low, last], 1))


def draw_speed_changes(
    numbers: Sequence[int], seed: int, config: WorldConfig, cas_mps: Tensor, top_m: Tensor
) -> SpeedChanges:
    """Draw the changes of speed of flights from a stream of random numbers of their own.

    Args:
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        config: Share of flights, sizes and levels.
        cas_mps: (n,) planned CAS.
        top_m: (n,) top of descent; no change begins above it.

    Returns:
        The changes.

    Example:
        >>> cas_mps, top_m = torch.full((3,), 140.0), torch.full((3,), 11_000.0)
        >>> draw_speed_changes(range(3), 0, WorldConfig(speed_change_share=1.0), cas_mps, top_m).share.abs() > 0
        tensor([[True, True],
                [True, True],
                [True, True]])
    """
    if not config.speed_change_share:
        return SpeedChanges(*_no_columns(numbers, 3))
    has, faster, size, level, slope = uniform_of(numbers, seed, (SPEED_STREAM,), MOST_CHANGES, 5).unbind(2)
    change_mps = ranged(config.speed_change_kt, size) * KT_MPS
    high = ranged(config.speed_change_fl, level) * FL_M
    faster = faster < config.faster_share
    kt_per_kft = ranged(config.speed_change_kt_per_kft, slope)
    kt_per_kft = torch.where(faster, kt_per_kft.clamp(max=FASTEST_GAIN_KT_PER_KFT), kt_per_kft)
    depth = change_mps / (kt_per_kft * KT_MPS) * 1000 * FT_M
    taken = (has < config.speed_change_share) & (high < top_m[:, None])
    signed = torch.where(faster, change_mps, -change_mps)
    return SpeedChanges(torch.where(taken, signed / cas_mps[:, None], 0.0), high, high - depth)


def draw_off_idle(numbers: Sequence[int], seed: int, config: WorldConfig, top_m: Tensor, bottom_m: Tensor) -> OffIdle:
    """Draw the stretches of flights from a stream of random numbers of their own.

    Args:
        numbers: Numbers of the flights in the world.
        seed: Seed of the world.
        config: Shares of flights, sizes and heights.
        top_m: (n,) top of descent.
        bottom_m: (n,) its end.

    Returns:
        The stretches.

    Example:
        >>> top_m, bottom_m = torch.full((3,), 11_000.0), torch.full((3,), 4_000.0)
        >>> draw_off_idle(range(3), 0, WorldConfig(brakes_share=1.0), top_m, bottom_m).brake_gain.shape
        torch.Size([3, 4])
    """
    if not (config.thrust_share or config.brakes_share):
        return OffIdle(*_no_columns(numbers, 4))
    has, size, level, depth = uniform_of(numbers, seed, (OFF_IDLE_STREAM,), 2 * MOST_CHANGES, 4).unbind(2)
    thrust = torch.where(has < config.thrust_share, ranged(config.thrust_of_needed, size), 0.0)
    brakes = torch.where(has < config.brakes_share, ranged(config.brake_gain, size), 0.0)
    kind = torch.arange(2 * MOST_CHANGES) < MOST_CHANGES
    high = bottom_m[:, None] + (top_m - bottom_m)[:, None] * level
    low = high - ranged(config.off_idle_fl, depth) * FL_M
    return OffIdle(torch.where(kind, thrust, 0.0), torch.where(kind, 0.0, brakes), high, low)


def uniform_of(numbers: Sequence[int], seed: int, streams: Sequence[int], *shape: int) -> Tensor:
    """Uniform numbers (n, ...) of each flight, day or airframe, of its own number and some streams."""
    drawn = [np.random.default_rng((seed, number, *streams)).random(shape) for number in numbers]
    return torch.from_numpy(np.array(drawn).reshape(-1, *shape))


def _no_columns(numbers: Sequence[int], n: int) -> list[Tensor]:
    return [torch.empty(len(numbers), 0, dtype=torch.float64)] * n


def ranged(limits: tuple[float | Tensor, float | Tensor], share: Tensor) -> Tensor:
    """Numbers between limits, by shares of the way."""
    return limits[0] + (limits[1] - limits[0]) * share


def _rate_mps(limits_fpm: tuple[float, float], share: Tensor, within: Tensor) -> Tensor:
    """A rate of descent clear of the multiples of 100 ft/min, in the hundred that the range's draw lies in."""
    hundreds = (ranged(limits_fpm, share) / 100).floor()
    return -(100 * hundreds + CLEAR_FPM + (100 - 2 * CLEAR_FPM) * within) * FPM_MPS
