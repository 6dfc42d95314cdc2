"""Level-offs, holds and step-downs: cut out of the free descent, they leave gaps in which time passes."""

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState


class LevelOff(Effect):
    """More (or longer) level segments than the simulator's flights had, as mean time in them for each flight.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = LevelOff().shift(example_flights(), torch.tensor([20.0, 0.3]))
        >>> float(shift["level"].mean())  # s for each flight
        20.0
    """

    name = "level_off"
    description = "more level-offs or longer ones"
    directions = ("more time in level-offs", "less time in level-offs")
    parameters = (
        Parameter("time_level_s", -120.0, 600.0, "s per flight", 10.0, label="time in level-offs"),
        Parameter("gaps", -1.0, 5.0, "1", 0.1, label="level-offs per flight"),
    )

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Time spent in short gaps of altitude, and their number."""
        time_level_s, gaps = theta
        each = torch.ones_like(state.cas_mps[:, 0])
        return {"level": time_level_s * each, "level_gaps": gaps * each}
