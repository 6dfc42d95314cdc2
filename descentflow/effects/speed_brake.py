"""Drag added within a window of altitude: speed brakes, or a restriction that makes crews use them."""

import torch
from torch import Tensor

from descentflow.core.units import FL_M
from descentflow.effects.effect import Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.effects.windowed_effect import WindowedEffect

NARROWEST_FL = 25.0
"""Brakes that are out over less than 2,500 ft are no procedure, and look like the change from Mach to CAS."""
ANSWERS_FL = 0.6
"""An aircraft takes some seconds to answer to brakes that run out or in."""
LEAST_DRAG = 0.1
"""Share of CD0 below which nothing is out: small drag over a wide band is something else, of no fixed altitude."""
RUN_OUT_M = 90.0
"""Height over which brakes run out and in: some 8 s of descent. Half of it at either end counts as without."""
FROM_TOP_FL = 5.0
"""A window that is open to the top is a matter of how descents begin."""
MIN_FLIGHTS = 20
"""Flights from which a share is learnt."""
APART = 2.0
"""Two groups are told apart if their means are so many spreads within them apart; else all flights are one."""


class SpeedBrake(WindowedEffect):
    """CD0 higher between two altitudes on a share of the flights; ``extra_cd0`` is the mean over all flights.

    Example:
        >>> from descentflow.effects.example_flights import example_flights
        >>> shift = SpeedBrake().shift(example_flights(), torch.tensor([0.3, 200.0, 240.0, 1.0, 0.0]))
        >>> (shift["rate"].mean(0) > 0.01).nonzero()[:, 0]  # bands of 2,000 ft from FL150
        tensor([2, 3, 4])
        >>> share, whole = SpeedBrake().mixture(torch.tensor([0.3, 200.0, 240.0, 0.6, 0.0]))
        >>> round(share, 1), round(float(whole[0]), 1)  # six flights in ten, each with half as much drag again
        (0.6, 0.5)
    """

    name = "speed_brake"
    says = "speed brakes, or as much drag, within a band of altitude"
    inherited_from = 0.1
    ends = (1, 2)
    narrowest_fl = NARROWEST_FL
    inset_fl = RUN_OUT_M / FL_M
    parameters = (
        Parameter(
            "extra_cd0",
            0.0,
            2.0,
            "1",
            0.1,
            0.0,
            label="parasitic drag added, mean over all flights",
            shown_as="change",
            symbol="CD0",
        ),
        Parameter("low_fl", 0.0, 600.0, "FL", 10.0, inexact=ANSWERS_FL, label="lower end"),
        Parameter("high_fl", 0.0, 600.0, "FL", 10.0, inexact=ANSWERS_FL, label="upper end"),
        Parameter(
            "share",
            0.05,
            1.0,
            "1",
            0.1,
            1.0,
            from_heterogeneity=True,
            label="share of the flights with brakes out",
            shown_as="flights",
        ),
        Parameter(
            "ln_ratio_noise",
            0.0,
            1.5,
            "1",
            0.1,
            label="ln of the ratio of short-scale noise",
            shown_as="logarithm",
            symbol="short-scale noise",
        ),
    )
    heterogeneity = "window mixture"

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """Brakes are felt where they are out; their window has a height, ends below the top and is no whole descent."""
        _, high = self.range_fl(state)
        height = float(theta[2] - theta[1])
        felt = float(theta[0] / theta[3]) >= LEAST_DRAG and float(theta[0]) < self.parameters[0].high - 1e-6
        return felt and NARROWEST_FL <= height <= self.longest_fl(state) and float(theta[2]) < high - FROM_TOP_FL

    def whole_change(self, state: FlightState, size: Tensor) -> Tensor:
        """By the energy equation."""
        return log_rate(state, parasitic=1 + size) - state.own_log_rate

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation within the window, on the share that flies it."""
        change = theta[3] * self.whole_change(state, theta[0] / theta[3])
        shown = {quantity: weight * change for quantity, weight in self.within(state, theta[1], theta[2]).items()}
        # Edges of a window are steps of the rate, which count as short-scale noise.
        return {**shown, "noise_rate": theta[4] * torch.ones_like(change[:, 0])}

    def learn_heterogeneity(self, state: FlightState, theta: Tensor, excess: Tensor) -> Tensor:
        """Share of the flights in the upper of two groups of mean excess within the window, minus that outside."""
        lower, upper = state.share_below(theta[1:3] * FL_M)
        within = upper - lower
        inside, outside = excess[:, within > 0.7], excess[:, within == 0]
        if not inside.shape[1] or not outside.shape[1]:
            return theta
        height = inside.nanmean(1) - outside.nanmean(1)
        height = height[height.isfinite()]
        if len(height) < MIN_FLIGHTS:
            return theta
        found = theta.clone()
        found[3] = two_groups(height)
        return found

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        """Flights have them out or do not."""
        share = theta[3]
        full = torch.stack([theta[0] / share, theta[1], theta[2], torch.ones_like(share), theta[4] / share])
        return float(share), full


def two_groups(values: Tensor) -> float:
    """Share of the upper of two groups, split where the spread within them is least; one if they are not apart.

    Example:
        >>> two_groups(torch.tensor([0.0, 0.1, -0.1, 1.0, 1.1]))
        0.4
    """
    ordered = values.sort().values
    n = len(ordered)
    count = torch.arange(1, n, dtype=ordered.dtype)
    total, square = ordered.cumsum(0), ordered.square().cumsum(0)
    low = square[:-1] - total[:-1] ** 2 / count
    high = (square[-1] - square[:-1]) - (total[-1] - total[:-1]) ** 2 / (n - count)
    # A group of a few stragglers is none.
    usable = (count >= 0.08 * n) & (count <= 0.92 * n)
    k = int(torch.where(usable, low + high, torch.inf).argmin())
    apart = (total[-1] - total[k]) / (n - k - 1) - total[k] / (k + 1)
    within = ((low + high)[k].clamp(min=0.0) / n).sqrt()
    return float(n - k - 1) / n if float(apart) > 2 * APART * float(within) else 1.0
