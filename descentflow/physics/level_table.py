"""The clean idle descent on fixed levels: what depends on the level alone is tabulated, and the rate in between.

The equations are those of :mod:`airspeed`, :mod:`energy` and the performance model, from which the table is filled;
only their order is new. With ``x = 1 + 0.2 (CAS/c)^2`` the impact pressure is ``r = (x^3.5 - 1) p0/p + 1``, and
``y = r^(2/7) = 1 + 0.2 M^2`` gives Mach, and the energy share ``1 / (1 + lapse (y - 1) + y - y/r)``: one logarithm,
one exponential and two square roots a value, where the equations' own order takes four general powers, of which each
costs as much as all of this. Tests hold the two together.
"""

from collections.abc import Iterator, Sequence
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
NO_ARRAYS = (None, None, None, None)
"""Arrays for a result that there are none of yet."""


@dataclass(frozen=True)
class LevelTable:
    """Constants of L levels for an aircraft, mass and temperature deviation; :func:`level_table` fills it.

    Each is (L,), or (n, L) where coefficients, mass or deviation vary by flight.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> table = level_table(aircraft("A320"), torch.tensor([6000.0, 9000.0]))
        >>> table.thrust[1].shape, bool((table.pressure_ratio > 1).all())
        (torch.Size([2]), True)
    """

    thrust: dict[int, Tensor]
    """Idle thrust times ``per_newton sqrt(y - 1)``, by powers of ``sqrt(y - 1)``; that of 1 is always there."""
    pressure_ratio: Tensor
    """Sea-level pressure over the pressure of the level."""
    pressure_rest: Tensor
    """One minus ``pressure_ratio``."""
    mach_scale: Tensor
    """True airspeed per ``sqrt(y - 1)``."""
    share_rest: Tensor
    """One minus ``lapse``, the weight of ``y - 1`` in the energy share's reciprocal: zero above the tropopause."""
    share_growth: Tensor
    """``lapse`` and ``compression`` together."""
    compression: Tensor
    """Weight of ``y - y/r`` there: one where CAS is held, zero where Mach is."""
    per_newton: Tensor
    """``(T - dT)/T V / (m g0)`` per ``sqrt(y - 1)``: rate for each newton of thrust beyond drag, were all height."""

    def columns(self) -> Iterator[Tensor]:
        """All its tensors."""
        for value in vars(self).values():
            yield from value.values() if isinstance(value, dict) else (value,)


def level_table(
    aircraft: PerformanceModel, altitude_m: Tensor, mass_kg: Number | None = None, deviation_k: Number = 0.0
) -> LevelTable:
    """Tabulate levels (L,) in their precision (manual 3.1, 3.2 and 3.7).

    Args:
        aircraft: Its model; gradients go through numbers that are tensors.
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
    deviation = as_tensors(deviation_k)[0].to(altitude)
    ratio = P0_PA / pressure_pa(altitude)
    mass = aircraft.mass_reference_kg if mass_kg is None else mass_kg

    def placed(column: Tensor) -> Tensor:
        return (column + torch.zeros_like(altitude)).to(altitude_m)

    mach_scale = speed_of_sound_mps(altitude, deviation) / sqrt(HALF)
    lapse = lapse_share(torch.ones_like(altitude), altitude, deviation) / HALF
    compression = (~aircraft.holds_mach(altitude)).double()
    per_newton = mach_scale * isa_fraction(altitude, deviation) / (mass * G0_MPS2)
    columns = ratio, 1 - ratio, mach_scale, 1 - lapse, lapse + compression, compression, per_newton
    terms = aircraft.idle_thrust_terms(altitude, deviation)
    thrust = {power + 1: placed(term * per_newton / sqrt(HALF) ** power) for power, term in terms.items()}
    return LevelTable({1: placed(torch.zeros_like(altitude)), **thrust}, *map(placed, columns))


def level_rate(
    table: LevelTable,
    drag_n: Tensor,
    cas_mps: Tensor,
    energy_share: Tensor | None = None,
    out: Sequence[Tensor | None] = NO_ARRAYS,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Mach, true airspeed, rate and its reciprocal of profiles (manual 3.1-23, 3.2-7 to 3.2-11).

    Differentiable and traceable where ``out`` is not given.

    Args:
        table: Constants of the L levels.
        drag_n: (n, L).
        cas_mps: (n, L).
        energy_share: (n, L) energy share factor, in place of that of the table.
        out: Arrays for the result.

    Returns:
        Each (n, L); the reciprocal is slowness in s/m, negative in descent as the rate is.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> table = level_table(open_aircraft("A320"), torch.tensor([6000.0, 6100.0]))
        >>> mach, tas_mps, rate_mps, slowness = level_rate(table, torch.full((1, 2), 40e3), torch.full((1, 2), 150.0))
        >>> bool((rate_mps < 0).all())  # it descends
        True
    """
    # Results that later steps overwrite are written into the arrays of the result; None makes new ones.
    of_mach, of_tas, of_rate, spare = out
    # Impact pressure, 3.1-23: x^3.5 = x^4 / sqrt(x), for a root's reciprocal costs half of the root.
    x = torch.addcmul(cas_mps.new_ones(()), cas_mps, cas_mps, value=HALF / CAS_SCALE_MPS**2, out=of_rate)
    square = torch.mul(x, x, out=of_tas)
    power = torch.mul(torch.mul(square, square, out=of_tas), torch.rsqrt(x, out=of_rate), out=of_rate)
    r = torch.addcmul(table.pressure_rest, power, table.pressure_ratio, out=of_rate)
    # y = r^(2/7) by logarithm and exponential: a general power, right to the last bit, takes thrice as long.
    y = torch.exp(torch.mul(torch.log(r, out=of_tas), INVERSE_EXPONENT, out=of_tas), out=of_tas)
    # Reciprocal of the energy share, 3.2-8 to 3.2-11: 1 + lapse (y - 1) + compression (y - y/r).
    growth = torch.addcdiv(table.share_growth, table.compression, r, value=-1, out=of_rate)
    share = torch.addcmul(table.share_rest, y, growth, out=of_rate)
    root = torch.reciprocal(torch.rsqrt(torch.sub(y, 1.0, out=of_tas), out=of_tas), out=of_tas)
    mach = torch.mul(root, 1 / sqrt(HALF), out=of_mach)
    # Rate of the energy equation, 3.2-7, from thrust less drag.
    drag = torch.addcmul(table.thrust[1], drag_n, table.per_newton, value=-1, out=spare)
    excess = _polynomial({**table.thrust, 1: drag}, root, spare)
    tas = torch.mul(root, table.mach_scale, out=of_tas)
    rate = torch.div(excess, share, out=of_rate) if energy_share is None else excess * energy_share
    return mach, tas, rate, torch.reciprocal(rate, out=spare)


def _polynomial(terms: dict[int, Tensor], root: Tensor, spare: Tensor | None) -> Tensor:
    """Sum of terms by powers of a root (Horner), from the highest or, where some are negative, from the lowest.

    The term of power 1 may lie in ``spare``, which is written to where nothing else is needed of it.
    """
    first, *others = sorted(terms, reverse=min(terms) >= 0)
    total, last, steps = terms[first], first, {1: root}
    for power in others:
        step = last - power
        if step not in steps:
            steps[step] = root**step
        total, last = torch.addcmul(terms[power], total, steps[step], out=spare if first == 1 else None), power
    return total if last == 0 else total * root**last
