r"""Gaps below the rounding of reports in one flight: measurable, and nothing to explain.

With enough flights any difference is more than chance. It does not matter where it is less than what the rounding of
the reports leaves open in a single one. A field that is rounded to steps of q has the standard uncertainty
:math:`q / \sqrt{12}` (GUM, JCGM 100:2008, F.2.2.1), and what is made of several fields has

.. math:: u^2 = \sum_j (\partial x / \partial f_j)^2\, q_j^2 / 12.

The steps are those of Mode S (:data:`descentflow.core.mode_s_steps.STEPS`); no number is chosen here.
"""

from collections.abc import Sequence
from math import hypot, inf, log1p

import torch
from torch import Tensor

from descentflow.core.mode_s_steps import UNCERTAINTY
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.diagnosis.findings.costs_found import Cost, LevelMeans
from descentflow.diagnosis.findings.gap_found import BelowRounding, GapCell
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.diagnosis.sides.vectors import Entry, Vectors
from descentflow.measurements.quantity_registry import NOISE_CHANNELS, QUANTITIES
from descentflow.physics.airspeed import mach_to_cas_mps

ALTITUDE_M = UNCERTAINTY["altitude"] * FT_M
"""Standard uncertainty of an altitude by its rounding, in metres."""


def rounding_of(compared: Compared, profile: Sequence[LevelMeans]) -> Tensor:
    """Standard uncertainty (p,) of one flight's entry from the rounding of its reports, in each quantity's unit.

    Args:
        compared: Flights of both sides.
        profile: What the simulator flies on average by level.
    """
    middles = compared.middles_fl()
    mean_rate = sum(m.rate_fpm for m in profile) / len(profile) * FPM_MPS
    roundings = []
    for at, e in enumerate(compared.entries):
        quantity = QUANTITIES[e.quantity]
        if quantity.is_noise:
            roundings.append(_of_noise(compared, at, e))
        elif quantity.by_band:
            here = min(profile, key=lambda m: abs(m.level_fl - middles[e.band]))
            roundings.append(_of_band(compared, e, here))
        else:
            # Both ends of a level-off are crossed in steps of the altitude; a count is not rounded.
            roundings.append(2**0.5 * ALTITUDE_M / mean_rate if quantity.unit == "s" else 0.0)
    return torch.tensor(roundings, dtype=torch.float64)


def _of_band(compared: Compared, e: Entry, here: LevelMeans) -> float:
    rate = UNCERTAINTY["vertical_rate"] / here.rate_fpm
    altitude = compared.state.altitude_m[e.band]
    mach = compared.state.mach()[:, e.band].nanmean()
    both_ends = 2**0.5 * ALTITUDE_M / compared.state.width_m
    step = UNCERTAINTY["Mach"]
    of_mach = float(mach_to_cas_mps(mach + step, altitude) - mach_to_cas_mps(mach, altitude)) / KT_MPS
    return {
        "rate": rate,
        "lag": hypot(rate, both_ends),
        "cas": UNCERTAINTY["IAS"],
        "mismatch": hypot(UNCERTAINTY["IAS"], of_mach),
        "tas": hypot(UNCERTAINTY["TAS"] / here.tas_kt, step / float(mach)),
        "wind": hypot(UNCERTAINTY["TAS"], UNCERTAINTY["groundspeed"]) * KT_MPS,
        "height": hypot(UNCERTAINTY["geoaltitude"] * FT_M, ALTITUDE_M),
    }[e.quantity]


def _of_noise(compared: Vectors, at: int, e: Entry) -> float:
    """By how much the logarithm of a noise grows by the rounding of its channel."""
    channel = NOISE_CHANNELS[e.quantity]
    size = UNCERTAINTY[channel] * (FT_M if channel == "altitude" else 1.0)
    usual = float(compared.y[:, at].nanmean().exp())
    return 0.5 * log1p((size / usual) ** 2)


def below_rounding(
    compared: Compared, cells: Sequence[GapCell], costs: Sequence[Cost], profile: Sequence[LevelMeans]
) -> list[BelowRounding]:
    """The largest difference of each quantity and what rounding leaves open; empty where one is larger than that.

    Cells are judged by their distance beyond the noise floor: so flights that differ more or less from each other count
    as well. The floor itself must be less than the rounding, for else the flights are too few to say that a gap is
    small. Counts and lost times, which most flights have none of, are judged by whether the difference is more than
    chance, and what it costs by its mean, unless that is chance.

    Args:
        compared: Flights of both sides.
        cells: All that were looked at.
        costs: Over all levels and parts of them.
        profile: What the simulator flies on average by level.
    """
    if not profile or not cells or any(_is_felt(cost, profile) for cost in costs):
        return []
    rounding = rounding_of(compared, profile)
    rows: dict[str, BelowRounding] = {}
    for cell in cells:
        least = float(rounding[_entries_of(compared, cell)].mean())
        is_count = QUANTITIES[cell.quantity].is_count
        excess = max(cell.distance - cell.floor, 0.0)
        surely = not is_count or cell.p_value <= compared.assumed.false_cells
        if max(excess, 0.0 if is_count else cell.floor) >= least and surely:
            return []
        row = BelowRounding(cell.quantity, cell.level_low_fl, cell.level_high_fl, excess, least)
        if not is_count and (cell.quantity not in rows or row.share > rows[cell.quantity].share):
            rows[cell.quantity] = row
    return list(rows.values())


def _entries_of(compared: Vectors, cell: GapCell) -> Tensor:
    """Positions of the entries of a cell."""
    least, most = cell.level_low_fl - 1e-6, cell.level_high_fl + 1e-6
    ranges = [(e.quantity, *compared.level_range(e)) for e in compared.entries]
    return torch.tensor([name == cell.quantity and low >= least and high <= most for name, low, high in ranges])


def _is_felt(cost: Cost, profile: Sequence[LevelMeans]) -> bool:
    """Test for a cost that is more than chance and more than the rounding of one report would make of it."""
    inside = [m for m in profile if cost.low_fl <= m.level_fl <= cost.high_fl]
    rate, tas = (sum(values) / len(inside) for values in ([m.rate_fpm for m in inside], [m.tas_kt for m in inside]))
    of_rate, of_tas = UNCERTAINTY["vertical_rate"] / rate, UNCERTAINTY["TAS"] / tas
    of_ground = hypot(of_rate, UNCERTAINTY["groundspeed"] / tas)
    least = {
        "time": of_rate * cost.simulator,
        "time_at_speed": of_rate * cost.simulator,
        "air_distance": hypot(of_rate, of_tas) * cost.simulator,
        "ground_distance": of_ground * cost.simulator,
        "rate": UNCERTAINTY["vertical_rate"],
        "cas": UNCERTAINTY["IAS"],
        "tas": UNCERTAINTY["TAS"],
        "fuel": inf,  # it follows from the others
    }.get(cost.name, 2**0.5 * ALTITUDE_M / (rate * FPM_MPS))
    return cost.before.excludes_zero and abs(cost.before.estimate) >= least
