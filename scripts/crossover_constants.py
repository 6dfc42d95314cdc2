"""Vary the constants of crossovers: errors with each halved or doubled.

Flights of known Mach number and CAS are simulated once. ``--typecode``, ``--flights`` and ``--seed`` choose others.
"""

import argparse

import polars as pl
import torch
from torch import Tensor

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.units import FT_M, KT_MPS
from descentflow.physics.airspeed import crossover_altitude_m
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation import crossover
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.simulation.world import simulate
from descentflow.surveillance.prepare import prepare

CONSTANTS = ("PRIOR_SPREAD_M", "LEAST_SPREAD_MPS", "SMOOTHER", "WINDOW")
SURES = (0.9, 0.95, 0.975)
"""One minus :data:`descentflow.representation.crossover.SURE` doubled, as it is, and halved."""
INSIDE_M = 1500 * FT_M
"""A flight is judged whose crossover lies this far inside of what it shows."""


def true_crossovers(profiles: Profiles, flights: pl.DataFrame) -> Tensor:
    """Crossover (n,) of the planned Mach number and CAS, m."""
    order = pl.DataFrame({"flight_id": list(profiles.flight_ids)}).join(flights, on="flight_id", how="left")
    cas, mach = (torch.from_numpy(order[name].to_numpy().copy()) for name in ("cas_kt", "mach"))
    return crossover_altitude_m(cas * KT_MPS, mach)


def told(frame: pl.DataFrame, flights: pl.DataFrame, flown: PerformanceModel) -> str:
    """Error of the crossovers, how often 90 % intervals hold them, and levels whose regime is known, in a line."""
    profiles = profiles_from_frame(frame, flown, 150, speed="mach_cas")
    assert profiles.crossovers is not None
    true, found, mask = true_crossovers(profiles, flights), profiles.crossovers, profiles.mask
    altitude = torch.where(mask, profiles.altitude_m, torch.nan)
    low, high = altitude.nan_to_num(torch.inf).amin(1), altitude.nan_to_num(-torch.inf).amax(1)
    judged = (true > low + INSIDE_M) & (true < high - INSIDE_M)
    held = (true >= found.quantile_m(0.05)) & (true <= found.quantile_m(0.95))
    away = (found.quantile_m(0.5) - true).abs()[judged].median() / FT_M
    at_mach = profiles.altitude_m >= true[:, None]
    levels = []
    for sure in SURES:
        known = mask & ((found.mach_share >= sure) | (found.mach_share <= 1 - sure))
        right = (found.holds_mach == at_mach)[known].double().mean()
        levels.append(f"{sure:g}: {float(known.sum() / mask.sum()):.1%} known, {float(right):.2%} of them right")
    return f"{int(judged.sum())} flights, {float(away):.0f} ft, {float(held[judged].double().mean()):.0%} held; " + (
        "; ".join(levels)
    )


def main() -> None:
    """Change each constant by itself and print what moves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--typecode", default="B738")
    parser.add_argument("--flights", type=int, default=400)
    parser.add_argument("--seed", type=int, default=11)
    args = parser.parse_args()
    world, flown = simulate(args.typecode, args.flights, args.seed), aircraft(args.typecode)
    frame = prepare(world.rows, typecode=args.typecode).frame
    print(f"as they are: {told(frame, world.flights, flown)}")
    for name in CONSTANTS:
        value = getattr(crossover, name)
        for factor in (0.5, 2.0):
            setattr(crossover, name, type(value)(value * factor))
            print(f"{name} {value:g} times {factor:g}: {told(frame, world.flights, flown)}", flush=True)
        setattr(crossover, name, value)


if __name__ == "__main__":
    main()
