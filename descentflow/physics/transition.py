"""The altitude where a descent hands over from constant Mach to constant CAS."""

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.tensors import as_tensors
from descentflow.core.units import KT_MPS
from descentflow.physics.airspeed import crossover_altitude_m


def transition_altitude_m(aircraft: Aircraft) -> Tensor:
    """Crossover of the type's standard descent CAS and Mach number (manual 3.1-27, 3.1-28 and 4.3).

    Args:
        aircraft: Coefficients of the type; ``des_cas_high_kt`` and ``des_mach`` are used.

    Returns:
        Pressure altitude in metres; ``+inf`` where the type has no Mach schedule (``des_mach`` 0): it has no crossover.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(transition_altitude_m(open_aircraft("A320")) > 8000)
        True
    """
    cas_kt, mach = as_tensors(aircraft.des_cas_high_kt, aircraft.des_mach)
    has_mach = mach > 0
    altitude = crossover_altitude_m(cas_kt * KT_MPS, torch.where(has_mach, mach, 1.0))
    return torch.where(has_mach, altitude, torch.inf)
