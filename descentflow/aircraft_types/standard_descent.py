"""The standard descent of BADA 3 and 4: speeds and configurations by altitude (user manual, sections 5 and 4.3)."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, Literal

import torch
from torch import Tensor

from descentflow.aircraft_types.coefficient_group import CoefficientGroup, Numbers
from descentflow.core.tensors import Number, as_tensors
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import crossover_altitude_m, mach_to_cas_mps
from descentflow.physics.atmosphere import is_below
from descentflow.physics.performance_model import APPROACH, CLEAN, LANDING, Configuration

EngineKind = Literal["jet", "turboprop", "piston"]
BUFFET_FLOOR_M = 15000 * FT_M
"""The low-speed buffet limits jets and turboprops of BADA 3 from this altitude up."""
HIGH_SCHEDULE_M = 10000 * FT_M
"""From here up the high speed V_des,2 and the Mach number hold."""
TURBINE_CEILINGS_FT = (6000.0, 3000.0, 2000.0, 1500.0, 1000.0)
PISTON_CEILINGS_FT = (1500.0, 1000.0, 500.0)
"""Altitudes below which the next lower speed of the schedule holds, from the top (manual 4.3-1 to 4.3-7)."""
_EQUAL_MPS = 1e-6
"""Speeds closer than this are equal: a schedule may hold exactly the threshold speed."""


@dataclass(frozen=True)
class GlobalParameters(CoefficientGroup):
    """Parameters of section 5 of the manual for a descent; the defaults are the manual's for civil flights.

    A directory's own BADA.GPF is read by ``read_gpf``.

    Example:
        >>> GlobalParameters().approach_ceiling_ft
        8000.0
    """

    LENGTHS: ClassVar[Mapping[str, tuple[int, ...]]] = {"des_increment_kt": (4,), "des_increment_piston_kt": (3,)}
    WHOLE: ClassVar[bool] = True

    min_speed_factor: Number = 1.3
    """C_v,min: minimum speed over stall speed, all phases but take-off (5.7)."""
    approach_ceiling_ft: Number = 8000.0
    """H_max,AP: no approach configuration at or above this altitude (5.6)."""
    landing_ceiling_ft: Number = 3000.0
    """H_max,LD: no landing configuration at or above this altitude (5.6)."""
    expedited_drag_factor: Number = 1.6
    """C_des,exp: drag factor of an expedited descent, flown with spoilers (5.4)."""
    des_increment_kt: Numbers = (5.0, 10.0, 20.0, 50.0)
    """V_d,des 1 to 4: speed above the minimum below 1,000, 1,500, 2,000 and 3,000 ft, jets and turboprops (5.8)."""
    des_increment_piston_kt: Numbers = (5.0, 10.0, 20.0)
    """V_d,des 5 to 7: the same below 500, 1,000 and 1,500 ft for pistons (5.8)."""


STANDARD: Final = GlobalParameters()
"""The manual's values."""


class StandardDescent(ABC):
    """Schedule of a type by its three descent speeds, its minimum speeds and the global parameters.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> isinstance(open_aircraft("A320"), StandardDescent)
        True
    """

    typecode: str
    engine: EngineKind
    wake_category: str
    source: str
    limits: GlobalParameters
    mass_reference_kg: Number
    mass_minimum_kg: Number
    mass_maximum_kg: Number
    altitude_maximum_ft: Number
    des_cas_low_kt: Number
    des_cas_high_kt: Number
    des_mach: Number

    def __str__(self) -> str:
        """Type, mass, ceiling, standard descent and source, in three lines."""
        engines: int = getattr(self, "n_engines")  # noqa: B009 -- a field of one model, a property of the other
        mass, least, most = map(_shown, (self.mass_reference_kg, self.mass_minimum_kg, self.mass_maximum_kg))
        mach, high, low = map(_shown, (self.des_mach, self.des_cas_high_kt, self.des_cas_low_kt))
        return (
            f"{self.typecode}: {engines} {self.engine} engine{'s' if engines > 1 else ''}, wake category "
            f"{self.wake_category}, {mass} kg ({least} to {most}), up to {_shown(self.altitude_maximum_ft)} ft\n"
            f"standard descent: Mach {mach}, {high} kt, {low} kt below 10,000 ft\ncoefficients: {self.source}"
        )

    def mass_or_reference_kg(self, mass_kg: Number | None) -> Number:
        """Mass, the reference mass where none is given (manual 3.4-1)."""
        return self.mass_reference_kg if mass_kg is None else mass_kg

    @property
    def approach_angle_rad(self) -> float:
        """Angle of the descent with flaps out; 0 where the engines idle (manual 4.3)."""
        return 0.0

    @abstractmethod
    def minimum_cas_mps(
        self, altitude_m: Number, mass_kg: Number | None = None, configuration: Configuration = "CR"
    ) -> Tensor:
        """Minimum speed in flight."""

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
        cas, *slower = as_tensors(altitude, *self._low_speeds_mps(altitude, mass_kg))[1:]
        for ceiling_ft, lower in zip(self._ceilings_ft, slower, strict=True):
            cas = torch.where(is_below(altitude, ceiling_ft * FT_M), torch.minimum(lower, cas), cas)
        upper = torch.where(self.holds_mach(altitude), mach_to_cas_mps(mach, altitude), high * KT_MPS)
        return torch.where(is_below(altitude, HIGH_SCHEDULE_M), cas, upper)

    @property
    def _ceilings_ft(self) -> tuple[float, ...]:
        return PISTON_CEILINGS_FT if self.engine == "piston" else TURBINE_CEILINGS_FT

    def _low_speeds_mps(self, altitude: Tensor, mass_kg: Number | None) -> list[Tensor]:
        """Speeds below 10,000 ft, from the top range to the lowest."""
        (low,) = as_tensors(self.des_cas_low_kt)
        low = low * KT_MPS
        # As at the runway: EUROCONTROL's tables take the stall speed at sea level.
        slowest = self.minimum_cas_mps(torch.zeros_like(altitude), mass_kg, "LD")
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
        clean, approach = (self.minimum_cas_mps(altitude, mass_kg, phase) + 10 * KT_MPS for phase in ("CR", "AP"))
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
        return (HIGH_SCHEDULE_M, BUFFET_FLOOR_M, *(float(ft) * FT_M for ft in ceilings))


def _shown(number: Number) -> str:
    if isinstance(number, Tensor) and number.numel() != 1:
        return f"{number.numel()} values"
    return f"{float(number):,.6g}"
