"""The nominal BADA descent: the baseline that every learned model is compared with (manual, sections 3 and 4.3)."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sin

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2, TROPOPAUSE_M
from descentflow.core.errors import AircraftError
from descentflow.core.tensors import Number, as_tensors, broadcast
from descentflow.core.units import FL_M, FT_M
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor
from descentflow.physics.performance_model import PerformanceModel, by_configuration

_CELL_M = 1000 * FT_M
"""Widest cell of the time quadrature: two Gauss points in 1,000 ft are good to 1e-8 of the time."""


@dataclass(frozen=True)
class NominalState:
    """State of the nominal descent at n altitudes, see :func:`nominal_state`; every field is ``(..., n)``.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> state = nominal_state(aircraft("A320"), torch.tensor([6000.0]))
        >>> bool(state.drag_n > state.thrust_n), round(float(state.rate_mps), 1)
        (True, -9.4)
    """

    cas_mps: Tensor
    mach: Tensor
    tas_mps: Tensor
    esf: Tensor
    configuration: Tensor
    """Integer codes, see :mod:`descentflow.physics.performance_model`."""
    thrust_n: Tensor
    drag_n: Tensor
    rate_mps: Tensor
    """dHp/dt, negative in descent."""
    fuel_kg_s: Tensor


@dataclass(frozen=True)
class NominalDescent(NominalState):
    """A nominal descent, see :func:`nominal_descent`: ``level_fl`` (L,) ascending flight levels, all else (..., L).

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> descent = nominal_descent(aircraft("A320"), torch.arange(150, 351))
        >>> round(float(descent.time_s[0]) / 60, 1), float(descent.time_s[-1])  # minutes from FL350 to FL150
        (10.0, 0.0)
    """

    level_fl: Tensor
    time_s: Tensor
    """Time since the top level: zero there, growing downwards."""


def nominal_state(
    aircraft: PerformanceModel,
    altitude_m: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
    expedited: bool = False,
) -> NominalState:
    """Speeds, forces and rate of the nominal descent at any pressure altitudes (manual 3.2 to 3.9 and 4.3).

    The engines idle, or in approach and landing configuration hold the model's angle of descent where it has one.
    The schedule's steps in speed are taken at once, without the energy they set free: BADA's own tables do the same.

    Args:
        aircraft: Coefficients of the type; tensor coefficients must broadcast against ``altitude_m``.
        altitude_m: Pressure altitude.
        mass_kg: Mass, broadcasts; the reference mass when None.
        deviation_k: Temperature deviation from ISA, broadcasts.
        expedited: Descend with spoilers, (manual 3.7.1).

    Returns:
        The state, every field of the broadcast shape.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> bool((nominal_state(open_aircraft("A320"), torch.linspace(5e3, 1e4, 9)).rate_mps < 0).all())
        True
    """
    altitude, deviation = as_tensors(altitude_m, deviation_k)
    cas = aircraft.descent_cas_mps(altitude, mass_kg)
    mach = cas_to_mach(cas, altitude)
    tas = mach_to_tas_mps(mach, altitude, deviation)
    esf = energy_share_factor(mach, altitude, aircraft.holds_mach(altitude), deviation)
    configuration = aircraft.descent_configuration(altitude, cas, mass_kg)
    thrust = aircraft.idle_thrust_n(altitude, tas, deviation, configuration)
    drag = aircraft.drag_n(tas, altitude, deviation, mass_kg, configuration, expedited=expedited)
    if aircraft.approach_angle_rad:
        mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg
        powered = drag - sin(aircraft.approach_angle_rad) * mass * G0_MPS2 / esf
        thrust = by_configuration(configuration, thrust, powered, powered)
    rate = descent_rate_mps(aircraft, drag, thrust, tas, esf, altitude, deviation, mass_kg)
    idle, powered = (
        aircraft.idle_fuel_flow_kg_s(altitude, tas, deviation),
        aircraft.fuel_flow_kg_s(altitude, tas, thrust, deviation),
    )
    fuel = by_configuration(configuration, idle, powered, powered)
    fields = broadcast(cas, mach, tas, esf, configuration, thrust, drag, rate, fuel)
    return NominalState(*fields)


def nominal_descent(
    aircraft: PerformanceModel,
    levels_fl: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
    expedited: bool = False,
) -> NominalDescent:
    """Fly the nominal BADA descent from the top level of a grid to its bottom (manual 3.2-7 and 4.3).

    Crews at the places of the record of open types flew slower than the schedule, whose time is 24 % short (median).

    Time is the integral of ``dHp / rate`` by two-point Gauss in cells that end at every level and at every altitude
    where the rate jumps (transition, tropopause, H_p,des, the schedule's steps), so it does not depend on the spacing
    of the grid.

    Args:
        aircraft: Coefficients of the type; tensor coefficients must broadcast against ``(..., n_levels)``, so they
            need a last dimension of one.
        levels_fl: Flight levels, ``(n_levels,)``, strictly ascending.
        mass_kg: One mass per descent, ``(...)`` (a dimension for the levels is added); the reference mass when None.
        deviation_k: One temperature deviation per descent, ``(...)``.
        expedited: Descend with spoilers, see :func:`nominal_state`.

    Returns:
        The descent, fields of shape ``(..., n_levels)``.

    Raises:
        AircraftError: If the levels do not ascend, or if drag does not exceed thrust somewhere on the way.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> descent = nominal_descent(open_aircraft("A320"), torch.arange(150, 371), torch.tensor([55e3, 65e3]))
        >>> descent.time_s.shape
        torch.Size([2, 221])
    """
    levels = _checked(as_tensors(levels_fl)[0], aircraft)
    mass = mass_kg[..., None] if isinstance(mass_kg, Tensor) else mass_kg
    deviation = deviation_k[..., None] if isinstance(deviation_k, Tensor) else deviation_k

    def state_at(altitude_m: Tensor) -> NominalState:
        return nominal_state(aircraft, altitude_m, mass, deviation, expedited)

    altitude = levels * FL_M
    state = state_at(altitude)
    time = _time_from_top(
        lambda altitude_m: state_at(altitude_m).rate_mps, altitude, _jumps_m(aircraft, altitude), aircraft
    )
    time, _ = broadcast(time, state.rate_mps)
    shared = {name: getattr(state, name) for name in NominalState.__dataclass_fields__}
    return NominalDescent(level_fl=levels, time_s=time, **shared)


def _checked(levels: Tensor, aircraft: PerformanceModel) -> Tensor:
    if levels.dim() != 1 or not bool((levels.diff() > 0).all()):
        raise AircraftError(
            f"levels of shape {tuple(levels.shape)} for {aircraft.typecode}",
            expected="one dimension of strictly ascending flight levels",
            mend="sort the levels and drop repeats; one grid serves the whole batch",
        )
    return levels


def _jumps_m(aircraft: PerformanceModel, altitude: Tensor) -> list[Tensor]:
    """Altitudes where the rate jumps: every threshold of the model."""
    fixed = [TROPOPAUSE_M, *aircraft.schedule_breaks_m()]
    moving = [aircraft.transition_altitude_m(), *aircraft.thrust_breaks_m()]
    cells = torch.arange(altitude[0].item(), altitude[-1].item(), _CELL_M, dtype=altitude.dtype, device=altitude.device)
    return [altitude.new_tensor(fixed), cells, *(m.to(altitude.dtype).reshape(m.shape or (1,)) for m in moving)]


def _time_from_top(
    rate_mps: Callable[[Tensor], Tensor], altitude: Tensor, jumps: list[Tensor], aircraft: PerformanceModel
) -> Tensor:
    """Integrate from the top level down to each level, cell by cell between levels and jumps."""
    batch = broadcast(*(j[..., :1] for j in jumps))[0].shape[:-1]
    parts = [altitude, *(j.clamp(altitude[0], altitude[-1]) for j in jumps)]
    edges, order = torch.cat([p.expand(*batch, p.shape[-1]) for p in parts], dim=-1).sort(dim=-1, stable=True)
    middle, half = (edges[..., 1:] + edges[..., :-1]) / 2, edges.diff(dim=-1) / 2
    rates = [rate_mps(middle + sign * half / 3**0.5) for sign in (-1, 1)]
    if not all(bool((r < 0).all()) for r in rates):
        raise AircraftError(
            f"{aircraft.typecode} does not descend everywhere between {altitude[0]:.0f} and {altitude[-1]:.0f} m",
            expected="drag above idle thrust at every altitude",
            mend="check mass, temperature deviation and coefficients",
        )
    duration = -half * (1 / rates[0] + 1 / rates[1])
    fallen = duration.flip(-1).cumsum(-1).flip(-1)
    at_edges = torch.cat([fallen, torch.zeros_like(fallen[..., :1])], dim=-1)
    places = order.argsort(dim=-1)[..., : altitude.shape[0]]
    return at_edges.gather(-1, places.expand(*at_edges.shape[:-1], places.shape[-1]))
