"""A tailwind that changes with altitude: its change is an acceleration that the simulator does not know."""

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate


class WindGradient(Effect):
    """Growth of the along-track tailwind with altitude (positive: more tailwind higher up).

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = WindGradient().shift(example_flights(), torch.tensor([0.002]))
        >>> round(float(shift["rate"].mean()), 2)  # 1.2 kt more tailwind for each 1,000 ft: ln of the rate
        -0.04
    """

    name = "wind_gradient"
    description = "an along-track wind that changes with altitude"
    directions = ("a tailwind that grows with altitude", "a tailwind that falls with altitude")
    against = (
        "a tailwind that grows more with altitude than in the simulator's flights",
        "a tailwind that grows less with altitude than in the simulator's flights",
    )
    inherited_from = 0.0005
    of_air = True
    parameters = (
        Parameter(
            "slope_per_s",
            -0.01,
            0.01,
            "m/s per m",
            0.001,
            label="growth of the tailwind with altitude",
            symbol="tailwind",
        ),
    )
    misfit_of_rate = 0.1
    splits = ("groundspeed", "TAS", "track", "heading")

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Rate by the energy equation, and the wind itself about each flight's mean."""
        wind = theta[0] * state.altitude_m + torch.zeros_like(state.cas_mps)
        return {
            "rate": log_rate(state, wind_slope_per_s=theta[0]) - state.own_log_rate,
            "wind": state.centred(wind),
        }

    def measured(self, state: FlightState, shown: Shift) -> Tensor | None:
        """Slope of the wind along the track within flights, by groundspeed and TAS."""
        if "wind" not in shown:
            return None
        seen = shown["wind"].isfinite()
        height = torch.where(seen, state.altitude_m, torch.nan)
        height = (height - height.nanmean(1, keepdim=True)).nan_to_num(0.0)
        spread = height.square().sum()
        return None if float(spread) == 0.0 else ((shown["wind"].nan_to_num(0.0) * height).sum() / spread)[None]
