"""Vertical rate reported late: smoothing in the transponder's sources."""

from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState


class VerticalRateLag(Effect):
    """The rate reported is that of some seconds ago, when the aircraft was higher."""

    name = "vertical_rate_lag"
    parameters = (Parameter("lag_s", -10.0, 60.0, "s", 2.0),)
    needs = ("vertical_rate",)
    sensor = True
    says = "vertical rates are reported late"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Reported rate, also against the altitude differenced over time."""
        late = theta[0] * state.schedule_log_rate.exp() * state.schedule_slope_per_m
        return {"rate": late, "lag": late}
