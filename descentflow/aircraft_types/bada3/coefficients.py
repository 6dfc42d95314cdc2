"""The coefficients of one aircraft type in BADA 3 form (user manual, section 3)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from descentflow.aircraft_types.coefficient_group import CoefficientGroup
from descentflow.aircraft_types.standard_descent import STANDARD, EngineKind, GlobalParameters
from descentflow.core.arguments import checked_arguments
from descentflow.core.tensors import Number


@dataclass(frozen=True)
class Coefficients(CoefficientGroup):
    """Coefficients of one type, named and scaled as in the BADA 3 user manual (section 3, OPF and APF files).

    Numeric fields may be replaced by tensors (``dataclasses.replace(aircraft, cd0_cr=tensor)``) that
    broadcast against the batch, so every result can be differentiated with respect to any coefficient.

    Units stand in the suffix; the thrust, fuel and drag coefficients have the units of the manual's equations
    (altitudes in ft and speeds in kt there).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> open_aircraft("A320").wing_area_m2
        122.4
    """

    RANGES: ClassVar[Mapping[str, tuple[float, float]]] = {
        "altitude_des_ft": (0.0, 1e5),
        "des_cas_low_kt": (0.0, 1e3),
        "des_cas_high_kt": (0.0, 1e3),
        "des_mach": (0.0, 1.0),
        "ct2": (-1e8, 1e8),
    }
    """Far wider than any aircraft's, of coefficients that shift bounds and still let a descent fly."""

    typecode: str
    engine: EngineKind
    n_engines: int
    wake_category: str
    source: str

    mass_reference_kg: Number
    mass_minimum_kg: Number
    mass_maximum_kg: Number
    mass_payload_kg: Number

    vmo_kt: Number
    mmo: Number
    altitude_maximum_ft: Number
    """Maximum operating altitude h_MO."""
    altitude_mtow_ft: Number
    """Maximum altitude h_max at maximum mass under ISA."""
    altitude_mass_gradient_ft_kg: Number
    """G_w: growth of h_max per kg below maximum mass."""
    altitude_temperature_gradient_ft_k: Number
    """G_t: change of h_max per kelvin of temperature deviation."""

    wing_area_m2: Number
    buffet_clbo: Number
    buffet_k: Number
    cd0_cr: Number
    cd2_cr: Number
    cd0_ic: Number
    cd2_ic: Number
    cd0_to: Number
    cd2_to: Number
    cd0_ap: Number
    cd2_ap: Number
    cd0_ld: Number
    cd2_ld: Number
    cd0_gear: Number
    vstall_cr_kt: Number
    vstall_ic_kt: Number
    vstall_to_kt: Number
    vstall_ap_kt: Number
    vstall_ld_kt: Number

    ct1: Number
    ct2: Number
    ct3: Number
    ct4: Number
    ct5: Number
    ct_des_low: Number
    ct_des_high: Number
    altitude_des_ft: Number
    """H_p,des: the altitude where high-altitude descent thrust hands over to low."""
    ct_des_app: Number
    ct_des_ld: Number
    cf1: Number
    cf2: Number
    cf3: Number
    cf4: Number
    cf_cr: Number

    des_cas_low_kt: Number
    """V_des,1: standard descent CAS between 3,000 or 6,000 ft and 10,000 ft."""
    des_cas_high_kt: Number
    """V_des,2: standard descent CAS between 10,000 ft and the Mach transition altitude."""
    des_mach: Number
    """M_des: standard descent Mach above the transition altitude; 0 where the type has none."""
    limits: GlobalParameters = STANDARD
    """Global parameters; they are the manual's unless a licence holder's BADA.GPF has others."""

    @checked_arguments
    def with_factors(self, *, parasitic: Number = 1.0, induced: Number = 1.0, idle: Number = 1.0) -> Self:
        """The clean aircraft with other CD0, CD2 and idle thrust, as factors of its own.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> plain = open_aircraft("A320")
            >>> round(float(plain.with_factors(parasitic=1.1).cd0_cr / plain.cd0_cr), 3)
            1.1
        """
        return replace(
            self,
            cd0_cr=self.cd0_cr * parasitic,
            cd2_cr=self.cd2_cr * induced,
            ct_des_low=self.ct_des_low * idle,
            ct_des_high=self.ct_des_high * idle,
        )

    def repaired_numbers(self) -> dict[str, tuple[str, float]]:
        """Numbers that each factor of :meth:`with_factors` changes.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").repaired_numbers()["cd0_cr"]
            ('parasitic', 0.01751)
        """
        factors = {"cd0_cr": "parasitic", "cd2_cr": "induced", "ct_des_low": "idle", "ct_des_high": "idle"}
        return {name: (factor, float(getattr(self, name))) for name, factor in factors.items()}

    def with_numbers(self, **numbers: float) -> Self:
        """The aircraft with other numbers of these, and other speeds."""
        return replace(self, **numbers)  # type: ignore[arg-type] # names of fields

    def at_mass(self, mass_kg: Number) -> Self:
        """The aircraft with another reference mass, to which its stall speeds then belong.

        Example:
            >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
            >>> open_aircraft("A320").at_mass(60_000.0).mass_reference_kg
            60000.0
        """
        return replace(self, mass_reference_kg=mass_kg)

    def to_state(self) -> dict[str, Any]:
        """Return the coefficients as primitives, for a checkpoint that loads without executing code.

        Global parameters are in it where they are not the manual's.
        """
        return {name: value for name, value in self.plain().items() if name != "limits" or self.limits != STANDARD}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> Self:
        """Rebuild from :meth:`to_state`.

        Raises:
            AircraftError: If a coefficient is missing, one is not known, is no finite number or is no aircraft's.
        """
        return cls.of(state)
