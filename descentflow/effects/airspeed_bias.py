"""A position or instrument error of indicated airspeed: IAS disagrees with Mach number and pressure."""

import torch
from torch import Tensor

from descentflow.core.units import KT_MPS
from descentflow.effects.effect import Effect, FlightChange, Parameter, Shift
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.physics.airspeed import cas_to_mach


class AirspeedBias(Effect):
    """IAS reads too high by a constant and a part that grows with Mach number; the aircraft flies as it did.

    Example:
        >>> from descentflow.effects._example_flights import example_flights
        >>> shift = AirspeedBias().shift(example_flights(), torch.tensor([3.0, 0.0]))
        >>> float(shift["cas"].mean()), float(shift["mismatch"].mean())  # kt
        (3.0, 3.0)
    """

    name = "airspeed_bias"
    description = "biased airspeed reports"
    directions = ("airspeeds that read too high", "airspeeds that read too low")
    against = (
        "airspeeds that read higher than those of the simulator's flights",
        "airspeeds that read lower than those of the simulator's flights",
    )
    inherited_from = 0.7
    parameters = (
        Parameter("bias_kt", -25.0, 25.0, "kt", 1.0, label="bias of IAS at Mach 0.65"),
        Parameter("growth_kt", -40.0, 40.0, "kt per 0.1 of Mach", 1.0, label="growth of the bias with Mach number"),
    )
    needs = ("IAS", "Mach")
    sensor = True

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """IAS, its difference to the CAS of the Mach number, and the rate expected at a wrong speed."""
        # Real flights report the wrong speed, so the true one lies below; a simulator's is the true one.
        sign = -1.0 if state.affected else 1.0
        bias = _bias_kt(theta, state.mach())
        if state.affected:
            bias = _bias_kt(theta, cas_to_mach(state.cas_mps - bias * KT_MPS, state.altitude_m))
        other = log_rate(state, faster_mps=sign * bias * KT_MPS)
        return {"cas": bias, "mismatch": bias, "rate": sign * (state.own_log_rate - other)}

    def measured(self, state: FlightState, shown: Shift) -> Tensor | None:
        """The line of IAS minus the CAS of the Mach number over the Mach number."""
        if "mismatch" not in shown:
            return None
        seen = shown["mismatch"].isfinite()
        if int(seen.sum()) <= len(self.parameters):
            return None
        mach = (state.mach()[seen] - 0.65) / 0.1
        columns = torch.stack([torch.ones_like(mach), mach], 1)
        line: Tensor = torch.linalg.lstsq(columns, shown["mismatch"][seen][:, None]).solution
        return line[:, 0]

    def change(self, state: FlightState, theta: Tensor) -> FlightChange:
        """Reported CAS alone: the rate of the shift is what a wrong speed makes of the residual, the rate is right."""
        return FlightChange(reported={"cas": self.shift(state, theta)["cas"]})


def _bias_kt(theta: Tensor, mach: Tensor) -> Tensor:
    bias_kt, growth_kt = theta.unbind()
    return bias_kt + growth_kt * (mach - 0.65) / 0.1
