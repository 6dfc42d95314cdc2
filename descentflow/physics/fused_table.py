"""The clean idle descent on a fixed grid, arranged for speed: what depends on the level alone is tabulated.

The equations are those of :mod:`airspeed`, :mod:`energy` and :mod:`forces`, from which the table is filled; only
their order is new. With ``x = 1 + 0.2 (CAS/c)^2`` the impact pressure is ``r = (x^3.5 - 1) p0/p + 1``, and
``y = r^(2/7) = 1 + 0.2 M^2`` gives Mach, and the energy share ``1 / (1 + lapse M^2 + y - y/r)``: one general power
and two square roots a value, where the plain form takes four powers. Tests hold the two together.
"""

from dataclasses import dataclass
from math import sqrt

import torch
from torch import Tensor

from descentflow.core.constants import G0_MPS2, KAPPA, P0_PA
from descentflow.core.tensors import Number, as_tensors
from descentflow.physics.airspeed import CAS_SCALE_MPS
from descentflow.physics.atmosphere import isa_fraction, pressure_pa, speed_of_sound_mps
from descentflow.physics.energy import lapse_share
from descentflow.physics.performance_model import PerformanceModel

HALF = (KAPPA - 1) / 2
INVERSE_EXPONENT = (KAPPA - 1) / KAPPA


@dataclass(frozen=True)
class LevelTable:
    """Constants of each level (L,) for one aircraft, mass and temperature deviation; :func:`level_table` fills it.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> table = level_table(aircraft("A320"), torch.tensor([6000.0, 9000.0]))
        >>> table.thrust_n.shape, bool((table.pressure_ratio > 1).all())
        (torch.Size([2]), True)
    """

    pressure_ratio: Tensor
    """Sea-level pressure over the pressure of the level."""
    pressure_rest: Tensor
    """One minus ``pressure_ratio``."""
    mach_scale: Tensor
    """True airspeed per ``sqrt(y - 1)``."""
    lapse: Tensor
    """Weight of ``y - 1`` in the energy share: zero above the tropopause."""
    compression: Tensor
    """Weight of ``y - y/r``: one where CAS is held, zero where Mach is."""
    thrust_n: Tensor
    thrust_power_w: Tensor
    """Part of the thrust that falls with speed (turboprops), times speed."""
    power_scale: Tensor
    """``(T - dT)/T / (m g0)``: rate for each watt of excess power."""


def level_table(
    aircraft: PerformanceModel, altitude_m: Tensor, mass_kg: Number | None = None, deviation_k: Number = 0.0
) -> LevelTable:
    """Tabulate a grid (L,) in its precision (manual 3.1, 3.2 and 3.7).

    Args:
        aircraft: Coefficients, all floats.
        altitude_m: (L,) pressure altitude.
        mass_kg: Mass; the reference mass if absent.
        deviation_k: ISA temperature deviation.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> level_table(open_aircraft("A320"), torch.tensor([9000.0, 12000.0])).compression  # Mach is held at both
        tensor([1., 0.])
    """
    # Filled in float64 and rounded once.
    altitude = altitude_m.double()
    one, deviation = torch.ones_like(altitude), as_tensors(deviation_k)[0].to(altitude)
    ratio = P0_PA / pressure_pa(altitude)
    slow, fast = (aircraft.idle_thrust_n(altitude, speed * one, deviation) for speed in (100.0, 200.0))
    # Every engine's thrust is a constant plus a term in 1/V: two speeds determine both.
    falling = (slow - fast) * 200.0
    mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg
    columns = (
        ratio,
        1 - ratio,
        speed_of_sound_mps(altitude, deviation) / sqrt(HALF),
        lapse_share(one, altitude, deviation) / HALF,
        (~aircraft.holds_mach(altitude)).double(),
        2 * fast - slow,
        falling,
        isa_fraction(altitude, deviation) / (mass * G0_MPS2),
    )
    return LevelTable(*(column.to(altitude_m).expand(altitude_m.shape).contiguous() for column in columns))


def level_rate(table: LevelTable, drag_n: Tensor, cas_mps: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Mach, true airspeed, rate and slowness as :func:`fused_rate` (manual 3.1-23, 3.2-7 to 3.2-11), to be traced.

    Args:
        table: Constants of the L levels.
        drag_n: (n, L).
        cas_mps: (n, L).

    Returns:
        Each (n, L); slowness in s/m, negative in descent.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> table = level_table(open_aircraft("A320"), torch.tensor([6000.0, 6100.0]))
        >>> mach, tas_mps, rate_mps, slowness = level_rate(table, torch.full((1, 2), 40e3), torch.full((1, 2), 150.0))
        >>> bool((rate_mps < 0).all())  # it descends
        True
    """
    x = HALF / CAS_SCALE_MPS**2 * cas_mps * cas_mps + 1.0
    r = table.pressure_rest + table.pressure_ratio * (x * x * x * torch.sqrt(x))
    y = r**INVERSE_EXPONENT
    root = torch.sqrt(y - 1.0)
    inverse_share = 1.0 + table.compression * (y - y / r) + table.lapse * (y - 1.0)
    tas = root * table.mach_scale
    power = table.thrust_power_w + (table.thrust_n - drag_n) * tas
    rate = power * table.power_scale / inverse_share
    return root * (1 / sqrt(HALF)), tas, rate, 1.0 / rate


def fused_rate(table: LevelTable, drag_n: Tensor, cas_mps: Tensor, out: tuple[Tensor, ...]) -> None:
    """Mach, true airspeed, rate and its reciprocal of profiles (n, L), in place (manual 3.1-23, 3.2-7 to 3.2-11).

    Args:
        table: Constants of the L levels.
        drag_n: (n, L).
        cas_mps: (n, L).
        out: Mach, TAS, rate and slowness (s/m, negative in descent), each (n, L).

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> table = level_table(open_aircraft("A320"), torch.tensor([6000.0, 6100.0]))
        >>> out = tuple(torch.empty(1, 2) for _ in range(4))
        >>> fused_rate(table, torch.full((1, 2), 40e3), torch.full((1, 2), 150.0), out)
        >>> bool((out[2] < 0).all())  # it descends
        True
    """
    mach, tas, rate, scratch = out
    torch.mul(cas_mps, cas_mps, out=rate)
    rate.mul_(HALF / CAS_SCALE_MPS**2).add_(1.0)  # x
    torch.sqrt(rate, out=scratch)
    torch.mul(rate, rate, out=tas)
    rate.mul_(tas).mul_(scratch)  # x^3.5
    torch.addcmul(table.pressure_rest, rate, table.pressure_ratio, out=rate)  # r
    torch.pow(rate, INVERSE_EXPONENT, out=tas)  # y
    torch.div(tas, rate, out=rate)
    torch.sub(tas, rate, out=rate)  # y - y/r
    tas.sub_(1.0)  # 0.2 M^2
    rate.mul_(table.compression).addcmul_(tas, table.lapse).add_(1.0)  # 1 / f
    tas.sqrt_()
    torch.mul(tas, 1 / sqrt(HALF), out=mach)
    tas.mul_(table.mach_scale)
    torch.sub(table.thrust_n, drag_n, out=scratch)
    torch.addcmul(table.thrust_power_w, scratch, tas, out=scratch)  # excess power
    torch.div(scratch.mul_(table.power_scale), rate, out=rate)
    torch.reciprocal(rate, out=scratch)
