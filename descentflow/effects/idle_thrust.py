"""Another idle thrust, at every altitude by the same factor."""

from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.effects.scale_group import THRUST_DRAG_WEIGHT

NONE_LEFT = -1.0
"""Change by which there is no thrust: engines that pull backwards are no idle thrust, and rates that would need it have
another cause. An estimate at this bound is refused."""


class IdleThrust(Effect):
    """Relative change; only its ratio to the other two of mass, idle thrust and drag shows in what is observed.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = IdleThrust().shift(example_flights(), torch.tensor([0.5]))
        >>> round(float(shift["rate"].mean()), 2)  # half as much idle thrust again: ln of the rate
        -0.02
    """

    name = "idle_thrust"
    of_coefficients = True
    description = "more or less thrust at idle"
    directions = ("more thrust at idle", "less thrust at idle")
    scale_group = THRUST_DRAG_WEIGHT
    parameters = (
        Parameter(
            "relative_change",
            NONE_LEFT,
            3.0,
            "1",
            0.3,
            label="relative change of the idle thrust",
            shown_as="change",
            symbol="idle thrust",
        ),
    )

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation."""
        return {"rate": log_rate(state, thrust=1 + theta[0]) - state.own_log_rate}
