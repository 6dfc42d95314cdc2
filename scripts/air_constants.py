"""Vary the constants of measured air: errors and known levels with each halved or doubled.

Flights are simulated in weather of known temperature and wind once; each constant is then changed by itself. Errors are
root mean squares over the levels that are known. ``--flights`` and ``--seed`` choose other flights.
"""

import argparse
import importlib

import polars as pl
import torch
from torch import Tensor

from descentflow.air.measured_air import FlightAirs, measured_airs
from descentflow.core.errors import DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.atmosphere import geometric_altitude_m
from descentflow.physics.energy import slope_per_m
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.prepare import prepare

CONSTANTS = {
    "air_reports": ("BAND_LEVELS", "MIN_IN_BAND", "WINDOW", "OUTLIER", "MAX_DEVIATION_K", "MAX_WIND_MPS"),
    "air_smoother": ("DIFFUSE", "TREND_M", "MIDDLE_M", "LENGTH_M", "MIN_BANDS", "MIN_NOISE"),
    "measured_air": ("DEPARTURE_K", "DEPARTURE_MPS", "MAX_ERROR_K", "MAX_GROWTH_ERROR_PER_S"),
}
"""Module of ``descentflow.air`` -> its constants."""
WEATHER = WorldConfig(deviation_mean_k=8.0, deviation_spread_k=5.0, wind_slope_mean_per_s=0.001,
                      wind_slope_spread_per_s=0.0015)  # fmt: skip
LEVELS = torch.arange(150, 341).double()
KFT_M = 304.8


def truth(airs: FlightAirs, flights: pl.DataFrame) -> tuple[Tensor, Tensor]:
    """Temperature deviation (m, 1) in K and growth of the tailwind (m, L) in 1/s."""
    order = pl.DataFrame({"flight_id": list(airs.flight_ids)}).join(flights, on="flight_id", how="left")
    deviation, slope = (torch.from_numpy(order[name].to_numpy().copy()) for name in ("deviation_k", "wind_slope_per_s"))
    # The world's wind grows with geometric altitude.
    height = geometric_altitude_m(LEVELS * FL_M, deviation[:, None])
    return deviation[:, None], slope_per_m(slope[:, None] * height, LEVELS * FL_M)


def told(frame: pl.DataFrame, flights: pl.DataFrame) -> str:
    """Errors, how often 90 % intervals hold the truth, and how many levels are known, in a line."""
    try:
        airs = measured_airs(frame, LEVELS)
    except DataError as error:
        return error.got
    deviation, growth = truth(airs, flights)
    kelvins = (airs.air.deviation_k - deviation)[airs.known]
    knots = (airs.air.slopes(LEVELS * FL_M).tailwind_per_s - growth)[airs.known] * KFT_M / KT_MPS
    claimed = airs.growth_error_per_s[airs.known] * KFT_M / KT_MPS
    held = [float((left.abs() < 1.645 * error).double().mean()) for left, error in (
        (kelvins, airs.deviation_error_k[airs.known]), (knots, claimed))]  # fmt: skip
    return (
        f"{float(kelvins.square().mean().sqrt()):.2f} K ({held[0]:.0%} held), "
        f"{float(knots.square().mean().sqrt()):.3f} kt/1,000 ft ({held[1]:.0%} held), "
        f"{int(airs.known.sum()):,} levels of {len(airs.flight_ids)} flights known"
    )


def main() -> None:
    """Change each constant by itself and print what moves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=120)
    parser.add_argument("--seed", type=int, default=4)
    args = parser.parse_args()
    world = simulate("A320", args.flights, args.seed, WEATHER)
    frame = prepare(world.rows, typecode="A320").frame
    print(f"as they are: {told(frame, world.flights)}")
    for module, names in CONSTANTS.items():
        place = importlib.import_module(f"descentflow.air.{module}")
        for name in names:
            value = getattr(place, name)
            for factor in (0.5, 2.0):
                changed = max(round(value * factor), 1) if isinstance(value, int) else value * factor
                setattr(place, name, changed)
                print(f"{name} {value:g} -> {changed:g}: {told(frame, world.flights)}", flush=True)
            setattr(place, name, value)


if __name__ == "__main__":
    main()
