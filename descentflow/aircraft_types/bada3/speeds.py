"""Speeds, configurations and limits of BADA 3 (user manual, sections 3.4 to 3.6.2, 4.3 and 5.6)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.aircraft_types.bada3.coefficients import Coefficients
from descentflow.core.constants import G0_MPS2, KAPPA
from descentflow.core.tensors import Number, as_tensors, safe_sqrt
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import crossover_altitude_m, mach_to_cas_mps
from descentflow.physics.atmosphere import is_below, pressure_pa
from descentflow.physics.performance_model import APPROACH, CLEAN, LANDING, Configuration, by_configuration

BUFFET_FLOOR_M = 15000 * FT_M
"""The low-speed buffet limits jets and turboprops from this altitude up."""
BUFFET_LOAD_FACTOR = 1.2
"""The manual's 0.2 g margin: 0.583 in its buffet equation is kappa / 2 / 1.2."""
HIGH_SCHEDULE_M = 10000 * FT_M
"""From here up the high speed V_des,2 and the Mach number hold."""
TURBINE_CEILINGS_FT = (6000.0, 3000.0, 2000.0, 1500.0, 1000.0)
PISTON_CEILINGS_FT = (1500.0, 1000.0, 500.0)
"""Altitudes below which the next lower speed of the schedule holds, from the top (manual 4.3-1 to 4.3-7)."""
_EQUAL_MPS = 1e-6
"""Speeds closer than this are equal: a schedule may hold exactly the threshold speed."""


@dataclass(frozen=True)
class Speeds(Coefficients):
    """Coefficients with the equations of speeds, configurations and limits.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> isinstance(open_aircraft("A320"), Speeds)
        True
    """

    def stall_cas_mps(self, mass_kg: Number | None = None, configuration: Configuration = "CR") -> Tensor:
        """Stall speed, scaled from the reference mass: ``V_stall sqrt(m / m_ref)`` (manual 3.4-1, 3.5.2).

        Raises:
            AircraftError: If the configuration does not exist.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").stall_cas_mps() > 40)
            True
        """
        mass, clean, approach, landing, reference = as_tensors(
            self.mass_reference_kg if mass_kg is None else mass_kg,
            self.vstall_cr_kt,
            self.vstall_ap_kt,
            self.vstall_ld_kt,
            self.mass_reference_kg,
        )
        return by_configuration(configuration, clean, approach, landing) * KT_MPS * torch.sqrt(mass / reference)

    def minimum_cas_mps(
        self, altitude_m: Number, mass_kg: Number | None = None, configuration: Configuration = "CR"
    ) -> Tensor:
        """Minimum speed in flight: 1.3 stall speeds, and the buffet limit from 15,000 ft up (manual 3.5-3 and 3.6.2).

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").minimum_cas_mps(3000.0) > 50)
            True
        """
        (altitude,) = as_tensors(altitude_m)
        stall = self.limits.min_speed_factor * self.stall_cas_mps(mass_kg, configuration)
        if self.engine == "piston":
            return stall + 0.0 * altitude
        buffet = self.buffet_mach(altitude, mass_kg)
        known = ~is_below(altitude, BUFFET_FLOOR_M) & (buffet > 0)
        return torch.where(known, torch.maximum(stall, mach_to_cas_mps(buffet, altitude)), stall)

    def buffet_mach(self, altitude_m: Number, mass_kg: Number | None = None) -> Tensor:
        """Low-speed buffet limit: smallest positive root of ``k M^3 - Clbo M^2 + load = 0`` (manual 3.6-6).

        The load is ``(m g0/S) / (0.583 p)``. The roots are those of the manual's appendix B, in closed trigonometric
        form; 0 where the type gives no buffet coefficients or the equation has no positive root.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").buffet_mach(11000.0) < 0.8)
            True
        """
        altitude, clbo, k = as_tensors(altitude_m, self.buffet_clbo, self.buffet_k)
        mass = self.mass_reference_kg if mass_kg is None else mass_kg
        load = mass * G0_MPS2 / self.wing_area_m2 / (KAPPA / 2 / BUFFET_LOAD_FACTOR) / pressure_pa(altitude)
        flat = safe_sqrt(load / torch.where(clbo > 0, clbo, torch.inf))
        curved = k > 0
        safe_k = torch.where(curved, k, 1.0)
        third = clbo / safe_k / 3
        cosine = 1 - load / safe_k / 2 / torch.where(curved & (clbo > 0), third, 1.0) ** 3
        has_root = curved & (clbo > 0) & (cosine > -1) & (cosine < 1)
        angle = torch.acos(torch.where(has_root, cosine, 0.0))
        root = third * (1 - 2 * torch.cos((angle + torch.pi) / 3))
        return torch.where(curved, torch.where(has_root, root, 0.0), flat)

    def maximum_altitude_m(self, mass_kg: Number | None = None, deviation_k: Number = 0.0) -> Tensor:
        """Maximum altitude for a mass and a temperature (manual 3.5-1).

        ``min(h_MO, h_max + Gt max(dT - CT4, 0) + Gw (m_max - m))`` with Gw at least 0 and Gt at most 0; h_MO where
        h_max is not given (0).

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").maximum_altitude_m() > 10000)
            True
        """
        mass = self.mass_reference_kg if mass_kg is None else mass_kg
        ceiling, at_mtow, heaviest, deviation, gw, gt, ct4 = as_tensors(
            self.altitude_maximum_ft,
            self.altitude_mtow_ft,
            self.mass_maximum_kg,
            deviation_k,
            self.altitude_mass_gradient_ft_kg,
            self.altitude_temperature_gradient_ft_k,
            self.ct4,
        )
        heat = gt.clamp(max=0.0) * (deviation - ct4).clamp(min=0.0)
        able = at_mtow + heat + gw.clamp(min=0.0) * (heaviest - mass)
        return torch.where(at_mtow == 0, ceiling + 0.0 * able, torch.minimum(ceiling, able)) * FT_M

    def transition_altitude_m(self) -> Tensor:
        """Crossover of the standard descent's CAS and Mach number (manual 3.1-27, 3.1-28 and 4.3).

        ``+inf`` where the type has no Mach schedule: it has no crossover.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> bool(open_aircraft("A320").transition_altitude_m() > 8000)
            True
        """
        cas_kt, mach = as_tensors(self.des_cas_high_kt, self.des_mach)
        has_mach = mach > 0
        altitude = crossover_altitude_m(cas_kt * KT_MPS, torch.where(has_mach, mach, 1.0))
        return torch.where(has_mach, altitude, torch.inf)

    def holds_mach(self, altitude_m: Number) -> Tensor:
        """Return True where the schedule holds Mach: from the transition up, never below 10,000 ft (manual 4.3).

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").holds_mach(torch.tensor([5000.0, 11500.0])).tolist()
            [False, True]
        """
        (altitude,) = as_tensors(altitude_m)
        return (altitude >= self.transition_altitude_m()) & ~is_below(altitude, HIGH_SCHEDULE_M)

    def descent_cas_mps(self, altitude_m: Number, mass_kg: Number | None = None) -> Tensor:
        """CAS of the standard descent (manual 4.3-1 to 4.3-7).

        From the top: Mach ``M_des`` from the transition altitude, ``V_des,2`` down to 10,000 ft, ``V_des,1`` at most
        250 kt down to 6,000 ft, at most 220 kt down to 3,000 ft, then 1.3 stall speeds in landing configuration plus
        50, 20, 10 and 5 kt below 3,000, 2,000, 1,500 and 1,000 ft. Pistons: ``V_des,1`` down to 1,500 ft, then 20, 10
        and 5 kt above the minimum below 1,500, 1,000 and 500 ft. No speed exceeds that of the range above it, as the
        manual recommends. A level on a boundary belongs to the upper range.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").descent_cas_mps(8000 * 0.3048).item() / 0.514444 <= 250.0
            True
        """
        altitude, high, mach = as_tensors(altitude_m, self.des_cas_high_kt, self.des_mach)
        cas, *slower = as_tensors(altitude, *self._low_speeds_mps(mass_kg))[1:]
        for ceiling_ft, lower in zip(self._ceilings_ft, slower, strict=True):
            cas = torch.where(is_below(altitude, ceiling_ft * FT_M), torch.minimum(lower, cas), cas)
        upper = torch.where(self.holds_mach(altitude), mach_to_cas_mps(mach, altitude), high * KT_MPS)
        return torch.where(is_below(altitude, HIGH_SCHEDULE_M), cas, upper)

    @property
    def _ceilings_ft(self) -> tuple[float, ...]:
        return PISTON_CEILINGS_FT if self.engine == "piston" else TURBINE_CEILINGS_FT

    def _low_speeds_mps(self, mass_kg: Number | None) -> list[Tensor]:
        """Speeds below 10,000 ft, from the top range to the lowest."""
        (low,) = as_tensors(self.des_cas_low_kt)
        low = low * KT_MPS
        slowest = self.limits.min_speed_factor * self.stall_cas_mps(mass_kg, "LD")
        if self.engine == "piston":
            return [low, *(slowest + v * KT_MPS for v in reversed(self.limits.des_increment_piston_kt))]
        capped = [low.clamp(max=250 * KT_MPS), low.clamp(max=220 * KT_MPS)]
        return [*capped, *(slowest + v * KT_MPS for v in reversed(self.limits.des_increment_kt))]

    def descent_configuration(self, altitude_m: Number, cas_mps: Number, mass_kg: Number | None = None) -> Tensor:
        """Configuration of a descent by altitude and speed, as integer codes (manual 3.5 and 5.6).

        Landing below 3,000 ft and slower than 10 kt above the approach configuration's minimum speed; else approach
        below 8,000 ft and at most 10 kt above the clean minimum speed; else clean. Altitudes stand for heights above
        the runway.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").descent_configuration(torch.tensor([300.0, 1500.0, 6000.0]), 70.0).tolist()
            [2, 1, 0]
        """
        altitude, cas = as_tensors(altitude_m, cas_mps)
        clean, approach = (self.minimum_cas_mps(altitude, mass_kg, one) + 10 * KT_MPS for one in ("CR", "AP"))
        lands = is_below(altitude, self.limits.landing_ceiling_ft * FT_M) & (cas < approach - _EQUAL_MPS)
        approaches = is_below(altitude, self.limits.approach_ceiling_ft * FT_M) & (cas < clean + _EQUAL_MPS)
        return torch.where(lands, LANDING, torch.where(approaches, APPROACH, CLEAN))

    def schedule_breaks_m(self) -> tuple[float, ...]:
        """Altitudes where speed, configuration or limits of the standard descent jump (manual 3.5, 3.6.2, 4.3, 5.6).

        The transition is left out.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> [round(m) for m in open_aircraft("A320").schedule_breaks_m()][:2]
            [3048, 4572]
        """
        ceilings = (*self._ceilings_ft, self.limits.approach_ceiling_ft, self.limits.landing_ceiling_ft)
        return (HIGH_SCHEDULE_M, BUFFET_FLOOR_M, *(ft * FT_M for ft in ceilings))
