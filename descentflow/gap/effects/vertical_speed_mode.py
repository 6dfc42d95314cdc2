"""Descents flown at a selected vertical rate: the rate no longer follows speed and altitude."""

import torch
from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState


class VerticalSpeedMode(Effect):
    """A share of the descent (or of the flights) keeps the rate constant; cleaning cuts the clearest stretches out."""

    name = "vertical_speed_mode"
    parameters = (
        Parameter("share", 0.0, 1.0, "1", 0.1),
        Parameter("levels_cut_out", 0.0, 1.0, "1", 0.05),
        Parameter("slower_in_gaps", 0.0, 300.0, "s", 10.0),
    )
    law = "gaussian"
    says = "a constant vertical rate is selected instead of an idle descent"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """What the rate loses of its own shape; gaps in the levels, and time lost in them."""
        each = torch.ones_like(state.cas_mps[:, 0])
        return {
            "rate": -theta[0] * state.centred(state.schedule_log_rate),
            "missing": theta[1] * each,
            "slow": theta[2] * each,
        }
