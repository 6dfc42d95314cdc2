"""Thrust, fuel and CO2 of a descent as it is flown: the law of samples, predictions, exports and diagnosis."""

from typing import NamedTuple

import torch
from torch import Tensor

from descentflow.core.tensors import Number, as_tensors
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.physics.energy import energy_share_factor_local, inferred_drag_n
from descentflow.physics.performance_model import PerformanceModel

CO2_PER_FUEL = 3.16
"""Mass of CO2 by mass of jet fuel (ICAO, Carbon Emissions Calculator)."""


class Burn(NamedTuple):
    """Thrust of all engines (N) and fuel flow (kg/s), each of the broadcast shape; see :func:`burn`.

    Example:
        >>> thrust_n, flow_kg_s = Burn(torch.tensor(5e3), torch.tensor(0.2))
        >>> round(float(flow_kg_s) * CO2_PER_FUEL, 2)  # kg of CO2 a second
        0.63
    """

    thrust_n: Tensor
    flow_kg_s: Tensor


def burn(
    aircraft: PerformanceModel,
    cas_mps: Number,
    altitude_m: Number,
    rate_mps: Number,
    cas_gradient_per_s: Number = 0.0,
    deviation_k: Number = 0.0,
    mass_kg: Number | None = None,
    acceleration_mps2: Number = 0.0,
) -> Burn:
    """Thrust that a rate asks for, and the fuel that it burns.

    The thrust is that at idle plus what the drag of the clean polar exceeds the drag that the energy equation infers,
    with the kinetic energy of the flight's own CAS; never below idle, for what slows a flight down more is drag.

    Args:
        aircraft: Its model.
        cas_mps: Calibrated airspeed.
        altitude_m: Pressure altitude.
        rate_mps: dHp/dt, negative in descent.
        cas_gradient_per_s: dCAS/dHp.
        deviation_k: Temperature deviation from ISA.
        mass_kg: Mass; the reference mass when None.
        acceleration_mps2: Of the TAS in time, added to that by the slope of the CAS: of level flight, which has none.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> steep, shallow, level = torch.tensor([-12.0, -5.0, 0.0])
        >>> burnt = [burn(aircraft("A320"), 140.0, 6000.0, rate) for rate in (steep, shallow, level)]
        >>> [round(float(one.thrust_n) / 1000) for one in burnt], [round(float(one.flow_kg_s), 2) for one in burnt]
        ([1, 17, 36], [0.16, 0.26, 0.56])
    """
    cas, altitude, rate, slope, deviation = as_tensors(cas_mps, altitude_m, rate_mps, cas_gradient_per_s, deviation_k)
    tas = cas_to_tas_mps(cas, altitude, deviation)
    share = energy_share_factor_local(cas, altitude, slope, 0.0, deviation)
    unpowered = inferred_drag_n(aircraft, rate, 0.0, tas, share, altitude, deviation, mass_kg)
    inertia = (aircraft.mass_reference_kg if mass_kg is None else mass_kg) * acceleration_mps2
    needed = aircraft.drag_n(tas, altitude, deviation, mass_kg) - unpowered + inertia
    idle = aircraft.idle_thrust_n(altitude, tas, deviation)
    thrust = torch.maximum(needed, idle)
    flow = torch.where(
        needed > idle,
        aircraft.fuel_flow_kg_s(altitude, tas, thrust, deviation),
        aircraft.idle_fuel_flow_kg_s(altitude, tas, deviation),
    )
    return Burn(thrust, flow)


def burnt_kg(flow_kg_s: Tensor, time_s: Tensor, mask: Tensor) -> Tensor:
    """Fuel (n, L) burnt since the entry level, by trapezoids in time.

    Args:
        flow_kg_s: (n, L) on ascending levels.
        time_s: (n, L) since the entry, growing downwards.
        mask: (n, L) at and below the entry.

    Example:
        >>> time_s = torch.tensor([[20.0, 10.0, 0.0]])
        >>> burnt_kg(torch.full((1, 3), 0.2), time_s, torch.ones(1, 3, dtype=torch.bool))
        tensor([[4., 2., 0.]])
    """
    legs = torch.where(mask[:, 1:], 0.5 * (flow_kg_s[:, 1:] + flow_kg_s[:, :-1]) * -time_s.diff(dim=1), 0.0)
    return torch.nn.functional.pad(legs.flip(1).cumsum(1).flip(1), (0, 1))
