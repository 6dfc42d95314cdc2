"""Batched integration of BADA's rate equation from drag and CAS on the grid (paper, equation 2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from descentflow.core.constants import KAPPA, R_AIR
from descentflow.core.tensors import Number
from descentflow.core.threads import one_thread
from descentflow.core.units import FL_M
from descentflow.physics.airspeed import cas_to_mach
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.physics.energy import energy_share_factor, energy_share_factor_local, slope_per_m
from descentflow.physics.fuel import Burn, burn
from descentflow.physics.level_table import NO_ARRAYS, level_rate
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.flight_grid import FlightGrid, flight_grid

CHUNK_VALUES = 1 << 18
"""Values of a quantity in one chunk on the CPU: the handful of arrays in use stay in the caches."""
GPU_CHUNK_VALUES = 1 << 26
"""The same for a GPU: enough to fill it, while the arrays between the steps stay below 2 GiB."""


@dataclass(frozen=True)
class Trajectories:
    """n descents on L ascending levels, each from its own entry level down to the lowest.

    Shapes: ``levels_fl`` (L,), ``entry`` (n,) index of the entry level, all else (n, L). ``time_s`` is zero at
    the entry level and grows downwards; levels above the entry have no meaning (``mask`` is false there).

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(4, seed=0))
        >>> len(flown), len(flown.subset(torch.tensor([0, 2])))
        (4, 2)
    """

    levels_fl: Tensor
    entry: Tensor
    time_s: Tensor
    cas_mps: Tensor
    mach: Tensor
    tas_mps: Tensor
    rate_mps: Tensor
    drag_n: Tensor
    aircraft: PerformanceModel | None = None
    """Model that flew them; None where not one flew all."""

    @property
    def mask(self) -> Tensor:
        """(n, L) true at and below the entry level."""
        return torch.arange(len(self.levels_fl), device=self.entry.device) <= self.entry[:, None]

    @property
    def descends(self) -> Tensor:
        """(n,) true where a descent descends at every level."""
        return ((self.rate_mps < 0) | ~self.mask).all(1)

    def __len__(self) -> int:
        """Number of descents."""
        return len(self.entry)

    def subset(self, index: Tensor | slice) -> "Trajectories":
        """The descents at these positions, or where a bool mask (n,) is true."""
        return replace(self, **{name: getattr(self, name)[index] for name in OF_FLIGHTS})

    def put(self, places: Tensor, descents: "Trajectories") -> None:
        """Overwrite the descents at these positions."""
        for name in OF_FLIGHTS:
            getattr(self, name)[places] = getattr(descents, name)


OF_FLIGHTS = ("entry", "time_s", "cas_mps", "mach", "tas_mps", "rate_mps", "drag_n")
"""Fields with a row for each descent."""


def rows_at_once(values: Tensor) -> int:
    """Number of rows of values (n, L) whose chunk the caches hold.

    Example:
        >>> rows_at_once(torch.zeros(10_000, 128))
        2048
    """
    return max((GPU_CHUNK_VALUES if values.is_cuda else CHUNK_VALUES) // values.shape[1], 1)


def summed_from_entry(legs: Tensor, entry: Tensor, out: Tensor | None = None) -> Tensor:
    """Sums (n, L) of legs (n, L - 1) from each entry level (n,) downwards, zero there and negative above.

    Args:
        legs: Between neighbouring levels; all but the first column of ``out`` where that is given.
        entry: Index of the level.
        out: (n, L) for the result.

    Example:
        >>> summed_from_entry(torch.tensor([[1.0, 2.0, 4.0]]), torch.tensor([2]))
        tensor([[ 3.,  2.,  0., -4.]])
    """
    if out is None:
        whole = torch.nn.functional.pad(legs.cumsum(1), (1, 0))
    else:
        out[:, 0] = 0
        torch.cumsum(legs, 1, out=out[:, 1:])
        whole = out
    return torch.sub(whole.gather(1, entry[:, None].to(whole.device)), whole, out=out)


def through_air_m(flown: Trajectories) -> Tensor:
    """Distance (n, L) through the air since entry: horizontal speed is taken as linear in time.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(3, seed=0))
        >>> bool((through_air_m(flown)[:, 0] > 100 * flown.time_s[:, 0]).all())  # m/s
        True
    """
    speed = (flown.tas_mps.square() - flown.rate_mps.square()).clamp(min=0.0).sqrt()
    legs = torch.where(flown.mask[:, 1:], flown.time_s[:, :-1] - flown.time_s[:, 1:], 0.0)
    return summed_from_entry(0.5 * (speed[:, 1:] + speed[:, :-1]) * legs, flown.entry)


def burn_of(flown: Trajectories) -> Burn | None:
    """Thrust and fuel flow (n, L) in the air whose temperature Mach number and TAS give; None where no model is known.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(3, seed=0))
        >>> bool((burn_of(flown).flow_kg_s[flown.mask] > 0.05).all())
        True
    """
    if flown.aircraft is None:
        return None
    altitude_m = (flown.levels_fl * FL_M).to(flown.cas_mps)
    deviation_k = (flown.tas_mps / flown.mach).square() / (KAPPA * R_AIR) - isa_temperature_k(altitude_m)
    slope = slope_per_m(flown.cas_mps, altitude_m)
    return burn(flown.aircraft, flown.cas_mps, altitude_m, flown.rate_mps, slope, deviation_k)


def concatenate(parts: Sequence[Trajectories]) -> Trajectories:
    """Join batches on one grid.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> flown = model.representation.decoder(model.sample(4, seed=0))
        >>> len(concatenate([flown, flown]))
        8
    """
    if len(parts) == 1:
        return parts[0]
    joined: dict[str, Any] = {name: torch.cat([getattr(part, name) for part in parts]) for name in OF_FLIGHTS}
    return replace(parts[0], **joined)


def integrate(
    aircraft: PerformanceModel,
    levels_fl: Tensor,
    altitude_m: Tensor,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    mass_kg: Number | None = None,
    deviation_k: Number = 0.0,
    *,
    wind_mps: Tensor | None = None,
    exact_energy_share: bool = False,
    out: Trajectories | None = None,
    grid: FlightGrid | None = None,
) -> Trajectories:
    """Fly drag and CAS profiles down the grid.

    With drag and CAS given on the grid the rate is known at every level, so time is a quadrature of
    ``dh / rate``: the trapezoid rule between levels, and between a level and each side of a jump of the rate
    (:mod:`~descentflow.representation.decoder.flight_grid`), where drag and CAS are continued from that side.

    The energy share factor is BADA's by default, of constant Mach above the transition altitude and of constant CAS
    below: the paper leaves BADA's algorithm unchanged, drag was inferred with the same factor, so that rates come back
    as observed, and it needs no derivative of noisy speeds. The exact one follows the CAS profile.

    Args:
        aircraft: Coefficients; tensors among them are differentiated through.
        levels_fl: (L,) ascending levels.
        altitude_m: (L,) their pressure altitude, in the precision wanted.
        drag_n: (n, L).
        cas_mps: (n, L).
        entry: (n,) index of the level where each descent starts.
        mass_kg: Mass, () or (n, 1); the reference mass if absent.
        deviation_k: ISA temperature deviation.
        wind_mps: (L,) or (n, L) along-track wind, positive from behind; its slope changes the energy share.
        exact_energy_share: Take the slope of the CAS itself for the energy share factor.
        out: Descents of the same shape, no longer needed, whose arrays may be reused for the result: on the CPU
            allocating memory can take longer than the computation.
        grid: What was tabulated of the levels for the same coefficients, mass and deviation, in the profiles'
            precision; computed here if absent.

    Returns:
        The trajectories. A rate that is not negative gives times that are not finite or not increasing; the
        sampler rejects those.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> levels_fl = torch.arange(150, 351).double()
        >>> drag_n, cas_mps = torch.full((1, 201), 45e3).double(), torch.full((1, 201), 140.0).double()
        >>> flown = integrate(aircraft("A320"), levels_fl, levels_fl * 30.48, drag_n, cas_mps, torch.tensor([200]))
        >>> round(float(flown.time_s[0, 0]) / 60)  # minutes from FL350 to FL150
        8
    """
    grid = grid or flight_grid(aircraft, altitude_m, mass_kg, deviation_k)
    shares: tuple[Tensor | None, Tensor | None] = None, None
    if wind_mps is not None or exact_energy_share:
        slope = slope_per_m(cas_mps, altitude_m) if exact_energy_share else torch.zeros_like(cas_mps)
        wind = torch.zeros_like(altitude_m) if wind_mps is None else slope_per_m(wind_mps, altitude_m)
        shares = _shares(aircraft, grid, cas_mps, deviation_k, wind, slope, exact_energy_share)
    differentiated = not grid.is_plain or drag_n.requires_grad or cas_mps.requires_grad
    if differentiated or shares[0] is not None or torch.compiler.is_compiling():
        extra_s = _at_jumps_s(grid, drag_n, cas_mps, shares[1])
        arrays = _on_levels(grid, drag_n, cas_mps, entry, extra_s, shares[0])
    else:
        arrays = _in_chunks(grid, drag_n, cas_mps, entry, out)
    time_s, mach, tas_mps, rate_mps = arrays
    own: PerformanceModel | None = aircraft
    if mass_kg is not None:
        own = aircraft.at_mass(mass_kg) if grid.is_plain else None
    return Trajectories(levels_fl, entry, time_s, cas_mps, mach, tas_mps, rate_mps, drag_n, own)


def _at_jumps_s(grid: FlightGrid, drag_n: Tensor, cas_mps: Tensor, energy_share: Tensor | None = None) -> Tensor:
    """Time (n, b) that each side of the jumps adds to its cell; the energy share factor is the grid's if absent."""
    drag, cas = (grid.breaks.continued(values) for values in (drag_n, cas_mps))
    return level_rate(grid.sides, drag, cas, energy_share)[3] * grid.breaks.extra_m


def _on_levels(
    grid: FlightGrid,
    drag_n: Tensor,
    cas_mps: Tensor,
    entry: Tensor,
    extra_s: Tensor,
    energy_share: Tensor | None = None,
    out: tuple[Tensor | None, ...] = (None, *NO_ARRAYS),
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Time, Mach number, TAS and rate, of levels and what jumps add; the energy share factor is the grid's if absent.

    Arrays to write into are those of the result, and one more; without them, all is one expression, which can be
    differentiated and traced.
    """
    of_time, *of_rates = out
    mach, tas_mps, rate_mps, slowness = level_rate(grid.levels, drag_n, cas_mps, energy_share, of_rates)
    of_legs = None if of_time is None else of_time[:, 1:]
    # Sums and products one by one: a product of matrices would sum in another order in another batch.
    legs = torch.mul(slowness[:, :-1], grid.breaks.lower_m, out=of_legs)
    legs = torch.addcmul(legs, slowness[:, 1:], grid.breaks.upper_m, out=of_legs)
    for place, cell in enumerate(grid.breaks.cells):
        legs[:, cell] += extra_s[:, place]
    return summed_from_entry(legs, entry, of_time), mach, tas_mps, rate_mps


def _in_chunks(
    grid: FlightGrid, drag_n: Tensor, cas_mps: Tensor, entry: Tensor, out: Trajectories | None
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The same without gradients, in chunks that the processor's caches hold.

    On the CPU the system may take longer to hand out new memory than the descents take to compute.
    """
    reused = [None] * 4 if out is None else [out.time_s, out.mach, out.tas_mps, out.rate_mps]
    time_s, mach, tas_mps, rate_mps = (torch.empty_like(drag_n) if one is None else one for one in reused)
    whole = time_s, mach, tas_mps, rate_mps
    size = rows_at_once(drag_n)
    spare = torch.empty_like(drag_n[:size])
    # On one thread: at every step of a chunk, several would wait for each other longer than they work.
    with one_thread(), torch.no_grad():
        extra_s = _at_jumps_s(grid, drag_n, cas_mps)
        for start in range(0, len(drag_n), size):
            part = slice(start, start + size)
            arrays = *(values[part] for values in whole), spare[: len(entry[part])]
            _on_levels(grid, drag_n[part], cas_mps[part], entry[part], extra_s[part], out=arrays)
    return whole


def _shares(
    aircraft: PerformanceModel,
    grid: FlightGrid,
    cas_mps: Tensor,
    deviation_k: Number,
    wind_slope_per_s: Tensor,
    cas_slope_per_s: Tensor,
    exact: bool,
) -> tuple[Tensor, Tensor]:
    """Energy share factor in a wind, exactly that of the CAS profile or not, at the levels and at the jumps' sides."""

    def share(altitude_m: Tensor, cas: Tensor, wind: Tensor, slope: Tensor) -> Tensor:
        if exact:
            return energy_share_factor_local(cas, altitude_m, slope, wind, deviation_k)
        at_mach = aircraft.holds_mach(altitude_m)
        return energy_share_factor(cas_to_mach(cas, altitude_m), altitude_m, at_mach, deviation_k, wind)

    at_sides = grid.breaks.continued
    return (
        share(grid.altitude_m, cas_mps, wind_slope_per_s, cas_slope_per_s),
        share(grid.breaks.altitude_m, at_sides(cas_mps), at_sides(wind_slope_per_s), at_sides(cas_slope_per_s)),
    )
