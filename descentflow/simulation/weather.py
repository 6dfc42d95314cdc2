"""Weather that changes with height: layers of wind and temperature, and a jet stream, alike for all flights of a day.

Layers are waves of many vertical wavelengths, each of the same shear: the variance of the wind in a wave grows with the
square of its length, as it does in the saturated spectrum of gravity waves (Smith, Fritts and VanZandt 1987, J. Atmos.
Sci. 44). A share of their variance is each flight's own, which comes at an hour and from a side of its own. The day's
wind is a vector, of which a flight meets the part along its track; the part across is left out, as everywhere in this
world.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.simulation.injected import FlightRows
from descentflow.simulation.world_config import WorldConfig

Array = NDArray[np.float64]

SPACING_M = 50.0
"""Of the heights at which wind and temperature stand; linear between them."""
HIGHEST_M = 15_000.0
HEIGHT_M = np.arange(0.0, HIGHEST_M + SPACING_M, SPACING_M)
"""Geometric heights (m) at which the weather of a flight is held, and between which it is linear."""
N_WAVES = 8
STREAM, DAY_STREAM = 8, 9
"""Of random numbers of flights and of days: worlds without weather keep every other draw."""
WESTERLY = np.pi / 2
"""Bearing to which the prevailing wind blows."""
VEER = np.pi / 4
"""Standard deviation of the day's jet about it."""


@dataclass(frozen=True)
class Weather(FlightRows):
    """Air of each flight.

    Example:
        >>> ten = torch.full((1,), 1025.0, dtype=torch.float64)
        >>> wind = torch.arange(301.0, dtype=torch.float64)[None] / 10
        >>> air = Weather(wind, torch.zeros_like(wind), track_rad=torch.zeros(1))
        >>> air.wind_mps(ten), air.wind_slope_per_s(ten)
        (tensor([2.0500], dtype=torch.float64), tensor([0.0020], dtype=torch.float64))
    """

    tailwind_mps: Tensor
    """(n, heights) at :data:`HEIGHT_M`, geometric; no heights where the air is that of the flight's parameters."""
    warmer_k: Tensor
    """(n, heights) of the temperature from the flight's mean deviation, at pressure altitudes of the same numbers."""
    track_rad: Tensor
    """(n,) track over ground."""

    def wind_mps(self, height_m: Tensor) -> Tensor:
        """Tailwind at geometric altitudes (n,)."""
        return _at(self.tailwind_mps, height_m)[0]

    def wind_slope_per_s(self, height_m: Tensor) -> Tensor:
        """Its growth with height there, (n,)."""
        return _at(self.tailwind_mps, height_m)[1]

    def deviation_k(self, altitude_m: Tensor) -> Tensor:
        """Temperature beyond the flight's mean deviation at pressure altitudes (n,)."""
        return _at(self.warmer_k, altitude_m)[0]

    def mean_deviation_k(self, altitude_m: Tensor) -> Tensor:
        """Its mean below pressure altitudes (n,): that by which the column of air is higher."""
        heights = torch.from_numpy(HEIGHT_M)[: self.warmer_k.shape[1]]
        below = heights <= altitude_m[:, None]
        return torch.where(below, self.warmer_k, 0.0).sum(1) / below.sum(1).clamp(min=1)


def _at(table: Tensor, height_m: Tensor) -> tuple[Tensor, Tensor]:
    """Values at heights, and their slopes."""
    if not table.shape[1]:
        return torch.zeros_like(height_m), torch.zeros_like(height_m)
    place = (height_m / SPACING_M).clamp(0.0, table.shape[1] - 1.001)
    below = place.long()
    low, high = table.gather(1, below[:, None])[:, 0], table.gather(1, below[:, None] + 1)[:, 0]
    return low + (place - below) * (high - low), (high - low) / SPACING_M


def draw_weather(numbers: Sequence[int], days: Sequence[int], seed: int, config: WorldConfig) -> Weather:
    """Draw the weather of flights: a day's is that of the seed and the day alone.

    Args:
        numbers: Numbers of the flights in the world.
        days: Day of each.
        seed: Seed of the world.
        config: Shear, jet stream and temperature.

    Returns:
        The weather.

    Example:
        >>> windy = WorldConfig(shear_spread_per_s=0.004)
        >>> draw_weather(range(2), [3, 3], 0, windy).tailwind_mps.shape
        torch.Size([2, 301])
    """
    still = not (config.shear_spread_per_s or config.jet_mps[1])
    if not numbers or (still and not (config.layer_spread_k or config.daily_spread_k)):
        none = torch.empty(len(numbers), 0, dtype=torch.float64)
        return Weather(none, none, none)
    known = {day: _day(np.random.default_rng((seed, day, DAY_STREAM)), config) for day in dict.fromkeys(days)}
    flights = [
        _flight(np.random.default_rng((seed, k, STREAM)), known[d], config) for k, d in zip(numbers, days, strict=True)
    ]
    return Weather(*(torch.from_numpy(np.stack(values)) for values in zip(*flights, strict=True)))


def _day(generator: np.random.Generator, config: WorldConfig) -> Array:
    """Wind to the east and to the north, and temperature, of a day: (3, heights)."""
    share = (1 - config.layers_own_share) ** 0.5
    east, north, warm = share * _layers(generator, config)
    bearing = WESTERLY + VEER * generator.standard_normal()
    core = FL_M * generator.uniform(*config.jet_fl)
    jet = generator.uniform(*config.jet_mps) * np.exp(-(((HEIGHT_M - core) / config.jet_depth_m) ** 2))
    warm = warm + config.daily_spread_k * generator.standard_normal()
    return np.stack([east + jet * np.sin(bearing), north + jet * np.cos(bearing), warm])


def _flight(generator: np.random.Generator, day: Array, config: WorldConfig) -> tuple[Array, Array, Array]:
    """Tailwind and temperature that a flight meets, and its track."""
    track = generator.uniform(0, 2 * np.pi)
    east, north, warm = day + config.layers_own_share**0.5 * _layers(generator, config)
    return east * np.sin(track) + north * np.cos(track), warm, np.array(track)


def _layers(generator: np.random.Generator, config: WorldConfig) -> Array:
    """Layers of wind to the east, to the north and of temperature: (3, heights)."""
    length = np.geomspace(*config.layer_m, N_WAVES)
    phase = 2 * np.pi * HEIGHT_M[:, None] / length
    wind = config.shear_spread_per_s * length / (2 * np.pi * N_WAVES**0.5)
    warm = config.layer_spread_k * length / np.sqrt(np.square(length).sum())
    amplitude = np.stack([wind, wind, warm])
    cosine, sine = generator.standard_normal((2, 3, N_WAVES)) * amplitude
    waves: Array = cosine @ np.cos(phase).T + sine @ np.sin(phase).T
    return waves
