"""The protocol of an aircraft's performance model, which everything outside of aircraft types flies."""

from typing import Any, Literal, Protocol, Self, runtime_checkable

import torch
from torch import Tensor

from descentflow.core.errors import AircraftError
from descentflow.core.tensors import Number

CLEAN, APPROACH, LANDING = 0, 1, 2
"""Codes of the configurations in integer tensors."""
NAMES = {"CR": CLEAN, "AP": APPROACH, "LD": LANDING}
"""BADA's names of the configurations; initial climb and take-off do not occur in a descent."""
Configuration = Literal["CR", "AP", "LD"] | Tensor
"""One BADA name for the whole batch, or an integer tensor of codes."""


@runtime_checkable
class PerformanceModel(Protocol):
    """Drag, thrust, fuel, speeds and limits of one aircraft type, batched and differentiable.

    Arguments are numbers or tensors that broadcast against each other, in SI units; results have the broadcast shape.
    Numbers of the model may be tensors too, to differentiate by them or to give each flight its own. A mass of None is
    the reference mass. Speeds are true airspeeds unless they are named CAS; altitudes are pressure altitudes;
    ``deviation_k`` is the temperature's deviation from ISA.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> isinstance(aircraft("A320"), PerformanceModel)
        True
    """

    @property
    def typecode(self) -> str:
        """ICAO type designator."""

    @property
    def source(self) -> str:
        """Source of the numbers."""

    @property
    def mass_reference_kg(self) -> Number:
        """Mass that holds where none is given."""

    @property
    def mass_minimum_kg(self) -> Number:
        """Operating mass without payload and fuel."""

    @property
    def mass_maximum_kg(self) -> Number:
        """Maximum take-off mass."""

    @property
    def mass_payload_kg(self) -> Number:
        """Maximum payload; 0 where it is not known."""

    @property
    def vmo_kt(self) -> Number:
        """Maximum operating CAS."""

    @property
    def mmo(self) -> Number:
        """Maximum operating Mach number."""

    @property
    def altitude_maximum_ft(self) -> Number:
        """Maximum operating altitude."""

    @property
    def des_cas_low_kt(self) -> Number:
        """CAS of the standard descent below 10,000 ft."""

    @property
    def des_cas_high_kt(self) -> Number:
        """CAS of the standard descent above 10,000 ft."""

    @property
    def des_mach(self) -> Number:
        """Mach number of the standard descent; 0 where the type has none."""

    @property
    def approach_angle_rad(self) -> float:
        """Angle at which the standard descent flies with flaps out; 0 where it idles."""

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
        """Drag with lift equal to weight times the load factor; with spoilers where the descent is expedited."""

    def idle_thrust_n(
        self, altitude_m: Number, tas_mps: Number, deviation_k: Number = 0.0, configuration: Configuration = "CR"
    ) -> Tensor:
        """Thrust of all engines at idle; below zero where they brake."""

    def idle_thrust_terms(self, altitude_m: Tensor, deviation_k: Number = 0.0) -> dict[int, Tensor]:
        """Clean idle thrust as a sum over powers of the Mach number: power to coefficient in N, of altitudes (L,)."""

    def climb_thrust_n(self, altitude_m: Number, tas_mps: Number, deviation_k: Number = 0.0) -> Tensor:
        """Maximum climb thrust of all engines."""

    def idle_fuel_flow_kg_s(self, altitude_m: Number, tas_mps: Number = 0.0, deviation_k: Number = 0.0) -> Tensor:
        """Fuel flow at idle."""

    def fuel_flow_kg_s(
        self, altitude_m: Number, tas_mps: Number, thrust_n: Number, deviation_k: Number = 0.0
    ) -> Tensor:
        """Fuel flow at a thrust of all engines, at least that at idle."""

    def minimum_cas_mps(
        self, altitude_m: Number, mass_kg: Number | None = None, configuration: Configuration = "CR"
    ) -> Tensor:
        """Lowest CAS in flight, by stall and buffet."""

    def maximum_altitude_m(self, mass_kg: Number | None = None, deviation_k: Number = 0.0) -> Tensor:
        """Highest altitude that mass and temperature allow."""

    def descent_cas_mps(self, altitude_m: Number, mass_kg: Number | None = None) -> Tensor:
        """CAS of the standard descent."""

    def descent_configuration(self, altitude_m: Number, cas_mps: Number, mass_kg: Number | None = None) -> Tensor:
        """Codes of the configuration that a descent has at an altitude and a CAS."""

    def transition_altitude_m(self) -> Tensor:
        """Altitude where the standard descent changes from Mach number to CAS; infinite where it has no Mach number."""

    def holds_mach(self, altitude_m: Number) -> Tensor:
        """Return True where the standard descent holds its Mach number."""

    def thrust_breaks_m(self) -> tuple[Tensor, ...]:
        """Altitudes where clean idle thrust jumps."""

    def schedule_breaks_m(self) -> tuple[float, ...]:
        """Altitudes where speed, configuration or limits of the standard descent jump, the transition left out."""

    def at_mass(self, mass_kg: Number) -> Self:
        """The model with another reference mass."""

    def with_factors(self, *, parasitic: Number = 1.0, induced: Number = 1.0, idle: Number = 1.0) -> Self:
        """The clean aircraft with other drag without lift, drag by lift and idle thrust, as factors of its own."""

    def to_state(self) -> dict[str, Any]:
        """Primitives from which :func:`descentflow.aircraft_types.registry.aircraft_from_state` rebuilds it."""


def by_configuration(configuration: Configuration, clean: Tensor, approach: Tensor, landing: Tensor) -> Tensor:
    """Pick the value that belongs to a configuration.

    Args:
        configuration: A name (``CR``, ``AP``, ``LD``) or an integer tensor of codes that broadcasts.
        clean: Value in clean configuration.
        approach: Value in approach configuration.
        landing: Value in landing configuration.

    Returns:
        The value chosen, broadcast shape.

    Raises:
        AircraftError: If the name is not one of the three.

    Example:
        >>> values = [torch.tensor(float(i)) for i in range(3)]
        >>> by_configuration(torch.tensor([LANDING, CLEAN]), *values).tolist()
        [2.0, 0.0]
    """
    if isinstance(configuration, Tensor):
        return torch.where(configuration == LANDING, landing, torch.where(configuration == APPROACH, approach, clean))
    if configuration not in NAMES:
        raise AircraftError(
            f"configuration {configuration!r}",
            expected="CR, AP, LD or an integer tensor of their codes",
            mend="descents know no take-off or initial climb: pass CR for clean",
        )
    return (clean, approach, landing)[NAMES[configuration]]
