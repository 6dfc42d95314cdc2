"""Aerodynamic configurations of a descent, and their selection by altitude and speed (manual, sections 3.5 and 5.6)."""

from typing import Literal

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.aircraft_types.bada3.global_parameters import STANDARD, GlobalParameters
from descentflow.core.errors import AircraftError
from descentflow.core.tensors import Number, as_tensors
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.altitude_limits import is_below

CLEAN, APPROACH, LANDING = 0, 1, 2
"""Codes of the configurations in integer tensors."""
NAMES = {"CR": CLEAN, "AP": APPROACH, "LD": LANDING}
"""BADA's names of the configurations; initial climb and take-off do not occur in a descent."""
Configuration = Literal["CR", "AP", "LD"] | Tensor
"""One BADA name for the whole batch, or an integer tensor of codes."""

_EQUAL_MPS = 1e-6
"""Speeds closer than this are equal: a schedule may hold exactly the threshold speed."""


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


def has_full_polar(aircraft: Aircraft) -> Tensor:
    """Return True where every coefficient of the approach and landing polar and of the gear is given (manual 3.7.3).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> has_full_polar(open_aircraft("A320")).dtype
        torch.bool
    """
    printed = aircraft.cd0_ap, aircraft.cd2_ap, aircraft.cd0_ld, aircraft.cd2_ld, aircraft.cd0_gear
    if not any(isinstance(value, Tensor) for value in printed):
        return torch.tensor(all(value != 0 for value in printed))
    given = as_tensors(*printed)
    full = torch.ones((), dtype=torch.bool, device=given[0].device)
    for value in given:
        full = full & (value != 0)
    return full


def stall_cas_mps(aircraft: Aircraft, mass_kg: Number | None = None, configuration: Configuration = "CR") -> Tensor:
    """Stall speed, scaled from the reference mass: ``V_stall sqrt(m / m_ref)`` (manual 3.4-1, 3.5.2).

    Args:
        aircraft: Coefficients of the type.
        mass_kg: Mass; the reference mass when None.
        configuration: Configuration, see :func:`by_configuration`.

    Returns:
        Calibrated airspeed in m/s, broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool(stall_cas_mps(open_aircraft("A320")) > 40)
        True
    """
    mass, clean, approach, landing, reference = as_tensors(
        aircraft.mass_reference_kg if mass_kg is None else mass_kg,
        aircraft.vstall_cr_kt,
        aircraft.vstall_ap_kt,
        aircraft.vstall_ld_kt,
        aircraft.mass_reference_kg,
    )
    return by_configuration(configuration, clean, approach, landing) * KT_MPS * torch.sqrt(mass / reference)


def descent_configuration(
    altitude_m: Number,
    cas_mps: Number,
    minimum_clean_mps: Number,
    minimum_approach_mps: Number,
    limits: GlobalParameters = STANDARD,
) -> Tensor:
    """Configuration of a descent by altitude and speed (manual 3.5 and 5.6).

    Landing below 3,000 ft and slower than 10 kt above the approach configuration's minimum speed; else approach below
    8,000 ft and at most 10 kt above the clean minimum speed; else clean. Altitudes stand for heights above the runway.

    Args:
        altitude_m: Pressure altitude.
        cas_mps: Calibrated airspeed.
        minimum_clean_mps: Minimum speed when clean, :func:`descentflow.physics.envelope.minimum_cas_mps`.
        minimum_approach_mps: Minimum speed in approach configuration.
        limits: Ceilings of the configurations.

    Returns:
        Integer codes (``CLEAN``, ``APPROACH``, ``LANDING``), broadcast shape.

    Example:
        >>> descent_configuration(torch.tensor([300.0, 1500.0, 6000.0]), 70.0, 80.0, 68.0).tolist()
        [2, 1, 0]
    """
    altitude, cas, clean, approach = as_tensors(altitude_m, cas_mps, minimum_clean_mps, minimum_approach_mps)
    margin = 10 * KT_MPS
    lands = is_below(altitude, limits.landing_ceiling_ft * FT_M) & (cas < approach + margin - _EQUAL_MPS)
    approaches = is_below(altitude, limits.approach_ceiling_ft * FT_M) & (cas < clean + margin + _EQUAL_MPS)
    return torch.where(lands, LANDING, torch.where(approaches, APPROACH, CLEAN))
