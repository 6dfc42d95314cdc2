"""Fuel flow in descent (BADA 3 user manual, section 3.9)."""

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.tensors import Number, as_tensors
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.configuration import Configuration, by_configuration

_KG_MIN = 1 / 60
"""A kilogram a minute in kg/s."""


def minimum_fuel_flow_kg_s(aircraft: Aircraft, altitude_m: Number) -> Tensor:
    """Fuel flow at idle: ``Cf3 (1 - Hp/Cf4)`` in kg/min, for pistons Cf3 (manual 3.9-4, 3.9-8).

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.

    Returns:
        Fuel flow in kg/s, broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(minimum_fuel_flow_kg_s(open_aircraft("A320"), 6000.0) > 0)
        True
    """
    (altitude,) = as_tensors(altitude_m)
    if aircraft.engine == "piston":
        return aircraft.cf3 * _KG_MIN + 0.0 * altitude
    return aircraft.cf3 * (1 - altitude / FT_M / aircraft.cf4) * _KG_MIN


def nominal_fuel_flow_kg_s(aircraft: Aircraft, tas_mps: Number, thrust_n: Number) -> Tensor:
    """Fuel flow for a thrust (manual 3.9-1 to 3.9-3, 3.9-7).

    With V in kt and thrust in kN: jets ``Cf1 (1 + V/Cf2) Thr``, turboprops ``Cf1 (1 - V/Cf2) V/1000 Thr``, pistons
    ``Cf1``, in kg/min.

    Args:
        aircraft: Coefficients of the type.
        tas_mps: True airspeed.
        thrust_n: Thrust of the whole aircraft.

    Returns:
        Fuel flow in kg/s, broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(nominal_fuel_flow_kg_s(open_aircraft("A320"), 200.0, 40e3) > 0.3)
        True
    """
    tas, thrust = as_tensors(tas_mps, thrust_n)
    tas_kt = tas / KT_MPS
    if aircraft.engine == "piston":
        return aircraft.cf1 * _KG_MIN + 0.0 * (tas_kt + thrust)
    if aircraft.engine == "jet":
        specific = aircraft.cf1 * (1 + tas_kt / aircraft.cf2)
    else:
        specific = aircraft.cf1 * (1 - tas_kt / aircraft.cf2) * tas_kt / 1000
    return specific * thrust / 1000 * _KG_MIN


def descent_fuel_flow_kg_s(
    aircraft: Aircraft,
    altitude_m: Number,
    tas_mps: Number,
    thrust_n: Number,
    configuration: Configuration = "CR",
) -> Tensor:
    """Fuel flow in descent: idle when clean, else the larger of nominal and idle (manual 3.9-4, 3.9-5).

    Pistons burn the minimum throughout (3.9-8).

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.
        tas_mps: True airspeed.
        thrust_n: Thrust of the whole aircraft.
        configuration: ``CR``, ``AP``, ``LD`` or an integer tensor of codes.

    Returns:
        Fuel flow in kg/s, broadcast shape.

    Raises:
        AircraftError: If the configuration does not exist.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(descent_fuel_flow_kg_s(open_aircraft("A320"), 6000.0, 200.0, 5e3) > 0)
        True
    """
    idle = minimum_fuel_flow_kg_s(aircraft, altitude_m)
    if aircraft.engine == "piston":
        return idle
    powered = torch.maximum(nominal_fuel_flow_kg_s(aircraft, tas_mps, thrust_n), idle)
    return by_configuration(configuration, idle, powered, powered)
