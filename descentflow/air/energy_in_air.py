r"""The energy equation in an air: drag of what was observed there, and flights flown there.

With :math:`T = T_0 + \Delta T` (:math:`T_0`: standard air), :math:`\tau = T_0 / T` and the wind w along the track,

.. math:: \frac{dH_p}{dt} = \tau \frac{(F - D) V}{m g (1 + G)}, \qquad G = \frac{V}{g} \frac{d(V + w)}{dh}.

At a given Mach number V goes as :math:`\sqrt T`, and G is that of standard air plus

.. math:: \Delta = \frac{\kappa R M^2}{2 g} \left(\tau \frac{dT}{dH_p} - \frac{dT_0}{dH_p}\right)
          + \frac{V}{g} \tau \frac{dw}{dH_p},

whatever the speed does, so that standard air's G need not be known: it follows from the rate and the drag there.
"""

from typing import NamedTuple

from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.constants import G0_MPS2
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.atmosphere import isa_fraction, temperature_k
from descentflow.physics.energy import lapse_share, wind_share
from descentflow.physics.performance_model import PerformanceModel


class InAir(NamedTuple):
    """Effect of an air at a CAS, (n, L) each; the first four in standard air and then in the air."""

    standard_tas_mps: Tensor
    tas_mps: Tensor
    standard_thrust_n: Tensor
    thrust_n: Tensor
    metres_of_pressure: Tensor
    """Metres of pressure altitude in one geometric metre."""
    more_share: Tensor
    """Increase of G."""


def in_air(aircraft: PerformanceModel, cas_mps: Tensor, altitude_m: Tensor, air: LevelAir) -> InAir:
    """Compute the effect of an air on flights at a CAS.

    Args:
        aircraft: Coefficients.
        cas_mps: (n, L).
        altitude_m: (L,) pressure altitudes.
        air: Of the n flights, or one for all, on these levels.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> import torch
        >>> levels_fl = torch.arange(150.0, 161.0).double()
        >>> still, cas_mps = LevelAir.uniform(levels_fl), torch.full((1, 11), 140.0).double()
        >>> float(in_air(aircraft("A320"), cas_mps, levels_fl * 30.48, still).more_share[0, 0])
        0.0
    """
    deviation, (warming, blowing) = air.deviation_k.to(cas_mps), air.slopes(altitude_m)
    mach = cas_to_mach(cas_mps, altitude_m)
    standard, tas = mach_to_tas_mps(mach, altitude_m), mach_to_tas_mps(mach, altitude_m, deviation)
    # A temperature that changes with height changes the speed at a Mach number: V / (2 T) for each K.
    by_temperature = tas / (2 * temperature_k(altitude_m, deviation)) * warming.to(cas_mps)
    growth = blowing.to(cas_mps) + by_temperature
    more = lapse_share(mach, altitude_m, deviation) - lapse_share(mach, altitude_m, 0.0 * deviation)
    return InAir(
        standard,
        tas,
        aircraft.idle_thrust_n(altitude_m, standard),
        aircraft.idle_thrust_n(altitude_m, tas, deviation),
        isa_fraction(altitude_m, deviation),
        more + wind_share(mach, altitude_m, deviation, growth),
    )


def drag_in_air(
    aircraft: PerformanceModel,
    cas_mps: Tensor,
    rate_mps: Tensor,
    standard_drag_n: Tensor,
    altitude_m: Tensor,
    air: LevelAir,
) -> Tensor:
    r"""Drag (n, L) that explains rates in the air in which they were flown.

    .. math:: D = F - \left(F_0 - D_0\right) \frac{V_0}{\tau V} - \frac{m g \Delta}{\tau V} \frac{dH_p}{dt}

    Args:
        aircraft: Coefficients; its reference mass is the mass.
        cas_mps: (n, L) calibrated airspeed.
        rate_mps: (n, L) rate of pressure altitude as observed, negative in descent.
        standard_drag_n: (n, L) drag that the same rates mean in standard air, :math:`D_0`.
        altitude_m: (L,) pressure altitudes.
        air: Of the flights.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import drag_at_idle_n
        >>> import torch
        >>> levels_fl = torch.arange(150.0, 161.0).double()
        >>> cas, rate = torch.full((1, 11), 140.0).double(), torch.full((1, 11), -10.0).double()
        >>> a320, altitude_m = aircraft("A320"), levels_fl * 30.48
        >>> standard = drag_at_idle_n(a320, cas, rate, altitude_m)
        >>> warm = LevelAir.uniform(levels_fl, deviation_k=10.0)
        >>> drag = drag_in_air(a320, cas, rate, standard, altitude_m, warm)
        >>> bool(torch.isclose(drag, drag_at_idle_n(a320, cas, rate, altitude_m, deviation_k=10.0)).all())
        True
    """
    terms = in_air(aircraft, cas_mps, altitude_m, air)
    through = terms.metres_of_pressure * terms.tas_mps
    excess = (terms.standard_thrust_n - standard_drag_n) * terms.standard_tas_mps
    weight = aircraft.mass_reference_kg * G0_MPS2
    return terms.thrust_n - (excess + weight * terms.more_share * rate_mps) / through


def rate_in_air(aircraft: PerformanceModel, rate_mps: Tensor, drag_n: Tensor, terms: InAir) -> Tensor:
    """Rate (n, L) in an air of flights whose drag and rate in standard air are known, the inverse of `drag_in_air`.

    Args:
        aircraft: Coefficients; its reference mass is the mass.
        rate_mps: (n, L) rate of pressure altitude in standard air.
        drag_n: (n, L).
        terms: From :func:`in_air`.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> import torch
        >>> levels_fl, a320 = torch.arange(150.0, 161.0).double(), aircraft("A320")
        >>> cas, rate = torch.full((1, 11), 140.0).double(), torch.full((1, 11), -10.0).double()
        >>> warm = in_air(a320, cas, levels_fl * 30.48, LevelAir.uniform(levels_fl, deviation_k=10.0))
        >>> rate_in_air(a320, rate, torch.full((1, 11), 38e3).double(), warm)[0, 0].round(decimals=2)
        tensor(-9.8000, dtype=torch.float64)
    """
    excess = (terms.standard_thrust_n - drag_n) * terms.standard_tas_mps
    through = terms.metres_of_pressure * terms.tas_mps * (terms.thrust_n - drag_n)
    return rate_mps * through / (excess + aircraft.mass_reference_kg * G0_MPS2 * terms.more_share * rate_mps)
