"""The total-energy equation: rate of descent, its inverse for drag, and the energy share factor (manual, section 3.2).

``(Thr - D) V = m g0 dh/dt + m V dV/dt`` with the kinetic part expressed as a share f of the energy:
``dHp/dt = (T - dT)/T (Thr - D) V / (m g0) f``.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2, KAPPA, LAPSE_K_M, P0_PA, R_AIR
from descentflow.core.tensors import Number, as_tensors
from descentflow.physics.airspeed import CAS_SCALE_MPS, cas_to_mach, mach_to_tas_mps
from descentflow.physics.atmosphere import below_tropopause, isa_fraction, isa_temperature_k, pressure_pa
from descentflow.physics.performance_model import PerformanceModel


def lapse_share(mach: Tensor, altitude_m: Tensor, deviation_k: Tensor) -> Tensor:
    """``(V/g0) dV/dh`` at constant Mach: the speed of sound falls with height up to the tropopause (manual 3.2-9).

    Example:
        >>> mach, still = torch.tensor([0.78, 0.78]), torch.zeros(2)
        >>> lapse_share(mach, torch.tensor([9000.0, 12000.0]), still)  # below and above the tropopause
        tensor([-0.0810, 0.0000])
    """
    slope = KAPPA * R_AIR * LAPSE_K_M / (2 * G0_MPS2)
    below = slope * mach * mach * isa_fraction(altitude_m, deviation_k)
    return torch.where(below_tropopause(altitude_m), below, 0.0)


def compression_share(mach: Tensor) -> Tensor:
    """``(V/g0) dV/dh`` at constant CAS, without the lapse's (manual 3.2-10): ``y - y^(-5/2)``, ``y = 1 + 0.2 M^2``.

    The manual writes ``y^(-1/(kappa-1)) (y^(kappa/(kappa-1)) - 1)``, which is the same without the cancelled power.

    Example:
        >>> compression_share(torch.tensor([0.0, 0.78]))
        tensor([0.0000, 0.3712])
    """
    y = 1 + (KAPPA - 1) / 2 * mach * mach
    return y - y ** (-1 / (KAPPA - 1))


def energy_share_factor(
    mach: Number,
    altitude_m: Number,
    above_transition: Tensor,
    deviation_k: Number = 0.0,
    wind_gradient_per_s: Number = 0.0,
) -> Tensor:
    """Energy share factor of BADA: constant Mach above transition, constant CAS below (manual 3.2-8 to 3.2-11).

    The four cases are one expression, ``1 / (1 + lapse + compression)``: the lapse term holds up to the tropopause,
    the compression term at constant CAS.

    Args:
        mach: Mach number.
        altitude_m: Pressure altitude.
        above_transition: True where the aircraft holds Mach, False where it holds CAS.
        deviation_k: Temperature deviation from ISA.
        wind_gradient_per_s: dw/dHp of the along-track wind, see :func:`energy_share_factor_local`; BADA has none.

    Returns:
        Energy share factor, broadcast shape.

    Example:
        >>> round(energy_share_factor(0.74, 8839.2, torch.tensor(True)).item(), 2)
        1.08
    """
    number, altitude, deviation, slope = as_tensors(mach, altitude_m, deviation_k, wind_gradient_per_s)
    compression = torch.where(above_transition, 0.0, compression_share(number))
    return 1 / (
        1 + lapse_share(number, altitude, deviation) + compression + wind_share(number, altitude, deviation, slope)
    )


def wind_share(mach: Tensor, altitude_m: Tensor, deviation_k: Tensor, gradient_per_s: Tensor) -> Tensor:
    """``(V/g0) dw/dh``: change of the along-track wind, ``dw/dHp (T - dT)/T`` with height; not in the manual's 3.2.

    Example:
        >>> knot_per_1000_ft = torch.tensor(0.514444 / 304.8)
        >>> round(wind_share(torch.tensor(0.78), torch.tensor(9000.0), torch.tensor(0.0), knot_per_1000_ft).item(), 3)
        0.041
    """
    tas = mach_to_tas_mps(mach, altitude_m, deviation_k)
    return tas / G0_MPS2 * isa_fraction(altitude_m, deviation_k) * gradient_per_s


def energy_share_factor_local(
    cas_mps: Number,
    altitude_m: Number,
    cas_gradient_per_s: Number,
    wind_gradient_per_s: Number = 0.0,
    deviation_k: Number = 0.0,
) -> Tensor:
    """Exact energy share factor from the slopes of CAS and wind at one altitude (manual 3.2-1, with 3.2-10).

    ``f = 1 / (1 + (V/g0) (dV/dh + dw/dh))`` with h the geometric altitude. By the chain rule V dV/dh is the
    constant-CAS term of the manual (3.2-10) plus the term of the changing CAS, and ``d/dh = (T - dT)/T d/dHp``. With
    a slope of zero and still air it is BADA's constant-CAS factor; along a line of constant Mach it is BADA's
    constant-Mach factor.

    The wind w is the component along the track, positive from behind, and acts through its change along the path
    (the cosine of the flight-path angle, within 0.5 % of one in a descent, is left out).

    Args:
        cas_mps: Calibrated airspeed.
        altitude_m: Pressure altitude.
        cas_gradient_per_s: dCAS/dHp in (m/s)/m.
        wind_gradient_per_s: dw/dHp in (m/s)/m.
        deviation_k: Temperature deviation from ISA.

    Returns:
        Energy share factor, broadcast shape.

    Example:
        >>> flat = energy_share_factor_local(150.0, 6000.0, 0.0)
        >>> bool(torch.isclose(flat, energy_share_factor(cas_to_mach(150.0, 6000.0), 6000.0, torch.tensor(False))))
        True
    """
    cas, altitude, slope, wind_slope, deviation = as_tensors(
        cas_mps, altitude_m, cas_gradient_per_s, wind_gradient_per_s, deviation_k
    )
    return ShareTerms.of(cas, altitude, slope).factor(wind_slope, deviation)


@dataclass(frozen=True)
class ShareTerms:
    """Terms of the energy share factor of a CAS profile that depend on its speeds alone, in whatever air.

    Attributes:
        altitude_m: Pressure altitude.
        mach: Mach number of the CAS there.
        compression: ``(V/g0) dV/dh`` at constant CAS without the lapse's.
        change: The same of the changing CAS.

    Example:
        >>> cas, altitude, slope = (torch.tensor(x, dtype=torch.float64) for x in (150.0, 6000.0, 0.001))
        >>> terms = ShareTerms.of(cas, altitude, slope)
        >>> none = torch.tensor(0.0).double()
        >>> terms.factor(none, none).item() == energy_share_factor_local(150.0, 6000.0, 0.001).item()
        True
    """

    altitude_m: Tensor
    mach: Tensor
    compression: Tensor
    change: Tensor

    @classmethod
    def of(cls, cas_mps: Tensor, altitude_m: Tensor, cas_gradient_per_s: Tensor) -> "ShareTerms":
        """Those of a CAS and its slope, which broadcast."""
        mach = cas_to_mach(cas_mps, altitude_m)
        change = _cas_change_share(cas_mps, mach, altitude_m) * cas_gradient_per_s
        return cls(altitude_m, mach, compression_share(mach), change)

    def factor(self, wind_gradient_per_s: Tensor, deviation_k: Tensor) -> Tensor:
        """Energy share factor in air of a wind gradient and a temperature deviation."""
        share = lapse_share(self.mach, self.altitude_m, deviation_k) + self.compression
        return 1 / (1 + share + self.change + wind_share(self.mach, self.altitude_m, deviation_k, wind_gradient_per_s))


def _cas_change_share(cas: Tensor, mach: Tensor, altitude: Tensor) -> Tensor:
    """``(T - dT)/T (V/g0) dV/dCAS`` at constant altitude, the weight of dCAS/dHp; the deviation cancels."""
    exponent = 1 / (KAPPA - 1)
    here = 1 + (KAPPA - 1) / 2 * mach * mach
    at_sea_level = 1 + (KAPPA - 1) / 2 * (cas / CAS_SCALE_MPS) ** 2
    stretch = (at_sea_level / here) ** exponent * P0_PA / pressure_pa(altitude)
    return R_AIR * isa_temperature_k(altitude) / G0_MPS2 * stretch * KAPPA * cas / CAS_SCALE_MPS**2


def energy_share_factor_exact(
    cas_mps: Number, altitude_m: Tensor, deviation_k: Number = 0.0, wind_mps: Number | None = None
) -> Tensor:
    """Exact energy share factor of a CAS profile on a level grid, with an optional wind profile (manual 3.2-1).

    See :func:`energy_share_factor_local`; the slopes are second-order differences along the last dimension (one-sided
    at the ends), so only the departure from constant CAS is differenced and a constant-CAS profile is exact.

    Args:
        cas_mps: Calibrated airspeed on the grid, ``(..., n_levels)``.
        altitude_m: Pressure altitude of the grid, ``(n_levels,)``, ascending, at least three levels.
        deviation_k: Temperature deviation from ISA; broadcasts against the CAS.
        wind_mps: Along-track wind on the grid (positive from behind), broadcasts against the CAS; None in still air.

    Returns:
        Energy share factor, broadcast shape.

    Example:
        >>> levels = torch.arange(150, 153) * 30.48
        >>> energy_share_factor_exact(torch.full((2, 3), 150.0), levels).shape
        torch.Size([2, 3])
    """
    cas, altitude, wind, deviation = as_tensors(cas_mps, altitude_m, 0.0 if wind_mps is None else wind_mps, deviation_k)
    cas_slope = slope_per_m(cas + 0.0 * altitude, altitude)
    wind_slope = slope_per_m(wind, altitude) if wind.dim() else wind * 0.0
    return energy_share_factor_local(cas, altitude, cas_slope, wind_slope, deviation)


def slope_per_m(values: Tensor, altitude_m: Tensor) -> Tensor:
    """Slope of profiles (..., L) against the altitude (L,), of second order, one-sided at the ends.

    Example:
        >>> altitude_m = torch.tensor([0.0, 1.0, 2.0, 3.0])
        >>> slope_per_m(altitude_m**2, altitude_m)
        tensor([0., 2., 4., 6.])
    """
    step = altitude_m.diff()
    # In one expression of secants: torch.gradient cannot be traced for any number of profiles.
    secant = values.diff(dim=-1) / step
    inner = (step[1:] * secant[..., :-1] + step[:-1] * secant[..., 1:]) / (step[1:] + step[:-1])
    first = secant[..., :1] + (secant[..., :1] - secant[..., 1:2]) * (step[0] / (step[0] + step[1]))
    last = secant[..., -1:] + (secant[..., -1:] - secant[..., -2:-1]) * (step[-1] / (step[-1] + step[-2]))
    return torch.cat([first, inner, last], -1)


def descent_rate_mps(
    aircraft: PerformanceModel,
    drag_n: Number,
    thrust_n: Number,
    tas_mps: Number,
    esf: Number,
    altitude_m: Number,
    deviation_k: Number = 0.0,
    mass_kg: Number | None = None,
) -> Tensor:
    """Rate of change of pressure altitude, dHp/dt, negative in descent (manual 3.2-7; paper, equation 2).

    Args:
        aircraft: Its model; only the reference mass is used, and only where ``mass_kg`` is None.
        drag_n: Drag.
        thrust_n: Thrust.
        tas_mps: True airspeed.
        esf: Energy share factor.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.
        mass_kg: Mass; the type's reference mass when None.

    Returns:
        Rate in m/s, the shape to which all arguments broadcast.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> rate = descent_rate_mps(open_aircraft("A320"), 40e3, 5e3, 200.0, 0.85, 6000.0, mass_kg=60e3)
        >>> round(rate.item(), 2)
        -10.11
    """
    drag, thrust, tas = as_tensors(drag_n, thrust_n, tas_mps)
    return (thrust - drag) * _rate_per_newton(aircraft, tas, esf, altitude_m, deviation_k, mass_kg)


def inferred_drag_n(
    aircraft: PerformanceModel,
    rate_mps: Number,
    thrust_n: Number,
    tas_mps: Number,
    esf: Number,
    altitude_m: Number,
    deviation_k: Number = 0.0,
    mass_kg: Number | None = None,
) -> Tensor:
    """Drag that explains an observed rate, the inverse of :func:`descent_rate_mps` (manual 3.2-7; paper, equation 3).

    ``D = Thr - T/(T - dT) m g0 (dHp/dt) / (V f)``

    Args:
        aircraft: Its model; only the reference mass is used, and only where ``mass_kg`` is None.
        rate_mps: Observed dHp/dt, negative in descent.
        thrust_n: Thrust.
        tas_mps: True airspeed, positive.
        esf: Energy share factor, positive.
        altitude_m: Pressure altitude.
        deviation_k: Temperature deviation from ISA.
        mass_kg: Mass; the type's reference mass when None.

    Returns:
        Drag in newtons, the shape to which all arguments broadcast.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> drag = inferred_drag_n(open_aircraft("A320"), -10.0, 5e3, 200.0, 0.85, 6000.0, mass_kg=60e3)
        >>> round(drag.item())
        39612
    """
    rate, thrust, tas = as_tensors(rate_mps, thrust_n, tas_mps)
    return thrust - rate / _rate_per_newton(aircraft, tas, esf, altitude_m, deviation_k, mass_kg)


def _rate_per_newton(
    aircraft: PerformanceModel,
    tas_mps: Tensor,
    esf: Number,
    altitude_m: Number,
    deviation_k: Number,
    mass_kg: Number | None,
) -> Tensor:
    """``(T - dT)/T V f / (m g0)``: dHp/dt for one newton of thrust beyond drag."""
    mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg
    return isa_fraction(altitude_m, deviation_k) * tas_mps * esf / (mass * G0_MPS2)
