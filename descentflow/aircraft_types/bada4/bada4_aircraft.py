"""A type by BADA 4: its wing and engines with limits (ALM), and speeds and configurations (ARPM)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any, ClassVar, Self

import torch
from torch import Tensor

from descentflow.aircraft_types.bada4.engines import Air, Engines, Jet, Piston, Turboprop
from descentflow.aircraft_types.bada4.wing import Wing
from descentflow.aircraft_types.coefficient_group import CoefficientGroup, Numbers, Places
from descentflow.aircraft_types.standard_descent import STANDARD, EngineKind, GlobalParameters, StandardDescent
from descentflow.core.arguments import checked_arguments
from descentflow.core.constants import G0_MPS2, KAPPA, P0_PA
from descentflow.core.errors import AircraftError
from descentflow.core.tensors import Number, as_tensors
from descentflow.core.units import FT_M
from descentflow.physics.airspeed import mach_to_cas_mps, tas_to_mach
from descentflow.physics.atmosphere import pressure_altitude_m, pressure_pa
from descentflow.physics.performance_model import Configuration, by_configuration

FAMILY = "BADA 4"
ENGINES: dict[str, type[Engines]] = {"jet": Jet, "turboprop": Turboprop, "piston": Piston}
EXPEDITED_DRAG = 0.03
"""Drag coefficient of the spoilers in an expedited descent."""
BUFFET_LOAD_FACTOR = 1.2
"""Minimum speeds of a clean wing keep a margin of 0.2 g to the buffet."""


@dataclass(frozen=True)
class Bada4Aircraft(CoefficientGroup, StandardDescent):
    """A type by the equations of BADA 4: a :class:`~descentflow.physics.performance_model.PerformanceModel`.

    Example:
        >>> from descentflow.physics.performance_model import PerformanceModel
        >>> all(hasattr(Bada4Aircraft, name) for name in vars(PerformanceModel) if name.endswith("_n"))
        True
    """

    PLACES: ClassVar[Places] = {
        "mass_minimum_kg": (("ALM/DLM/OEW", 1),),
        "mass_maximum_kg": (("ALM/DLM/MTOW", 1),),
        "vmo_kt": (("ALM/KLM/vmo", 1),),
        "altitude_maximum_ft": (("ALM/GLM/hmo", 1),),
    }
    LENGTHS: ClassVar[Mapping[str, tuple[int, ...]]] = {"climb_speeds": (3,), "cruise_speeds": (3,)}
    POSITIVE: ClassVar[frozenset[str]] = frozenset(
        {"mass_reference_kg", *PLACES, "mmo", "des_cas_low_kt", "des_cas_high_kt", "des_mach"}
    )
    typecode: str
    engine: EngineKind
    wake_category: str
    source: str
    engines: Engines
    wing: Wing
    mass_reference_kg: Number
    mass_minimum_kg: Number
    mass_maximum_kg: Number
    mass_payload_kg: Number
    vmo_kt: Number
    mmo: Number
    altitude_maximum_ft: Number
    des_cas_low_kt: Number
    des_cas_high_kt: Number
    des_mach: Number
    climb_speeds: Numbers = ()
    """CAS below and above 10,000 ft in kt, and Mach number; kept and not flown, like those of the cruise."""
    cruise_speeds: Numbers = ()
    idle_factor: Number = 1.0
    limits: GlobalParameters = STANDARD

    @property
    def n_engines(self) -> int:
        """Number of engines."""
        return self.engines.n_engines

    @property
    def approach_angle_rad(self) -> float:
        """Three degrees."""
        return 3 * pi / 180

    def drag_n(
        self,
        tas_mps: Number,
        altitude_m: Number,
        deviation_k: Number = 0.0,
        mass_kg: Number | None = None,
        configuration: Configuration = "CR",
        load_factor: Number = 1.0,
        *,
        expedited: bool = False,
    ) -> Tensor:
        """Drag with lift equal to weight (AFCM), ``delta p0 kappa M^2 S / 2 C_D``.

        Args:
            tas_mps: True airspeed, positive.
            altitude_m: Pressure altitude.
            deviation_k: Temperature deviation from ISA.
            mass_kg: Mass; the reference mass when None.
            configuration: ``CR``, ``AP``, ``LD`` or an integer tensor of their codes.
            load_factor: n, one over the cosine of the bank angle.
            expedited: Whether spoilers are out.

        Returns:
            Drag in newtons, broadcast shape.
        """
        tas, altitude, deviation = as_tensors(tas_mps, altitude_m, deviation_k)
        mach = tas_to_mach(tas, altitude, deviation)
        pressed_area = pressure_pa(altitude) * (KAPPA / 2) * mach * mach * self.wing.area_m2
        lift = load_factor * self.mass_or_reference_kg(mass_kg) * G0_MPS2 / pressed_area
        coefficient = self.wing.drag_coefficient(mach, lift, configuration)
        return pressed_area * (coefficient + EXPEDITED_DRAG if expedited else coefficient)

    def _at(self, altitude_m: Number, tas_mps: Number, deviation_k: Number) -> tuple[Air, Tensor]:
        tas, altitude, deviation = as_tensors(tas_mps, altitude_m, deviation_k)
        return Air.at(altitude, deviation, tas), tas_to_mach(tas, altitude, deviation)

    def idle_thrust_n(
        self, altitude_m: Number, tas_mps: Number, deviation_k: Number = 0.0, configuration: Configuration = "CR"
    ) -> Tensor:
        """Thrust of all engines at the rating LIDL, in any configuration; below zero where they brake."""
        air, mach = self._at(altitude_m, tas_mps, deviation_k)
        return self.engines.idle_thrust_n(air, mach) * self.idle_factor

    def idle_thrust_terms(self, altitude_m: Tensor, deviation_k: Number = 0.0) -> dict[int, Tensor]:
        """Idle thrust by powers of the Mach number; of a piston a series, see ``engines``."""
        terms = self.engines.idle_terms(Air.at(altitude_m, deviation_k))
        return {power: term * self.idle_factor for power, term in terms.items()}

    def thrust_breaks_m(self) -> tuple[Tensor, ...]:
        """None: idle thrust is smooth."""
        return ()

    def climb_thrust_n(self, altitude_m: Number, tas_mps: Number, deviation_k: Number = 0.0) -> Tensor:
        """Thrust of all engines at the rating MCMB."""
        return self.engines.climb_thrust_n(*self._at(altitude_m, tas_mps, deviation_k))

    def idle_fuel_flow_kg_s(self, altitude_m: Number, tas_mps: Number = 0.0, deviation_k: Number = 0.0) -> Tensor:
        """Fuel flow at idle."""
        return self.engines.idle_fuel_kg_s(*self._at(altitude_m, tas_mps, deviation_k))

    def fuel_flow_kg_s(
        self, altitude_m: Number, tas_mps: Number, thrust_n: Number, deviation_k: Number = 0.0
    ) -> Tensor:
        """Fuel flow at a thrust of all engines, at least that at idle."""
        _, thrust = as_tensors(tas_mps, thrust_n)
        return self.engines.fuel_kg_s(*self._at(altitude_m, tas_mps, deviation_k), thrust)

    def _needed_lift(self, altitude_m: Number, mass_kg: Number | None, load_factor: float) -> Tensor:
        """Lift coefficient times the square of the Mach number that carries the weight."""
        weight_n = self.mass_or_reference_kg(mass_kg) * G0_MPS2
        return 2 * load_factor * weight_n / (pressure_pa(altitude_m) * KAPPA * self.wing.area_m2)

    def minimum_cas_mps(
        self, altitude_m: Number, mass_kg: Number | None = None, configuration: Configuration = "CR"
    ) -> Tensor:
        """Lowest CAS in flight: the buffet's with a margin of 0.2 g, or stall times a factor where lift is a number."""
        factor, (altitude,) = self.limits.min_speed_factor, as_tensors(altitude_m)
        # The clean wing's lift by Mach number has the margin to the buffet, one number the factor of the speed.
        by_mach = len(self.wing.clean_lift) > 1
        needed = self._needed_lift(altitude, mass_kg, BUFFET_LOAD_FACTOR if by_mach else 1.0)
        clean = mach_to_cas_mps(self.wing.buffet_mach(needed, self.mmo), altitude) * (1.0 if by_mach else factor)
        needed = self._needed_lift(altitude, mass_kg, 1.0)
        flaps = [
            factor * mach_to_cas_mps((needed / flaps[3]).sqrt(), altitude) if flaps else clean
            for flaps in (self.wing.approach, self.wing.landing)
        ]
        return by_configuration(configuration, clean, *flaps)

    def maximum_altitude_m(self, mass_kg: Number | None = None, deviation_k: Number = 0.0) -> Tensor:
        """Highest altitude with a margin of 0.2 g to the buffet at some Mach number, at most the operating one."""
        sea = self._needed_lift(0.0, mass_kg, BUFFET_LOAD_FACTOR)
        _, ceiling, deviation = as_tensors(sea, self.altitude_maximum_ft, deviation_k)
        carried = pressure_altitude_m(P0_PA * sea / self.wing.most_lift(sea, self.mmo))
        return torch.minimum(carried, ceiling * FT_M) + 0.0 * deviation

    def at_mass(self, mass_kg: Number) -> Self:
        """The aircraft with another reference mass."""
        return replace(self, mass_reference_kg=mass_kg)

    @checked_arguments
    def with_factors(self, *, parasitic: Number = 1.0, induced: Number = 1.0, idle: Number = 1.0) -> Self:
        """The clean aircraft with other drag without lift, drag by lift and idle thrust, as factors of its own."""
        factors = [parasitic] * 5 + [induced] * 10
        drag = tuple(one * factor for one, factor in zip(self.wing.drag, factors, strict=True))
        return replace(self, wing=replace(self.wing, drag=drag), idle_factor=self.idle_factor * idle)

    def repaired_numbers(self) -> dict[str, tuple[str, float]]:
        """Factors of what the file has, as it has many numbers for each.

        Raises:
            AircraftError: If the engines are pistons.
        """
        if self.engine == "piston":
            raise AircraftError(
                f"{self.typecode}, whose idle thrust BADA 4 has no coefficient for",
                expected="a jet or a turboprop",
                mend="repair a type of these",
            )
        return {name: (name, 1.0) for name in ("parasitic", "induced", "idle")}

    def with_numbers(
        self, *, parasitic: float = 1.0, induced: float = 1.0, idle: float = 1.0, **speeds: float
    ) -> "Bada4Aircraft":
        """The aircraft with these factors of its own, and other speeds."""
        changed = self.with_factors(parasitic=parasitic, induced=induced, idle=idle)
        return replace(changed, **speeds)  # type: ignore[arg-type] # names of fields

    def to_state(self) -> dict[str, Any]:
        """Return the coefficients as primitives, for a checkpoint that loads without executing code."""
        return {"family": FAMILY, **self.plain()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "Bada4Aircraft":
        """Rebuild from :meth:`to_state`.

        Raises:
            AircraftError: If a coefficient is missing, is not known or is none of its kind.
        """
        engines = ENGINES.get(str(state.get("engine")))
        if engines is None:
            raise AircraftError(
                f"engine {str(state.get('engine'))[:60]!r}",
                expected=f"one of {', '.join(ENGINES)}",
                mend="take the file as it was written",
            )
        plain = {name: value for name, value in state.items() if name != "family"}
        return cls.of({**plain, "engines": engines.of(state.get("engines"))})
