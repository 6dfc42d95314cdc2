"""Stall and buffet speeds and the ceiling of BADA 3 (user manual, sections 3.4 to 3.6.2)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.aircraft_types.bada3.coefficients import Coefficients
from descentflow.aircraft_types.standard_descent import BUFFET_FLOOR_M, StandardDescent
from descentflow.core.constants import G0_MPS2, KAPPA
from descentflow.core.tensors import Number, as_tensors, safe_sqrt
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.physics.atmosphere import is_below, pressure_pa
from descentflow.physics.performance_model import Configuration, by_configuration

BUFFET_LOAD_FACTOR = 1.2
"""The manual's 0.2 g margin: 0.583 in its buffet equation is kappa / 2 / 1.2."""


@dataclass(frozen=True)
class Speeds(Coefficients, StandardDescent):
    """Coefficients with the standard descent and the equations of its limits.

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
            self.mass_or_reference_kg(mass_kg),
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
        load = (
            self.mass_or_reference_kg(mass_kg)
            * G0_MPS2
            / self.wing_area_m2
            / (KAPPA / 2 / BUFFET_LOAD_FACTOR)
            / pressure_pa(altitude)
        )
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
        able = at_mtow + heat + gw.clamp(min=0.0) * (heaviest - self.mass_or_reference_kg(mass_kg))
        return torch.where(at_mtow == 0, ceiling + 0.0 * able, torch.minimum(ceiling, able)) * FT_M
