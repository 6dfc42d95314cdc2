"""Vertical rate reported late: smoothing in the transponder's sources."""

import torch
from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState

LEAST_LAG_S = 1.5
EDGE_M = 300.0
"""Depth below the top over which a late rate catches up with the descent that it missed the beginning of."""


class VerticalRateLag(Effect):
    """The rate reported is that of some seconds ago: of a greater height, and of level flight just below the top.

    Smoothing, which makes it late, makes it less noisy too.
    """

    name = "vertical_rate_lag"
    inherited_from = 6.0
    parameters = (
        Parameter("lag_s", -10.0, 60.0, "s", 2.0),
        Parameter("missed_at_top", -0.5, 1.0, "1", 0.05),
        Parameter("ln_ratio_noise", -3.0, 0.0, "1", 0.1, -0.01),
    )
    needs = ("vertical_rate",)
    sensor = True
    says = "vertical rates are reported late"

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """Less than the interval between reports is none; and what makes a rate late need not damp its noise."""
        return LEAST_LAG_S < float(theta[0]) < self.parameters[0].high

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Reported rate, also against the altitude differenced over time."""
        # An aircraft takes some 40 s to change from Mach to CAS, so the step of the rate is spread over bands.
        slope = state.schedule_slope_per_m
        slope = torch.nn.functional.pad(slope[:, None], (1, 1), mode="replicate").unfold(2, 3, 1)[:, 0].mean(-1)
        late = theta[0] * state.schedule_log_rate.exp() * slope
        late = late - theta[1] * torch.exp(-state.depth_m / EDGE_M)
        return {"rate": late, "lag": late, "noise_rate": theta[2] * torch.ones_like(late[:, 0])}
