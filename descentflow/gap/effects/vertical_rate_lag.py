"""Vertical rate reported late: smoothing in the transponder's sources."""

import torch
from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState

LEAST_LAG_S = 1.5


class VerticalRateLag(Effect):
    """The rate reported is that of some seconds ago, of a greater height.

    Just below the top it is that of level flight: those levels are not compared. Smoothing, which makes it late, makes
    it less noisy too.
    """

    name = "vertical_rate_lag"
    inherited_from = 6.0
    parameters = (
        Parameter("lag_s", -10.0, 60.0, "s", 2.0),
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
        return {"rate": late, "lag": late, "noise_rate": theta[1] * torch.ones_like(late[:, 0])}
