"""Descents flown along a geometric path: the rate follows groundspeed and no longer thrust and drag."""

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState
from descentflow.physics.airspeed import cas_to_tas_mps

LEAST_SHALLOWER = 0.005
"""Paths are planned to be flown with some thrust in hand."""


class GeometricPath(Effect):
    """A share of the flights holds a path angle; idle thrust must not be needed below it, so it is a shallow one.

    Example:
        >>> from descentflow.effects.example_flights import example_flights
        >>> shift = GeometricPath().shift(example_flights(), torch.tensor([0.5, 0.1]))
        >>> bool((shift["rate"] < 0).all())  # a shallower path than idle thrust allows
        True
    """

    name = "geometric_path"
    says = "a fixed path over the ground instead of an idle descent"
    parameters = (
        Parameter("share", 0.0, 1.0, "1", 0.1, label="share of the flights on a path", shown_as="flights"),
        Parameter("shallower", 0.0, 0.25, "1", 0.05, 0.1, label="shallower than the idle path by", shown_as="percent"),
    )
    heterogeneity = "window mixture"
    splits = ("groundspeed",)

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """All flights may hold one; a path at the very angle that idle allows is a fit driven to its bound."""
        return float(theta[0]) > 0.0 and LEAST_SHALLOWER < float(theta[1]) < self.parameters[1].high - 1e-6

    def mixture(self, theta: Tensor) -> tuple[float, Tensor]:
        """Flights hold it or do not."""
        return float(theta[0]), torch.stack([torch.ones_like(theta[0]), theta[1]])

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """From the idle path's angle to one held, shallower by a share than the shallowest of the idle path."""
        ground = cas_to_tas_mps(state.cas_mps, state.altitude_m) + state.tailwind_mps
        angle = state.schedule_log_rate - ground.clamp(min=30.0).log()
        shallowest = torch.where(state.mask, angle, torch.inf).amin(1, keepdim=True)
        return {"rate": theta[0] * (shallowest.clamp(max=1e3) - angle - theta[1])}
