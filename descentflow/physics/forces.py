"""Thrust and drag of BADA 3 in descent (user manual, sections 3.6.1 and 3.7)."""

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.bada3.global_parameters import STANDARD, GlobalParameters
from descentflow.core.constants import G0_MPS2
from descentflow.core.tensors import Number, as_tensors, broadcast
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.altitude_limits import is_above
from descentflow.physics.atmosphere import density_kg_m3
from descentflow.physics.configuration import Configuration, by_configuration, has_full_polar

MAX_TEMPERATURE_LOSS = 0.4
"""Largest share of the climb thrust that heat may take (3.7-6)."""


def max_climb_thrust_n(aircraft: Aircraft, altitude_m: Number, tas_mps: Number, deviation_k: Number = 0.0) -> Tensor:
    """Maximum climb thrust of the whole aircraft (manual 3.7-1 to 3.7-7).

    With Hp in ft and V in kt: jets ``CT1 (1 - Hp/CT2 + CT3 Hp^2)``, turboprops ``CT1/V (1 - Hp/CT2) + CT3``, pistons
    ``CT1 (1 - Hp/CT2) + CT3/V``; times ``1 - CT5 (dT - CT4)``, where the loss lies between 0 and 0.4 and CT5 is at
    least 0.

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.
        tas_mps: True airspeed; without effect for jets, positive for the others.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Thrust in newtons, the shape to which all arguments and coefficients broadcast.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(max_climb_thrust_n(open_aircraft("A320"), 0.0, 150.0) > 100e3)
        True
    """
    altitude, tas, deviation = as_tensors(altitude_m, tas_mps, deviation_k)
    altitude_ft = altitude / FT_M
    ct1, ct2, ct3 = aircraft.ct1, aircraft.ct2, aircraft.ct3
    if aircraft.engine == "jet":
        thrust = ct1 * (1 - altitude_ft / ct2 + ct3 * altitude_ft * altitude_ft)
        if tas.shape != thrust.shape:
            thrust, _ = broadcast(thrust, tas)
    elif aircraft.engine == "turboprop":
        thrust = ct1 / (tas / KT_MPS) * (1 - altitude_ft / ct2) + ct3
    else:
        thrust = ct1 * (1 - altitude_ft / ct2) + ct3 / (tas / KT_MPS)
    return thrust * (1 - _temperature_loss(aircraft, deviation))


def _temperature_loss(aircraft: Aircraft, deviation_k: Tensor) -> Tensor:
    """Share of the climb thrust lost to heat (manual 3.7-4 to 3.7-7)."""
    ct4, ct5 = as_tensors(aircraft.ct4, aircraft.ct5)
    return (ct5.clamp(min=0.0) * (deviation_k - ct4)).clamp(0.0, MAX_TEMPERATURE_LOSS)


def descent_thrust_floor_ft(aircraft: Aircraft, limits: GlobalParameters = STANDARD) -> Tensor:
    """Altitude above which high-altitude descent thrust holds (manual 3.7.3).

    H_p,des, raised to H_max,AP where approach and landing polars are given.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(descent_thrust_floor_ft(open_aircraft("A320")) >= 0)
        True
    """
    (printed,) = as_tensors(aircraft.altitude_des_ft)
    return torch.where(has_full_polar(aircraft), printed.clamp(min=limits.approach_ceiling_ft), printed)


def descent_thrust_n(
    aircraft: Aircraft,
    altitude_m: Number,
    tas_mps: Number,
    deviation_k: Number = 0.0,
    configuration: Configuration = "CR",
    limits: GlobalParameters = STANDARD,
) -> Tensor:
    """Idle thrust in descent, a fraction of the maximum climb thrust (manual 3.7-9 to 3.7-12).

    ``CTdes,high`` above H_p,des in any configuration; at and below it ``CTdes,low``, ``CTdes,app`` or ``CTdes,ld``.
    The fractions may be zero or negative (windmilling drag), as printed. The step at H_p,des is BADA's own.

    Args:
        aircraft: Coefficients of the type.
        altitude_m: Pressure altitude.
        tas_mps: True airspeed.
        deviation_k: Temperature deviation from ISA.
        configuration: ``CR``, ``AP``, ``LD`` or an integer tensor, see :mod:`descentflow.physics.configuration`.
        limits: Global parameters (the ceiling of the approach configuration is used).

    Returns:
        Thrust in newtons, the shape to which all arguments and coefficients broadcast.

    Raises:
        AircraftError: If the configuration has no descent thrust.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> descent_thrust_n(open_aircraft("A320"), torch.linspace(3e3, 1e4, 5), 200.0).shape
        torch.Size([5])
    """
    altitude, tas, deviation, high, low, approach, landing = as_tensors(
        altitude_m,
        tas_mps,
        deviation_k,
        aircraft.ct_des_high,
        aircraft.ct_des_low,
        aircraft.ct_des_app,
        aircraft.ct_des_ld,
    )
    is_high = is_above(altitude, descent_thrust_floor_ft(aircraft, limits) * FT_M)
    fraction = torch.where(is_high, high, by_configuration(configuration, low, approach, landing))
    return fraction * max_climb_thrust_n(aircraft, altitude, tas, deviation)


def drag_n(
    aircraft: Aircraft,
    tas_mps: Number,
    altitude_m: Number,
    deviation_k: Number = 0.0,
    mass_kg: Number | None = None,
    configuration: Configuration = "CR",
    load_factor: Number = 1.0,
) -> Tensor:
    """Drag on the parabolic polar, with lift equal to weight (manual 3.6-1 to 3.6-5).

    ``D = rho V^2 S / 2 (CD0 + CD2 CL^2)`` with ``CL = 2 n m g0 / (rho V^2 S)``. A configuration without a polar of
    its own (CD0 and CD2 zero) has the clean one; the gear counts in landing configuration. An expedited descent
    multiplies the result by
    :attr:`~descentflow.aircraft_types.bada3.global_parameters.GlobalParameters.expedited_drag_factor`.

    Args:
        aircraft: Coefficients of the type.
        tas_mps: True airspeed, positive.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.
        mass_kg: Mass; the type's reference mass when None.
        configuration: ``CR``, ``AP``, ``LD`` or an integer tensor, see :mod:`descentflow.physics.configuration`.
        load_factor: n, one over the cosine of the bank angle.

    Returns:
        Drag in newtons, the shape to which all arguments and coefficients broadcast.

    Raises:
        AircraftError: If the configuration does not exist.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(drag_n(open_aircraft("A320"), 200.0, 6000.0, mass_kg=60e3) > 20e3)
        True
    """
    tas, altitude, deviation = as_tensors(tas_mps, altitude_m, deviation_k)
    mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg
    pressed_area = 0.5 * density_kg_m3(altitude, deviation) * tas * tas * aircraft.wing_area_m2
    cd0, cd2 = polar(aircraft, configuration, pressed_area)
    lift_coefficient = load_factor * mass * G0_MPS2 / pressed_area
    return pressed_area * (cd0 + cd2 * lift_coefficient * lift_coefficient)


def polar(aircraft: Aircraft, configuration: Configuration = "CR", like: Number = 0.0) -> tuple[Tensor, Tensor]:
    """CD0 (gear included) and CD2 of a configuration (manual 3.6-2 to 3.6-4), in the precision of ``like``.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> [bool(c > 0) for c in polar(open_aircraft("A320"))]
        [True, True]
    """
    if isinstance(configuration, str) and configuration == "CR":
        _, cd0, cd2 = as_tensors(like, aircraft.cd0_cr, aircraft.cd2_cr)
        return cd0, cd2
    _, zero_cr, two_cr, zero_ap, two_ap, zero_ld, two_ld, gear = as_tensors(
        like,
        aircraft.cd0_cr,
        aircraft.cd2_cr,
        aircraft.cd0_ap,
        aircraft.cd2_ap,
        aircraft.cd0_ld,
        aircraft.cd2_ld,
        aircraft.cd0_gear,
    )
    no_ap = (zero_ap == 0) & (two_ap == 0)
    no_ld = (zero_ld == 0) & (two_ld == 0)
    cd0 = by_configuration(
        configuration, zero_cr, torch.where(no_ap, zero_cr, zero_ap), torch.where(no_ld, zero_cr, zero_ld + gear)
    )
    cd2 = by_configuration(
        configuration, two_cr, torch.where(no_ap, two_cr, two_ap), torch.where(no_ld, two_cr, two_ld)
    )
    return cd0, cd2
