r"""Costs of the gap in aviation units, before and after the named causes.

A flight crosses a band of height :math:`\Delta h` at the rate :math:`R` in :math:`\Delta h / R` seconds and flies
:math:`V \Delta h / R` meanwhile, so that from the top to the bottom of the levels

.. math:: t = \sum_k \overline{\Delta h / R_k}, \qquad s = \sum_k \overline{(V_k + w_k)\, \Delta h / R_k},

where the bars are means over the flights that show band k: flights that begin lower down, or miss a band, say what
they can. The mean rate is height over mean time, :math:`1 / \overline{1 / R_k}`: the wider flights of a side differ,
the more the plain mean exceeds it. Fuel is :func:`~descentflow.physics.fuel.burn` at the rate, over the same seconds.
How fast crews fly differs between aircraft, and with it the time; at equal speed a flight takes
:math:`\Delta h / (e^{y_k} \hat R_k)` in band k, where y is the logarithm of its rate over the polar's at its own speed
and :math:`\hat R` the polar's rate at the simulator's mean speed. Intervals are quantiles over fleets of whole aircraft
drawn with replacement, one fewer than there are (McCarthy and Snowden, The Bootstrap and Finite Population Sampling,
1985: their variance is then unbiased).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor

from descentflow.core.units import FPM_MPS, KT_MPS, NM_M
from descentflow.diagnosis.findings.costs_found import COST_LABELS, Cost, LevelMeans, Measured
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects.flight_state import log_rate
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.fuel import burn

FLEETS = 400
"""Fleets drawn: an end of a 90 % interval is then known to a ninth of a standard error."""
CONFIDENCE = (0.05, 0.95)
LEVEL_PARTS = 3
"""Parts into which the levels are divided besides the whole."""
SUMMED_COSTS = ("time", "time_at_speed", "air_distance", "ground_distance", "fuel")
"""Costs that add up over bands; of the others the mean over bands is given."""
COSTS_OF_FLIGHT = ("level", "slow")
"""Costs with one number for each flight."""


def costs_of(compared: Compared, left: Tensor | None, seed: int) -> list[Cost]:
    """Costs of the gap over all levels that are compared, and over the lower, middle and upper third of them.

    Args:
        compared: Flights of both sides.
        left: (n, p) entries of all flights once the causes are in the simulator's, or off the real ones; None where
            none is named.
        seed: Of the fleets.

    Returns:
        The whole first, then the parts from below; nothing where no rate is compared.
    """
    bands = sorted(e.band for e in compared.entries if e.quantity == "rate")
    if not bands:
        return []
    c, real, generator = compared, compared.real, torch.Generator().manual_seed(seed)
    of_real = _fleets(c.airframe[real], generator)
    own, of_own = (~real, _fleets(c.airframe[~real], generator)) if c.has_simulated else (real, of_real)
    every = flown(c, c.y)
    # Nominal BADA flies each flight's own speed at the polar's rate: a rate of zero beyond the polar.
    normal = every if c.has_simulated else flown(c, 0.0 * c.y)
    sides = [_Side(normal, own, *of_own), _Side(every, real, *of_real)]
    after = []
    if left is not None:
        both = flown(c, left)
        after = [_Side(both if c.has_simulated else normal, own, *of_own), _Side(both, real, *of_real)]
    known = [name for name in COST_LABELS if name in every and bool(normal[name][own].isfinite().any())]
    costs, half = [], compared.band_fl / 2
    for chosen in [bands, *_thirds(bands)] if len(bands) >= LEVEL_PARTS else [bands]:
        low_fl = round(compared.middles_fl()[chosen[0]] - half, 6)
        high_fl = round(compared.middles_fl()[chosen[-1]] + half, 6)
        for name in [name for name in known if name not in COSTS_OF_FLIGHT or chosen is bands]:
            simulator, flights = (side.over(name, chosen) for side in sides)
            before = flights - simulator
            last = after[1].over(name, chosen) - after[0].over(name, chosen) if after else before
            floor = float((last[1:] - last[0]).abs().quantile(CONFIDENCE[1] - CONFIDENCE[0]))
            means, left_then = (float(simulator[0]), float(flights[0])), _measured(last) if after else None
            costs.append(Cost(name, *COST_LABELS[name], low_fl, high_fl, *means, _measured(before), left_then, floor))
    return costs


def profile_of(compared: Compared) -> list[LevelMeans]:
    """Mean profile of the simulator in each band where a rate is compared, from below."""
    bands = sorted(e.band for e in compared.entries if e.quantity == "rate")
    table = flown(compared, compared.y if compared.has_simulated else 0.0 * compared.y)
    simulator = simulator_rows(compared)
    rate, seconds, distance = (table[name][simulator].nanmean(0) for name in ("rate", "time", "air_distance"))
    cas = torch.where(table["rate"].isfinite(), compared.state.cas_mps / KT_MPS, torch.nan)[simulator].nanmean(0)
    tas = distance / seconds * NM_M / KT_MPS
    levels = compared.middles_fl()
    return [LevelMeans(round(levels[k], 6), float(rate[k]), float(cas[k]), float(tas[k])) for k in bands]


def _thirds(bands: Sequence[int]) -> list[list[int]]:
    edges = [round(i * len(bands) / LEVEL_PARTS) for i in range(LEVEL_PARTS + 1)]
    return [list(bands[a:b]) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class _Side:
    """Flights of one side: costs by name (n, K) or (n,), rows that are its own, aircraft, and drawn fleets of these."""

    tables: dict[str, Tensor]
    rows: Tensor
    owner: Tensor
    weights: Tensor

    def over(self, name: str, bands: Sequence[int]) -> Tensor:
        """Mean cost (1 + fleets,) over bands, of all flights first."""
        table = self.tables[name][self.rows]
        table = table if name in COSTS_OF_FLIGHT else table[:, list(bands)]
        table = 1 / table if name == "rate" else table
        seen = table.isfinite()
        size = (self.weights.shape[1], table.shape[1])
        total = torch.zeros(size, dtype=torch.float64).index_add_(0, self.owner, table.nan_to_num(0.0))
        count = torch.zeros(size, dtype=torch.float64).index_add_(0, self.owner, seen.double())
        drawn, number = self.weights @ total, self.weights @ count
        # A fleet without a flight in a band says of it what all flights do.
        mean = torch.where(number > 0, drawn / number.clamp(min=1), drawn[:1] / number[:1].clamp(min=1))
        whole = mean.sum(1) if name in SUMMED_COSTS else mean.mean(1)
        return 1 / whole if name == "rate" else whole


def flown(compared: Compared, y: Tensor) -> dict[str, Tensor]:
    """Time, distance, rates and speeds of flights with these entries, by cost.

    Args:
        compared: Flights of both sides.
        y: (n, p) entries, as they are or with something taken off.

    Returns:
        (n, K) by cost, (n, 1) for those of :data:`COSTS_OF_FLIGHT`; NaN where no rate is seen.
    """
    state, quantities = compared.state, compared.quantities()

    def moved(name: str) -> Tensor:
        """By how much the entries differ from those that were measured."""
        return compared.table(name, y) - compared.table(name, compared.y)

    faster_mps = moved("cas") * KT_MPS
    cas_mps, polar = state.cas_mps + faster_mps.nan_to_num(0.0), log_rate(state, faster_mps=faster_mps)
    rate = (compared.table("rate", y) + polar).exp()
    # How late a report is takes no time.
    crossed = rate * (-compared.table("lag", y).nan_to_num(0.0)).exp()
    standard = mach_to_tas_mps(cas_to_mach(cas_mps, state.altitude_m), state.altitude_m)
    tas = standard * compared.table("tas", y).nan_to_num(0.0).exp()
    seconds = state.width_m / crossed
    own = state.own_log_rate[simulator_rows(compared)].mean(0)
    costs = {
        "time": seconds,
        "time_at_speed": seconds * (polar - own).exp(),
        "air_distance": tas * seconds / NM_M,
        "rate": rate / FPM_MPS,
    }
    if "cas" in quantities:
        costs["cas"] = torch.where(rate.isfinite(), cas_mps / KT_MPS, torch.nan)
    if "tas" in quantities:
        costs["tas"] = torch.where(rate.isfinite(), tas / KT_MPS, torch.nan)
    sides = [compared.real, ~compared.real] if compared.has_simulated else [compared.real]
    # Without wind measured on each side there is no distance over ground.
    if "wind" in quantities and all(bool((state.tailwind_mps[side] != 0).any()) for side in sides):
        level = (tas**2 - crossed.nan_to_num(0.0) ** 2).clamp(min=0.0).sqrt()
        costs["ground_distance"] = (level + state.tailwind_mps + moved("wind").nan_to_num(0.0)) * seconds / NM_M
    asked = burn(state.aircraft, cas_mps, state.altitude_m, -crossed, state.cas_slope_per_s, mass_kg=state.mass_kg)
    costs["fuel"] = asked.flow_kg_s * seconds
    for name in COSTS_OF_FLIGHT:
        if name in quantities:
            costs[name] = y[:, compared.columns(name)]
    return costs


def simulator_rows(compared: Compared) -> Tensor:
    """Flights (n,) with the simulator's speeds: its own, or all where it flies each flight's own speed."""
    return ~compared.real if compared.has_simulated else compared.real


def _fleets(airframe: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Aircraft (n,) of each flight, and how often each is (1 + fleets, aircraft): all once, then fleets as drawn."""
    names, owner = torch.unique(airframe, return_inverse=True)
    count = len(names)
    drawn = torch.randint(count, (FLEETS, max(count - 1, 1)), generator=generator)
    weights = torch.zeros(FLEETS, count, dtype=torch.float64).scatter_add_(1, drawn, torch.ones(drawn.shape).double())
    return owner, torch.cat([torch.ones(1, count, dtype=torch.float64), weights])


def _measured(values: Tensor) -> Measured:
    low, high = (float(values[1:].quantile(q)) for q in CONFIDENCE)
    return Measured(float(values[0]), low, high)
