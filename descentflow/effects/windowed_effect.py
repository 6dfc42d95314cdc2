"""Effects within a window of altitude: what they change band by band, and how much of a band lies in a window."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.effects.effect import Effect
from descentflow.effects.flight_state import FlightState


class WindowedEffect(Effect):
    """An effect between two flight levels: of its parameters one is its size and two are the ends of its window.

    What it changes in a band is the product of two things: what a flight that has it in the whole band shows
    (:meth:`whole_change`), and the share of the band within the window (:meth:`below` of the upper end, minus that of
    the lower). So all windows at once are sums over the bands, and the search for one needs no fit of each.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.effects._example_flights import example_flights
        >>> brakes, state = EFFECTS["speed_brake"], example_flights()
        >>> ends = brakes.below(state, torch.tensor([200.0, 240.0]).double())["rate"]
        >>> (ends[1] - ends[0])[:6]  # bands of 2,000 ft, the third of which is about FL200
        tensor([0.0000, 0.0000, 0.5000, 1.0000, 0.5000, 0.0000], dtype=torch.float64)
    """

    ends: ClassVar[tuple[int, int]]
    """Positions of the lower and the upper end among the parameters; the size is the first of them."""
    inset_fl: ClassVar[float] = 0.0
    """Height at either end over which it begins and ends; half of it counts as without."""
    grid_fl: float = 5.0
    """Step of the levels at which windows of single flights end."""

    @abstractmethod
    def whole_change(self, state: FlightState, size: Tensor) -> Tensor:
        """Change (n, K) of the logarithm of the rate where a flight has the effect of that size in a whole band."""

    def below(self, state: FlightState, level_fl: Tensor) -> Mapping[str, Tensor]:
        """Share (E, K) of each band below flight levels (E,), by quantity that shows the change.

        A report shows the rate of some seconds before, and so of a greater height: an end of the window shows further
        down in it than in the altitude over time, and between the two reported rate and altitude over time disagree.
        """
        if state.report_delay_s == 0.0:
            return {"rate": state.share_below(level_fl * FL_M)}
        flown = state.share_below(level_fl * FL_M)
        bottom = state.altitude_m - state.width_m / 2 + state.reported_below_m
        reported = ((level_fl[:, None] * FL_M - bottom) / state.width_m).clamp(0.0, 1.0)
        return {"rate": reported, "lag": reported - flown}

    def within(self, state: FlightState, low_fl: Tensor, high_fl: Tensor) -> dict[str, Tensor]:
        """Weight (K,) of each band in a window, by quantity; differentiable in both ends."""
        inset = self.inset_fl / 2
        low_end = low_fl + inset
        high_end = torch.maximum(high_fl - inset, low_end)
        low, high = (self.below(state, end.reshape(1)) for end in (low_end, high_end))
        return {quantity: (high[quantity] - low[quantity])[0] for quantity in high}

    def longest_fl(self, state: FlightState) -> float:
        """Height of the highest window: half of the grid, for more of it would be no window."""
        low, high = self.range_fl(state)
        return (high - low) / 2

    def range_fl(self, state: FlightState) -> tuple[float, float]:
        """Lowest and highest level of the grid."""
        half = state.width_m / 2
        return float(state.altitude_m[0] - half) / FL_M, float(state.altitude_m[-1] + half) / FL_M
