"""Forces and fuel of BADA 3 (user manual, sections 3.6.1, 3.7 and 3.9), and with them the whole model of a type."""

from dataclasses import dataclass
from functools import reduce

import torch
from torch import Tensor

from descentflow.aircraft_types.bada3.speeds import Speeds
from descentflow.core.constants import G0_MPS2
from descentflow.core.tensors import Number, as_tensors, broadcast
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.atmosphere import density_kg_m3, is_above, speed_of_sound_mps
from descentflow.physics.performance_model import Configuration, by_configuration

MAX_TEMPERATURE_LOSS = 0.4
"""Largest share of the climb thrust that heat may take (3.7-6)."""
_KG_MIN = 1 / 60
"""A kilogram a minute in kg/s."""


@dataclass(frozen=True)
class Bada3Aircraft(Speeds):
    """A type by the equations of BADA 3: a :class:`~descentflow.physics.performance_model.PerformanceModel`.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> open_aircraft("A320").engine
        'jet'
        >>> print(open_aircraft("A320"))
        A320: 2 jet engines, wake category M, 61,300 kg (41,295 to 73,500), up to 41,000 ft
        standard descent: Mach 0.77, 280 kt, 250 kt below 10,000 ft
        coefficients: descentflow open aircraft, not BADA: ...
    """

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
        """Drag on the parabolic polar, with lift equal to weight (manual 3.6-1 to 3.6-5, 3.7.1).

        ``D = rho V^2 S / 2 (CD0 + CD2 CL^2)`` with ``CL = 2 n m g0 / (rho V^2 S)``. A configuration without a polar of
        its own (CD0 and CD2 zero) has the clean one; the gear counts in landing configuration. An expedited descent
        multiplies the result by C_des,exp.

        Args:
            tas_mps: True airspeed, positive.
            altitude_m: Pressure altitude.
            deviation_k: Temperature deviation from ISA.
            mass_kg: Mass; the reference mass when None.
            configuration: ``CR``, ``AP``, ``LD`` or an integer tensor of their codes.
            load_factor: n, one over the cosine of the bank angle.
            expedited: Whether spoilers are out.

        Returns:
            Drag in newtons, the shape to which all arguments and coefficients broadcast.

        Raises:
            AircraftError: If the configuration does not exist.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").drag_n(200.0, 6000.0, mass_kg=60e3) > 20e3)
            True
        """
        tas, altitude, deviation = as_tensors(tas_mps, altitude_m, deviation_k)
        pressed_area = 0.5 * density_kg_m3(altitude, deviation) * tas * tas * self.wing_area_m2
        cd0, cd2 = self.polar(configuration, pressed_area)
        lift_coefficient = load_factor * self.mass_or_reference_kg(mass_kg) * G0_MPS2 / pressed_area
        drag = pressed_area * (cd0 + cd2 * lift_coefficient * lift_coefficient)
        return drag * self.limits.expedited_drag_factor if expedited else drag

    def polar(self, configuration: Configuration = "CR", like: Number = 0.0) -> tuple[Tensor, Tensor]:
        """CD0 (gear included) and CD2 of a configuration (manual 3.6-2 to 3.6-4), in the precision of ``like``.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> [bool(c > 0) for c in open_aircraft("A320").polar()]
            [True, True]
        """
        if isinstance(configuration, str) and configuration == "CR":
            _, cd0, cd2 = as_tensors(like, self.cd0_cr, self.cd2_cr)
            return cd0, cd2
        clean, approach, landing = (self.cd0_cr, self.cd2_cr), (self.cd0_ap, self.cd2_ap), (self.cd0_ld, self.cd2_ld)
        _, gear, *known = as_tensors(like, self.cd0_gear, *clean, *approach, *landing)
        zero_cr, two_cr, zero_ap, two_ap, zero_ld, two_ld = known
        no_ap = (zero_ap == 0) & (two_ap == 0)
        no_ld = (zero_ld == 0) & (two_ld == 0)
        cd0 = by_configuration(
            configuration, zero_cr, torch.where(no_ap, zero_cr, zero_ap), torch.where(no_ld, zero_cr, zero_ld + gear)
        )
        cd2 = by_configuration(
            configuration, two_cr, torch.where(no_ap, two_cr, two_ap), torch.where(no_ld, two_cr, two_ld)
        )
        return cd0, cd2

    def has_full_polar(self) -> Tensor:
        """Return True where every coefficient of the approach and landing polars and the gear is given (manual 3.7.3).

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").has_full_polar().dtype
            torch.bool
        """
        given = as_tensors(self.cd0_ap, self.cd2_ap, self.cd0_ld, self.cd2_ld, self.cd0_gear)
        return reduce(torch.logical_and, (value != 0 for value in given))

    def climb_thrust_n(self, altitude_m: Number, tas_mps: Number, deviation_k: Number = 0.0) -> Tensor:
        """Maximum climb thrust of the whole aircraft (manual 3.7-1 to 3.7-7).

        With Hp in ft and V in kt: jets ``CT1 (1 - Hp/CT2 + CT3 Hp^2)``, turboprops ``CT1/V (1 - Hp/CT2) + CT3``,
        pistons ``CT1 (1 - Hp/CT2) + CT3/V``; times ``1 - CT5 (dT - CT4)``, where the loss lies between 0 and 0.4 and
        CT5 is at least 0.

        Args:
            altitude_m: Pressure altitude.
            tas_mps: True airspeed; without effect for jets, positive for the others.
            deviation_k: Temperature deviation from ISA.

        Returns:
            Thrust in newtons, the shape to which all arguments and coefficients broadcast.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").climb_thrust_n(0.0, 150.0) > 100e3)
            True
        """
        altitude, tas, deviation = as_tensors(altitude_m, tas_mps, deviation_k)
        altitude_ft = altitude / FT_M
        ct1, ct2, ct3 = self.ct1, self.ct2, self.ct3
        if self.engine == "jet":
            thrust = ct1 * (1 - altitude_ft / ct2 + ct3 * altitude_ft * altitude_ft)
            thrust, _ = broadcast(thrust, tas)
        elif self.engine == "turboprop":
            thrust = ct1 / (tas / KT_MPS) * (1 - altitude_ft / ct2) + ct3
        else:
            thrust = ct1 * (1 - altitude_ft / ct2) + ct3 / (tas / KT_MPS)
        return thrust * (1 - self._temperature_loss(deviation))

    def _temperature_loss(self, deviation_k: Tensor) -> Tensor:
        """Share of the climb thrust lost to heat (manual 3.7-4 to 3.7-7)."""
        scale = self.ct5.clamp(min=0.0) if isinstance(self.ct5, Tensor) else max(self.ct5, 0.0)
        return (scale * (deviation_k - self.ct4)).clamp(0.0, MAX_TEMPERATURE_LOSS)

    def descent_thrust_floor_ft(self) -> Tensor:
        """Altitude above which high-altitude descent thrust holds (manual 3.7.3).

        H_p,des, raised to H_max,AP where approach and landing polars are given.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").descent_thrust_floor_ft() >= 0)
            True
        """
        (printed,) = as_tensors(self.altitude_des_ft)
        return torch.where(self.has_full_polar(), printed.clamp(min=self.limits.approach_ceiling_ft), printed)

    def idle_thrust_n(
        self,
        altitude_m: Number,
        tas_mps: Number,
        deviation_k: Number = 0.0,
        configuration: Configuration = "CR",
    ) -> Tensor:
        """Idle thrust in descent, a fraction of the maximum climb thrust (manual 3.7-9 to 3.7-12).

        ``CTdes,high`` above H_p,des in any configuration; at and below it ``CTdes,low``, ``CTdes,app`` or ``CTdes,ld``.
        The fractions may be zero or negative (windmilling drag), as printed. The step at H_p,des is BADA's own.

        Args:
            altitude_m: Pressure altitude.
            tas_mps: True airspeed.
            deviation_k: Temperature deviation from ISA.
            configuration: ``CR``, ``AP``, ``LD`` or an integer tensor of their codes.

        Returns:
            Thrust in newtons, the shape to which all arguments and coefficients broadcast.

        Raises:
            AircraftError: If the configuration has no descent thrust.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").idle_thrust_n(torch.linspace(3e3, 1e4, 5), 200.0).shape
            torch.Size([5])
        """
        flaps = () if isinstance(configuration, str) and configuration == "CR" else (self.ct_des_app, self.ct_des_ld)
        altitude, tas, deviation, high, low, *others = as_tensors(
            altitude_m, tas_mps, deviation_k, self.ct_des_high, self.ct_des_low, *flaps
        )
        is_high = is_above(altitude, self.descent_thrust_floor_ft() * FT_M)
        fraction = torch.where(is_high, high, by_configuration(configuration, low, *others) if others else low)
        return fraction * self.climb_thrust_n(altitude, tas, deviation)

    def idle_thrust_terms(self, altitude_m: Tensor, deviation_k: Number = 0.0) -> dict[int, Tensor]:
        """Clean idle thrust as a constant and a term in 1/V, by powers of the Mach number (manual 3.7-1 to 3.7-9).

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> list(open_aircraft("A320").idle_thrust_terms(torch.tensor([6000.0, 9000.0])))
            [0]
        """
        slow, fast = (self.idle_thrust_n(altitude_m, speed, deviation_k) for speed in (100.0, 200.0))
        if self.engine == "jet":
            return {0: fast}
        return {0: 2 * fast - slow, -1: (slow - fast) * 200.0 / speed_of_sound_mps(altitude_m, deviation_k)}

    def thrust_breaks_m(self) -> tuple[Tensor, ...]:
        """Altitude where high-altitude descent thrust changes to low (manual 3.7.3).

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> [round(float(m)) for m in open_aircraft("A320").thrust_breaks_m()]
            [3048]
        """
        return (self.descent_thrust_floor_ft() * FT_M,)

    def idle_fuel_flow_kg_s(self, altitude_m: Number, tas_mps: Number = 0.0, deviation_k: Number = 0.0) -> Tensor:
        """Fuel flow at idle: ``Cf3 (1 - Hp/Cf4)`` in kg/min, for pistons Cf3 (manual 3.9-4, 3.9-8).

        Args:
            altitude_m: Pressure altitude.
            tas_mps: True airspeed; no part of BADA 3's idle.
            deviation_k: Temperature deviation from ISA, likewise.

        Returns:
            Fuel flow in kg/s, broadcast shape.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").idle_fuel_flow_kg_s(6000.0) > 0)
            True
        """
        (altitude,) = as_tensors(altitude_m)
        if self.engine == "piston":
            return self.cf3 * _KG_MIN + 0.0 * altitude
        return self.cf3 * (1 - altitude / FT_M / self.cf4) * _KG_MIN

    def nominal_fuel_flow_kg_s(self, tas_mps: Number, thrust_n: Number) -> Tensor:
        """Fuel flow for a thrust (manual 3.9-1 to 3.9-3, 3.9-7).

        With V in kt and thrust in kN: jets ``Cf1 (1 + V/Cf2) Thr``, turboprops ``Cf1 (1 - V/Cf2) V/1000 Thr``, pistons
        ``Cf1``, in kg/min.

        Args:
            tas_mps: True airspeed.
            thrust_n: Thrust of the whole aircraft.

        Returns:
            Fuel flow in kg/s, broadcast shape.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").nominal_fuel_flow_kg_s(200.0, 40e3) > 0.3)
            True
        """
        tas, thrust = as_tensors(tas_mps, thrust_n)
        tas_kt = tas / KT_MPS
        if self.engine == "piston":
            return self.cf1 * _KG_MIN + 0.0 * (tas_kt + thrust)
        if self.engine == "jet":
            specific = self.cf1 * (1 + tas_kt / self.cf2)
        else:
            specific = self.cf1 * (1 - tas_kt / self.cf2) * tas_kt / 1000
        return specific * thrust / 1000 * _KG_MIN

    def fuel_flow_kg_s(
        self, altitude_m: Number, tas_mps: Number, thrust_n: Number, deviation_k: Number = 0.0
    ) -> Tensor:
        """Fuel flow at a thrust, at least that at idle (manual 3.9-4, 3.9-5).

        Pistons burn the minimum throughout (3.9-8).

        Args:
            altitude_m: Pressure altitude.
            tas_mps: True airspeed.
            thrust_n: Thrust of the whole aircraft.
            deviation_k: Temperature deviation from ISA; no part of BADA 3's fuel.

        Returns:
            Fuel flow in kg/s, broadcast shape.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").fuel_flow_kg_s(6000.0, 200.0, 40e3) > 0.3)
            True
        """
        idle = self.idle_fuel_flow_kg_s(altitude_m, tas_mps)
        nominal = self.nominal_fuel_flow_kg_s(tas_mps, thrust_n)
        return idle if self.engine == "piston" else torch.maximum(nominal, idle)
