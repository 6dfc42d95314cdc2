"""Thrust and fuel of BADA 4's engines: jet, turboprop and piston (propulsive forces model, PFM).

Coefficients stand in the order of the files. Thrust is ``delta W_ref C_T`` and fuel flow ``delta^p_delta theta^p_theta
W_ref a_0 C_F / LHV``; BADA 4.2 has the exponents 1 and 1/2.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from math import comb, pi
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor

from descentflow.aircraft_types.bada4.wing import polynomial
from descentflow.aircraft_types.coefficient_group import CoefficientGroup, Numbers, Places
from descentflow.core.constants import A0_MPS, G0_MPS2, KAPPA, P0_PA, R_AIR, T0_K
from descentflow.core.tensors import Number, as_tensors
from descentflow.core.units import FT_M
from descentflow.physics.atmosphere import pressure_pa, speed_of_sound_mps, temperature_k

HORSEPOWER_W = 745.699872
IDLE_THROTTLE = {"4.2": 0.0, "4.3": 0.1}
"""Throttle of a piston engine at idle, by version of BADA 4."""
SERIES_TERMS = 12
"""Of a piston's idle thrust in powers of the speed: relative 1e-6 at 70 kt, 1e-15 in cruise."""


class Air(NamedTuple):
    """Pressure and temperature over those at sea level, deviation from ISA and speed of sound."""

    delta: Tensor
    theta: Tensor
    deviation_k: Tensor
    sound_mps: Tensor

    @property
    def density_kg_m3(self) -> Tensor:
        """By the gas law."""
        return self.delta / self.theta * (P0_PA / (R_AIR * T0_K))

    @classmethod
    def at(cls, altitude_m: Number, deviation_k: Number, like: Number = 0.0) -> "Air":
        """Air at an altitude, in the precision that all arguments have together."""
        altitude, deviation, _ = as_tensors(altitude_m, deviation_k, like)
        theta = temperature_k(altitude, deviation) / T0_K
        return cls(pressure_pa(altitude) / P0_PA, theta, deviation, speed_of_sound_mps(altitude, deviation))


@dataclass(frozen=True)
class Engines(CoefficientGroup, ABC):
    """All engines of a type.

    Example:
        >>> issubclass(Jet, Engines), len(Jet.PLACES["idle_thrust"])
        (True, 1)
    """

    PLACES: ClassVar[Places] = {
        "reference_kg": (("PFM/MREF", 1),),
        "heating_value_j_kg": (("PFM/LHV", 1),),
        "n_engines": (("PFM/n_eng", 1),),
    }
    LENGTHS: ClassVar[Mapping[str, tuple[int, ...]]] = {"exponents": (2,)}
    POSITIVE: ClassVar[frozenset[str]] = frozenset({"n_engines", "reference_kg", "heating_value_j_kg", "power_hp"})

    version: str
    n_engines: int
    reference_kg: Number
    """Mass whose weight scales thrust and fuel."""
    heating_value_j_kg: Number
    exponents: Numbers
    """Of pressure and temperature in the fuel flow."""

    @property
    def weight_n(self) -> Number:
        """Reference weight W_ref."""
        return self.reference_kg * G0_MPS2

    @abstractmethod
    def idle_terms(self, air: Air) -> dict[int, Tensor]:
        """Idle thrust in N by powers of the Mach number."""

    def idle_thrust_n(self, air: Air, mach: Tensor) -> Tensor:
        """Idle thrust."""
        terms = self.idle_terms(air)
        total = torch.zeros_like(mach)
        for power, term in terms.items():
            total = total + term * mach**power
        return total

    @abstractmethod
    def climb_thrust_n(self, air: Air, mach: Tensor) -> Tensor:
        """Thrust at the maximum climb rating."""

    @abstractmethod
    def idle_coefficient(self, air: Air, mach: Tensor) -> Tensor:
        """Fuel coefficient C_F at idle."""

    @abstractmethod
    def powered_coefficient(self, air: Air, mach: Tensor, thrust_n: Tensor) -> Tensor:
        """Fuel coefficient C_F at a thrust of all engines."""

    def idle_fuel_kg_s(self, air: Air, mach: Tensor) -> Tensor:
        """Fuel flow at idle."""
        return self._flow(air) * self.idle_coefficient(air, mach)

    def fuel_kg_s(self, air: Air, mach: Tensor, thrust_n: Tensor) -> Tensor:
        """Fuel flow at a thrust, at least that at idle."""
        powered = self.powered_coefficient(air, mach, thrust_n)
        return self._flow(air) * torch.maximum(powered, self.idle_coefficient(air, mach))

    def _flow(self, air: Air) -> Tensor:
        pressure, temperature = self.exponents
        scale = self.weight_n * A0_MPS / self.heating_value_j_kg
        return scale * air.delta**pressure * air.theta**temperature


OF_JET = (("kink", 1), ("flat_rating/b", 36), ("temp_rating/c", 45))
OF_TURBOPROP = (("max_power", 1), ("rating/p", 36))
"""Elements of a rating."""


def _rating(path: str, parts: tuple[tuple[str, int], ...]) -> tuple[tuple[str, int], ...]:
    return tuple((f"PFM/{path}/{part}", n) for part, n in parts)


@dataclass(frozen=True)
class Jet(Engines):
    """Turbofans: thrust by throttle and Mach number, the throttle by ratings.

    Example:
        >>> Jet.PLACES["idle_thrust"]
        (('PFM/TFM/LIDL/CT/ti', 12),)
    """

    PLACES: ClassVar[Places] = {
        **Engines.PLACES,
        "thrust": (("PFM/TFM/CT/a", 36),),
        "fuel": (("PFM/TFM/CF/f", 25),),
        "idle_thrust": (("PFM/TFM/LIDL/CT/ti", 12),),
        "idle_fuel": (("PFM/TFM/LIDL/CF/fi", 9),),
        "climb": _rating("TFM/MCMB", OF_JET),
        "cruise": _rating("TFM/MCRZ", OF_JET),
    }

    thrust: Numbers
    fuel: Numbers
    idle_thrust: Numbers
    idle_fuel: Numbers
    climb: Numbers
    cruise: Numbers = ()
    """As the climb rating; kept and not flown."""

    def idle_terms(self, air: Air) -> dict[int, Tensor]:
        """A cubic in pressure for each power of the Mach number up to 2."""
        return {i: self.weight_n * polynomial(self.idle_thrust[4 * i : 4 * i + 4], air.delta) for i in range(3)}

    def climb_thrust_n(self, air: Air, mach: Tensor) -> Tensor:
        """Flat rated up to the kink of the temperature deviation, by total temperature beyond."""
        kink, flat, hot = self.climb[0], self.climb[1:37], self.climb[37:]
        total = air.theta * (1 + (KAPPA - 1) / 2 * mach * mach)
        limited = surface(hot[:25], 5, mach, total) + air.delta * surface(hot[25:], 5, mach, air.delta)
        throttle = torch.where(air.deviation_k <= kink, surface(flat, 6, mach, air.delta), limited)
        return air.delta * self.weight_n * surface(self.thrust, 6, mach, throttle)

    def idle_coefficient(self, air: Air, mach: Tensor) -> Tensor:
        """Second-order surface over pressure and Mach number, over the pressure."""
        coefficient = self._idle_surface(air, mach) / air.delta
        return coefficient / air.theta.sqrt() if self.version == "4.2" else coefficient

    def _idle_surface(self, air: Air, mach: Tensor) -> Tensor:
        return surface(self.idle_fuel[:9], 3, air.delta, mach)

    def powered_coefficient(self, air: Air, mach: Tensor, thrust_n: Tensor) -> Tensor:
        """Fourth-order surface over thrust coefficient and Mach number."""
        return surface(self.fuel, 5, thrust_n / (air.delta * self.weight_n), mach)


@dataclass(frozen=True)
class Turboprop(Jet):
    """Turboprops: power in place of thrust, a propeller's efficiency, and more terms at idle.

    Example:
        >>> Turboprop.PLACES["idle_thrust"]
        (('PFM/TPM/LIDL/CT/ti', 32),)
    """

    PLACES: ClassVar[Places] = {
        **Engines.PLACES,
        "thrust": (("PFM/TPM/CP/a", 36),),
        "fuel": (("PFM/TPM/CF/f", 25),),
        "idle_thrust": (("PFM/TPM/LIDL/CT/ti", 32),),
        "idle_fuel": (("PFM/TPM/LIDL/CF/fi", 14),),
        "climb": _rating("TPM/MCMB", OF_TURBOPROP),
        "cruise": _rating("TPM/MCRZ", OF_TURBOPROP),
        "propeller": (("PFM/TPM/prop_dia", 1), ("PFM/TPM/max_eff", 1)),
    }

    propeller: Numbers = ()
    """Diameter in m and greatest efficiency."""

    def idle_terms(self, air: Air) -> dict[int, Tensor]:
        """A jet's terms and twenty more, in pressure and temperature, by powers of the Mach number from -1 to 3."""
        d, t, root = air.delta, air.theta, air.theta.sqrt()
        c = self.idle_thrust[12:]
        more = {
            -1: d * (c[9] + c[10] * d),
            0: d * (c[0] * root + c[1] * t + c[2] / root + c[3] * t * t)
            + (c[4] + c[5] * d * d + c[6] * d**3) / root
            + (c[14] + c[19] * d) * d / t,
            1: c[7] * d / root + (c[12] * d + c[15]) / t + c[16] / t**2,
            2: (c[8] * d + c[18]) / root + c[13] * d / t + c[17] / t**2,
            3: c[11] * d,
        }
        own = super().idle_terms(air)
        return {power: own.get(power, 0.0) + self.weight_n * term for power, term in more.items()}

    def _idle_surface(self, air: Air, mach: Tensor) -> Tensor:
        c, d, t = self.idle_fuel[9:], air.delta, air.theta
        more = c[0] * t + c[1] * t * t + mach * (c[2] * t + d * (c[3] * t.sqrt() + c[4] * t))
        return super()._idle_surface(air, mach) + more

    def climb_thrust_n(self, air: Air, mach: Tensor) -> Tensor:
        """Power of the rating's throttle, at most the maximum power through the propeller, over the speed."""
        most, throttle = self.climb[0], surface(self.climb[1:], 6, mach, air.theta)
        power = air.delta * self.weight_n * air.sound_mps * surface(self.thrust, 6, mach, throttle)
        tas, (diameter, best) = mach * air.sound_mps, self.propeller
        share = efficiency(diameter, best, as_tensors(mach, most / self.n_engines)[1], air.density_kg_m3, tas)
        return torch.minimum(power, most * share) / tas

    def powered_coefficient(self, air: Air, mach: Tensor, thrust_n: Tensor) -> Tensor:
        """Fourth-order surface over power coefficient and Mach number."""
        return super().powered_coefficient(air, mach, thrust_n * mach)


@dataclass(frozen=True)
class Piston(Engines):
    """Piston engines: power by throttle, thrust by the propeller's efficiency.

    Example:
        >>> Piston.PLACES["power_hp"]
        (('PFM/PEM/P', 1),)
    """

    PLACES: ClassVar[Places] = {
        **Engines.PLACES,
        "power_hp": (("PFM/PEM/P", 1),),
        "turbo_ft": (("PFM/PEM/Hd_turbo", 1),),
        "consumption": (("PFM/PEM/CPSFC", 1),),
        "propeller": (("PFM/PEM/prop_dia", 1), ("PFM/PEM/max_eff", 1)),
    }

    power_hp: Number
    """Of one engine at sea level."""
    turbo_ft: Number
    """Altitude up to which a turbocharger keeps the power; 0 without one."""
    consumption: Number
    propeller: Numbers

    def power_w(self, air: Air, throttle: float) -> Tensor:
        """Power of all engines at a throttle from 0 to 1, at most what the air allows."""
        full = self.power_hp * HORSEPOWER_W * self.n_engines
        turbo = Air.at(self.turbo_ft * FT_M, air.deviation_k)
        able = air.delta / air.theta.sqrt() * (turbo.theta.sqrt() / turbo.delta)
        if self.turbo_ft > 0:
            able = torch.where(air.density_kg_m3 >= turbo.density_kg_m3, 1.0, able)
        return full * able.clamp(max=throttle)

    def idle_thrust_n(self, air: Air, mach: Tensor) -> Tensor:
        """Idle power through the propeller."""
        return self._thrust_n(air, mach, self.power_w(air, IDLE_THROTTLE[self.version]))

    def climb_thrust_n(self, air: Air, mach: Tensor) -> Tensor:
        """Full power through the propeller."""
        return self._thrust_n(air, mach, self.power_w(air, 1.0))

    def _thrust_n(self, air: Air, mach: Tensor, power_w: Tensor) -> Tensor:
        tas, (diameter, best) = mach * air.sound_mps, self.propeller
        return power_w * efficiency(diameter, best, power_w / self.n_engines, air.density_kg_m3, tas) / tas

    def idle_terms(self, air: Air) -> dict[int, Tensor]:
        """Series of the propeller's efficiency in the power over the cube of the speed."""
        power, (diameter, best) = self.power_w(air, IDLE_THROTTLE[self.version]), self.propeller
        loading = 2 * power / self.n_engines * best / (air.density_kg_m3 * diameter**2 * pi)
        first, ratio = power * best / air.sound_mps, -loading / air.sound_mps**3
        return {-1 - 3 * k: comb(3 * k, k) / (2 * k + 1) * first * ratio**k for k in range(SERIES_TERMS)}

    def idle_coefficient(self, air: Air, mach: Tensor) -> Tensor:
        """Consumption of the idle power."""
        return self._coefficient(air, self.power_w(air, IDLE_THROTTLE[self.version])) + 0.0 * mach

    def powered_coefficient(self, air: Air, mach: Tensor, thrust_n: Tensor) -> Tensor:
        """Consumption of the power that gives a thrust: the efficiency's equation solved for the power."""
        diameter, best = self.propeller
        tas = mach * air.sound_mps
        useful = (thrust_n * tas).clamp(min=0.0)
        disc = 2 / (self.n_engines * air.density_kg_m3 * diameter**2 * pi * tas**3)
        power = useful * (1 + (1 + 4 * disc * useful).sqrt()) / (2 * best)
        return self._coefficient(air, power)

    def _coefficient(self, air: Air, power_w: Tensor) -> Tensor:
        return self.consumption * power_w / (self.weight_n * A0_MPS * air.delta * air.theta.sqrt())


def efficiency(diameter_m: Number, best: Number, power_w: Tensor, density_kg_m3: Tensor, tas_mps: Tensor) -> Tensor:
    """Efficiency of a propeller by momentum theory, the real root of ``a e^3 + e = best``.

    Args:
        diameter_m: Of the propeller.
        best: Greatest efficiency.
        power_w: Of its engine.
        density_kg_m3: Of the air.
        tas_mps: True airspeed.

    Example:
        >>> round(efficiency(2.0, 0.8, *torch.tensor([50e3, 1.225, 60.0])).item(), 3)
        0.782
    """
    loading = 2 * power_w / (density_kg_m3 * diameter_m**2 * pi * tas_mps**3 * best)
    scale = (3 * loading).sqrt()
    # Without load the root is the greatest efficiency itself, where the formula divides by zero.
    safe = torch.where(scale > 0, scale, 1.0)
    root = 2 / safe * torch.sinh(torch.asinh(1.5 * best * safe) / 3)
    return torch.where(scale > 0, root, best)


def surface(coefficients: Numbers, of_x: int, x: Tensor, y: Tensor) -> Tensor:
    """Polynomial in y whose coefficients are polynomials of ``of_x`` terms in x, in the order of the files."""
    rows = range(0, len(coefficients), of_x)
    return polynomial([polynomial(coefficients[at : at + of_x], x) for at in rows], y)
