"""Descents flown at a selected vertical rate: the rate no longer follows speed and altitude."""

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState

LEAST_CUT_OUT = 0.05
"""Share of the levels that are gone where rates are held on purpose."""


class VerticalSpeedMode(Effect):
    """A rate is held for a while; cleaning cuts the clearest stretches out and leaves gaps, the rest stays.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = VerticalSpeedMode().shift(example_flights(), torch.tensor([0.2, 5.0, 0.04]))
        >>> round(float(shift["missing"].mean()), 3)  # share of the levels that cleaning cuts out
        0.2
    """

    name = "vertical_speed_mode"
    description = "a selected vertical rate instead of an idle descent"
    parameters = (
        Parameter(
            "levels_cut_out",
            -0.2,
            1.0,
            "1",
            0.05,
            label="share of the levels cut out",
            shown_as="percent",
            symbol="levels cut out",
        ),
        Parameter("slower_in_gaps", -60.0, 600.0, "s per flight", 10.0, label="time lost in gaps"),
        Parameter("shallower", 0.0, 0.6, "1", 0.05, label="less rate in the mean of all flights", shown_as="percent"),
    )

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """A held rate leaves gaps where cleaning finds it; without gaps it is something else."""
        return float(theta[0]) > LEAST_CUT_OUT

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Gaps in the levels and time lost in them; what cleaning leaves of held rates is slower, at any level."""
        levels_cut_out, slower_in_gaps, shallower = theta
        rate = -shallower * torch.ones_like(state.cas_mps)
        each = torch.ones_like(rate[:, 0])
        return {"missing": levels_cut_out * each, "slow": slower_in_gaps * each, "rate": rate}
