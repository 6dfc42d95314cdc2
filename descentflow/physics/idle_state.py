"""State of an aircraft that descends at idle, by CAS and pressure altitude: used by inference and by decoding alike."""

from typing import NamedTuple

from torch import Tensor

from descentflow.core.tensors import Number
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.energy import energy_share_factor
from descentflow.physics.performance_model import PerformanceModel


class IdleState(NamedTuple):
    """Mach, true airspeed, idle thrust and energy share factor, each broadcast to the batch; see :func:`idle_state`.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> mach, tas_mps, thrust_n, share = idle_state(aircraft("A320"), torch.tensor([150.0]), torch.tensor([6000.0]))
        >>> round(float(thrust_n) / 1000, 1), round(float(share), 2)  # kN; part of the excess power that changes height
        (1.4, 0.83)
    """

    mach: Tensor
    tas_mps: Tensor
    thrust_n: Tensor
    energy_share: Tensor


def idle_state(
    aircraft: PerformanceModel,
    cas_mps: Tensor,
    altitude_m: Tensor,
    deviation_k: Number = 0.0,
) -> IdleState:
    """State of a clean descent at idle (paper, section 2.1: BADA's formulae unchanged but for drag and CAS).

    Above the type's transition altitude the energy share factor is BADA's for constant Mach, below it the one
    for constant CAS (BADA 3 user manual, section 3.2), whatever the CAS does between levels.

    Args:
        aircraft: Coefficients.
        cas_mps: (..., L) calibrated airspeed.
        altitude_m: (L,) pressure altitude.
        deviation_k: ISA temperature deviation.

    Returns:
        Each (..., L).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> state = idle_state(open_aircraft("A320"), torch.tensor([150.0]), torch.tensor([6000.0]))
        >>> round(state.mach.item(), 2), round(state.tas_mps.item())
        (0.63, 199)
    """
    mach = cas_to_mach(cas_mps, altitude_m)
    tas_mps = mach_to_tas_mps(mach, altitude_m, deviation_k)
    share = energy_share_factor(mach, altitude_m, aircraft.holds_mach(altitude_m), deviation_k)
    return IdleState(mach, tas_mps, aircraft.idle_thrust_n(altitude_m, tas_mps, deviation_k), share)
