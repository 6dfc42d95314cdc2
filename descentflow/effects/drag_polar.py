"""Another parasitic drag (CD0) of the clean aircraft."""

from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.effects.scale_group import THRUST_DRAG_WEIGHT


class DragPolar(Effect):
    """Relative change; only its ratio to the other two of mass, idle thrust and drag shows in what is observed."""

    name = "drag_polar"
    says = "more or less drag of the airframe"
    directions = ("more drag of the airframe", "less drag of the airframe")
    scale_group = THRUST_DRAG_WEIGHT
    parameters = (Parameter("relative_change", -0.5, 1.0, "1", 0.05, label="relative change of the parasitic drag"),)
    heterogeneity = "gaussian"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation."""
        return {"rate": log_rate(state, parasitic=1 + theta[0]) - state.own_log_rate}
