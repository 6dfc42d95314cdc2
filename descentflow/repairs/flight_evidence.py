r"""Rates of single flights in bands of altitude, and those of the energy equation for given coefficients.

A flight in free descent shows drag minus idle thrust over its mass, at its own speed and density,

.. math:: \frac{D - T_\mathrm{idle}}{m} = -\frac{g}{\tau V f}\,\frac{dH_p}{dt},

with the exact energy share f of its own CAS, and the temperature and the wind that it measured. So the logarithm of its
rate of descent is that of this equation plus an error, and moves with CD0, CD2 and idle thrust.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.measured_air import measured_airs
from descentflow.core.errors import DataError
from descentflow.core.linear_gaussian import Array
from descentflow.core.units import FL_M
from descentflow.diagnosis.sides.assumptions import ASSUMED
from descentflow.diagnosis.sides.compared_state import state_of
from descentflow.effects.flight_state import FlightState, log_rate
from descentflow.measurements.quantities import Quantities, grid_of, measured
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.physics.airspeed import mach_to_tas_mps
from descentflow.physics.atmosphere import isa_fraction
from descentflow.physics.performance_model import PerformanceModel

BAND_FL = 20.0
"""Height of a band: reports 30 s apart still show the slope of the CAS over it. Bands begin at its multiples, so that
10,000 ft and nearly the tropopause are ends of bands: idle thrust and energy share jump there."""
STEP = 0.02
"""Of a factor, for derivatives."""
SHALLOWEST = 1.0 / 30.0
"""Least drag minus thrust over weight of a descent at idle: airliners glide at 17 to 20 to one, and no noise of reports
makes that 30. Bands below it have thrust above idle, or a held path, and show neither drag nor idle thrust."""


@dataclass(frozen=True)
class FlightEvidence:
    """Flights of one type in bands.

    Shapes: ``log_rate`` (n, K) ln of the rate of descent by altitude over time, m/s, NaN where not seen or not settled;
    ``deviation_k``, ``wind_slope_per_s`` (n, K) of each flight's own air; ``turning`` (n, K) the share by which turns
    raise its induced drag.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> evidence = flight_evidence(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> evidence.log_rate.shape, evidence.without_air
        (torch.Size([120, 11]), 0)
    """

    quantities: Quantities
    state: FlightState
    log_rate: Tensor
    deviation_k: Tensor
    wind_slope_per_s: Tensor
    turning: Tensor
    without_air: int
    """Flights that did not measure their air: they have the mean of the others', or standard air."""
    powered: int
    """Bands left out because their descent is shallower than any at idle."""

    @property
    def seen(self) -> Tensor:
        """Bands (n, K) with a rate."""
        return self.log_rate.isfinite()

    def expected(
        self,
        aircraft: PerformanceModel | None = None,
        *,
        mass: float = 1.0,
        parasitic: float = 1.0,
        induced: float = 1.0,
        idle: float = 1.0,
    ) -> Tensor:
        """Ln of the rate (n, K) at the flights' own speeds, turns and air, for an aircraft and factors of it."""
        state = self.state if aircraft is None else replace(self.state, aircraft=aircraft)
        return log_rate(
            state,
            mass=mass,
            thrust=idle,
            parasitic=parasitic,
            induced=induced * (1 + self.turning),
            deviation_k=self.deviation_k,
            wind_slope_per_s=self.wind_slope_per_s,
        )

    def columns(self, theta: Array) -> tuple[Array, Array, Array]:
        """Ln rate (n, K) at ln CD0, ln CD2 and relative idle thrust (3,), its derivatives (n, K, 3) and by ln mass."""

        def at(moved: Array, mass: float = 1.0) -> Array:
            zero, two, idle = moved
            expected = self.expected(mass=mass, parasitic=np.exp(zero), induced=np.exp(two), idle=1 + idle)
            return np.asarray(expected.numpy())

        steps = STEP * np.eye(3)
        by_theta = np.stack([(at(theta + step) - at(theta - step)) / (2 * STEP) for step in steps], 2)
        return at(theta), by_theta, (at(theta, 1 + STEP) - at(theta, 1 - STEP)) / (2 * STEP)

    def rows(self, index: Array) -> "FlightEvidence":
        """The flights at these positions."""
        at = torch.from_numpy(np.asarray(index, dtype=np.int64))
        parts = {name: getattr(self, name)[at] for name in ("log_rate", "deviation_k", "wind_slope_per_s", "turning")}
        return replace(self, quantities=self.quantities.rows(at), state=self.state.rows(at), **parts)

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.log_rate)


def flight_evidence(
    frame: pl.DataFrame, aircraft: PerformanceModel, around: pl.DataFrame | None = None
) -> FlightEvidence:
    """Measure the flights of one type as the diagnosis does: settled, free descent in bands, in their own air.

    Args:
        frame: Prepared descents of the type.
        aircraft: Coefficients; their reference mass is the mass.
        around: Descents of all types there, whose mean air flights have that did not measure theirs; else ``frame``.

    Raises:
        DataError: If no flight shows a whole band.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> evidence = flight_evidence(pl.read_parquet("descents.parquet"), aircraft("A320"))
        >>> bool((evidence.log_rate - evidence.expected()).nanmean().abs() < 0.2)
        True
    """
    levels = frame["level_fl"].to_numpy()
    low, high = BAND_FL * math.ceil(float(levels.min()) / BAND_FL), float(levels.max())
    if high - low < BAND_FL:
        raise _nothing(aircraft)
    quantities = measured(grid_of(frame, low, high, CHANNELS), BAND_FL)
    state = state_of(quantities, aircraft, float(aircraft.mass_reference_kg))
    rate = quantities.physics["log_rate"] - quantities.values["lag"].nan_to_num(0.0)
    settled = quantities.physics["depth_m"] >= ASSUMED.settled_m
    rate = torch.where(settled, rate, torch.nan)
    kept = torch.nonzero(rate.isfinite().any(1))[:, 0]
    if not len(kept):
        raise _nothing(aircraft)
    quantities, state, rate = quantities.rows(kept), state.rows(kept), rate[kept]
    deviation, slope, without = _own_air(frame if around is None else around, quantities)
    turning = quantities.physics.get("turning", torch.zeros_like(rate)).nan_to_num(0.0)
    share = state.share_terms.factor(slope, deviation)
    tas = mach_to_tas_mps(state.mach(), state.altitude_m, deviation)
    shallow = rate.exp() / (isa_fraction(state.altitude_m, deviation) * tas * share) < SHALLOWEST
    rate = torch.where(shallow, torch.nan, rate)
    return FlightEvidence(quantities, state, rate, deviation, slope, turning, without, int(shallow.sum()))


def _nothing(aircraft: PerformanceModel) -> DataError:
    return DataError(
        f"no free descent of {aircraft.typecode} over {100 * BAND_FL:,.0f} ft",
        expected="flights that descend freely through whole bands",
        mend="prepare with a lower --bottom-fl, or give more flights",
    )


def _own_air(frame: pl.DataFrame, quantities: Quantities) -> tuple[Tensor, Tensor, int]:
    """Temperature deviation and growth of the wind (n, K) of each flight, and how many did not measure theirs."""
    low, high = quantities.levels_fl
    levels = torch.arange(low, high + 1, dtype=torch.float64)
    shape = quantities.physics["log_rate"].shape
    try:
        airs = measured_airs(frame, levels)
    except DataError:
        return torch.zeros(shape), torch.zeros(shape), len(quantities)
    middle = quantities.altitude_m / FL_M
    inside = ((levels[:, None] - middle).abs() <= quantities.band_fl / 2).double()
    inside = inside / inside.sum(0)
    slopes = airs.air.slopes(levels * FL_M)[1] * airs.known
    by_name = {name: i for i, name in enumerate(airs.flight_ids)}
    at = [by_name.get(name, -1) for name in quantities.names]
    both = []
    for values in (airs.air.deviation_k @ inside, slopes @ inside):
        filled = values.mean(0).expand(shape).clone()
        for row, i in enumerate(at):
            if i >= 0:
                filled[row] = values[i]
        both.append(filled)
    return both[0], both[1], sum(i < 0 for i in at)
