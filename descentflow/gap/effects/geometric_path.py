"""Descents flown along a geometric path: the rate follows groundspeed and no longer thrust and drag."""

from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState
from descentflow.performance.airspeed import cas_to_tas_mps


class GeometricPath(Effect):
    """A share of the descent (or of the flights) keeps rate over groundspeed constant."""

    name = "geometric_path"
    parameters = (Parameter("share", 0.0, 1.0, "1", 0.1),)
    law = "gaussian"
    needs = ()
    splits = ("groundspeed",)
    says = "a fixed path over the ground is flown instead of an idle descent"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """What the rate loses of its own shape, and gains of that of the groundspeed."""
        ground = cas_to_tas_mps(state.cas_mps, state.altitude_m) + state.tailwind_mps
        return {"rate": theta[0] * state.centred(ground.clamp(min=30.0).log() - state.schedule_log_rate)}
