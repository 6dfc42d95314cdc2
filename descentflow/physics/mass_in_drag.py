r"""Drag and rate of aircraft whose mass is not the reference mass.

At a CAS and a pressure altitude, :math:`q = \rho V^2 / 2` does not depend on the temperature, and the polar's drag at
mass m differs from that at the reference mass :math:`m_0` by

.. math:: K (m^2 - m_0^2), \qquad K = C_{D2}\, g^2 / (q S).

A profile of drag that is brought to the reference mass by it holds neither the mass nor, but for what the polar errs
by, what the mass does to the drag; so that it can be drawn apart from the mass, and flown at any.
"""

from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.physics.forces import drag_n


def induced_change_n(aircraft: Aircraft, cas_mps: Tensor, altitude_m: Tensor, mass_kg: Tensor) -> Tensor:
    """Drag (n, L) of the polar (manual 3.6.1) at masses, minus that at the reference mass.

    Args:
        aircraft: Coefficients.
        cas_mps: (n, L).
        altitude_m: (L,) pressure altitudes.
        mass_kg: (n,).

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> import torch
        >>> a320 = aircraft("A320")
        >>> level = torch.full((1, 1), 140.0), torch.tensor([9000.0])
        >>> float(induced_change_n(a320, *level, torch.tensor([a320.mass_reference_kg])))
        0.0
        >>> 1000 < float(induced_change_n(a320, *level, torch.tensor([1.1 * a320.mass_reference_kg]))) < 4000
        True
    """
    tas = cas_to_tas_mps(cas_mps, altitude_m)
    return drag_n(aircraft, tas, altitude_m, mass_kg=mass_kg[:, None]) - drag_n(aircraft, tas, altitude_m)


def drag_at_reference_mass(
    aircraft: Aircraft, inferred_n: Tensor, thrust_n: Tensor, cas_mps: Tensor, altitude_m: Tensor, mass_kg: Tensor
) -> Tensor:
    r"""Drag (n, L) that a flight would have had at the reference mass (manual 3.1 and 3.6.1).

    The excess of drag over thrust that explains a rate is proportional to the mass:
    :math:`D_m = F - (m / m_0) (F - D_0)`; the polar takes it to the reference mass.

    Args:
        aircraft: Coefficients; the reference mass inferred the drag.
        inferred_n: (n, L) drag that explains the rates at the reference mass, :math:`D_0`.
        thrust_n: (n, L) thrust with which it was inferred.
        cas_mps: (n, L).
        altitude_m: (L,) pressure altitudes.
        mass_kg: (n,) of the flights.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> import torch
        >>> a320, level = aircraft("A320"), (torch.full((1, 1), 140.0).double(), torch.tensor([9000.0]).double())
        >>> drag, thrust = torch.full((1, 1), 38e3).double(), torch.full((1, 1), 2e3).double()
        >>> same = drag_at_reference_mass(a320, drag, thrust, *level, torch.tensor([a320.mass_reference_kg]).double())
        >>> float(same)
        38000.0
    """
    share = mass_kg[:, None] / aircraft.mass_reference_kg
    own = thrust_n - share * (thrust_n - inferred_n)
    return own - induced_change_n(aircraft, cas_mps, altitude_m, mass_kg)


def slowness_at_mass(
    aircraft: Aircraft, reference_n: Tensor, thrust_n: Tensor, cas_mps: Tensor, altitude_m: Tensor, mass_kg: Tensor
) -> tuple[Tensor, Tensor]:
    """Drag (n, L) at masses, where it is known at the reference mass, and rate there over rate (manual 3.1, 3.6.1).

    Args:
        aircraft: Coefficients.
        reference_n: (n, L) drag at the reference mass.
        thrust_n: (n, L).
        cas_mps: (n, L).
        altitude_m: (L,) pressure altitudes.
        mass_kg: (n,).

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> import torch
        >>> a320, level = aircraft("A320"), (torch.full((1, 1), 140.0).double(), torch.tensor([9000.0]).double())
        >>> drag, thrust = torch.full((1, 1), 38e3).double(), torch.full((1, 1), 2e3).double()
        >>> heavy = torch.tensor([1.1 * a320.mass_reference_kg]).double()
        >>> _, slower = slowness_at_mass(a320, drag, thrust, *level, heavy)  # heavier aircraft glide further
        >>> 1.0 < float(slower) < 1.1
        True
    """
    own = reference_n + induced_change_n(aircraft, cas_mps, altitude_m, mass_kg)
    share = mass_kg[:, None] / aircraft.mass_reference_kg
    return own, share * (thrust_n - reference_n) / (thrust_n - own)
