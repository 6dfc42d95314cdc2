"""Other speeds: the Mach number and the CAS that flights descend at."""

import torch
from torch import Tensor

from descentflow.gap.effects.base import Effect, Parameter, Shift
from descentflow.gap.physics import FlightState
from descentflow.performance.airspeed import mach_to_cas_mps
from descentflow.units import KT_MPS


class SpeedSchedule(Effect):
    """CAS shifted on the constant-CAS leg, Mach shifted on the constant-Mach leg; the rate follows the speed."""

    name = "speed_schedule"
    parameters = (Parameter("cas_kt", -60.0, 60.0, "kt", 5.0), Parameter("mach", -0.06, 0.06, "1", 0.005))
    law = "gaussian"
    needs = ("IAS",)
    says = "crews fly other speeds"

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """CAS by how much each flight holds Mach or CAS at a band."""
        mach = state.mach().detach()
        beside = mach_to_cas_mps(mach, state.altitude_m + 50.0) - mach_to_cas_mps(mach, state.altitude_m - 50.0)
        # One where CAS changes as at constant Mach, zero where it does not change.
        on_mach = (state.cas_slope_per_s / (beside / 100.0)).clamp(0.0, 1.0)
        by_mach = (mach_to_cas_mps(mach + theta[1], state.altitude_m) - state.cas_mps) / KT_MPS
        by_mach = by_mach - ((mach_to_cas_mps(mach, state.altitude_m) - state.cas_mps) / KT_MPS)
        return {"cas": on_mach * by_mach + (1 - on_mach) * theta[0] + torch.zeros_like(state.cas_mps)}
