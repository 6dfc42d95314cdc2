"""Another mean mass of the fleet."""

from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.effects.scale_group import THRUST_DRAG_WEIGHT


class Mass(Effect):
    """Relative change; only its ratio to the other two of mass, idle thrust and drag shows in what is observed.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = Mass().shift(example_flights(), torch.tensor([-0.1]))
        >>> round(float(shift["rate"].mean()), 2)  # a tenth lighter: ln of the rate
        0.05
    """

    name = "mass"
    of_coefficients = True
    description = "heavier or lighter aircraft"
    directions = ("heavier aircraft", "lighter aircraft")
    scale_group = THRUST_DRAG_WEIGHT
    parameters = (
        Parameter(
            "relative_change",
            -0.35,
            0.5,
            "1",
            0.05,
            label="relative change of the mass",
            shown_as="change",
            symbol="mass",
        ),
    )

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation."""
        return {"rate": log_rate(state, mass=1 + theta[0]) - state.own_log_rate}
