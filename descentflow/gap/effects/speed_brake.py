"""Drag added within a window of altitude: speed brakes, or a restriction that makes crews use them."""

import torch
from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState, log_rate
from descentflow.units import FL_M

LENGTHS_FL = (20.0, 40.0, 70.0)
"""Lengths of the windows from which a fit starts."""


class SpeedBrake(Effect):
    """CD0 higher by a factor between two altitudes; the mean over the flights that do it and those that do not."""

    name = "speed_brake"
    parameters = (
        Parameter("extra_cd0", 0.0, 2.0, "1", 0.1, 0.0),
        Parameter("low_fl", 0.0, 600.0, "FL", 10.0),
        Parameter("high_fl", 0.0, 600.0, "FL", 10.0),
    )
    law = "window mixture"
    says = "speed brakes (or as much drag) are out within a band of altitude"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation within the window."""
        within = state.share_between(theta[1] * FL_M, theta[2] * FL_M)
        return {"rate": within * (log_rate(state, parasitic=1 + theta[0]) - log_rate(state))}

    def starts(self, state: FlightState) -> list[Tensor]:
        """Windows of several lengths that tile the grid; none covers more than half of it (that would be a polar)."""
        low = float(state.altitude_m[0] - state.width_m / 2) / FL_M
        high = float(state.altitude_m[-1] + state.width_m / 2) / FL_M
        found = []
        for length in LENGTHS_FL:
            if length > (high - low) / 2:
                continue
            count = max(int(2 * (high - low) / length) - 1, 1)
            for bottom in torch.linspace(low, high - length, count).tolist():
                found.append(torch.tensor([0.0, bottom, bottom + length], dtype=torch.float64))
        return found
