"""Another parasitic drag (CD0) of the clean aircraft."""

from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.effects.scale_group import THRUST_DRAG_WEIGHT


class DragPolar(Effect):
    """Relative change; only its ratio to the other two of mass, idle thrust and drag shows in what is observed.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = DragPolar().shift(example_flights(), torch.tensor([0.1]))
        >>> round(float(shift["rate"].mean()), 2)  # a tenth more parasitic drag: ln of the rate
        0.07
    """

    name = "drag_polar"
    of_coefficients = True
    description = "more or less drag of the airframe"
    directions = ("more drag of the airframe", "less drag of the airframe")
    scale_group = THRUST_DRAG_WEIGHT
    parameters = (
        Parameter(
            "relative_change",
            -0.5,
            1.0,
            "1",
            0.05,
            label="relative change of the parasitic drag",
            shown_as="change",
            symbol="CD0",
        ),
    )
    misfit_of_rate = 0.1

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation."""
        return {"rate": log_rate(state, parasitic=1 + theta[0]) - state.own_log_rate}
