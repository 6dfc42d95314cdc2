"""The fuel score of `evaluate` on flights whose fuel is known: simulated ones, and a recorded A320.

    python scripts/fuel_scores.py recorder.csv

The recorder's file is that of `recorder_fuel.py`. Simulated flights burn what the type's law gives at the thrust that
flew them, with engines, masses and drag of their own; samples burn what their rates ask for at the reference mass.
"""

import argparse
from pathlib import Path

import numpy as np
import polars as pl
import torch

import descentflow as df
from descentflow.core.units import FT_M, KT_MPS
from descentflow.evaluation.evaluation_report import Evaluation
from descentflow.evaluation.metrics.score_registry import FUEL
from descentflow.physics.airspeed import tas_to_cas_mps, tas_to_mach
from descentflow.surveillance.descents.prepared_descents import Descents
from recorder_fuel import descent_of

TRAINING, OTHERS = (600, 0), (600, 1)
"""Flights and seed of the world that a model is fitted to, and of that which judges it."""
SAMPLES = 5000


def main() -> None:
    """Print the score of both, beside its noise floor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recorder", type=Path)
    args = parser.parse_args()
    flown, recorder = simulated(*TRAINING), recorded(args.recorder)
    told("simulated flights", df.evaluate(df.fit(flown), simulated(*OTHERS), n=SAMPLES, seed=0))
    speeds = recorder.frame["IAS"]
    print(f"speeds: recorder {speeds.min():.0f} to {speeds.max():.0f} kt, simulated {_bulk(flown.frame['IAS'])} kt")
    # One flight is whole on a grid that ends where it begins.
    top = recorder.frame["level_fl"].to_numpy().max()
    below = Descents(
        flown.frame.filter(pl.col("level_fl") <= int(top)), {**flown.metadata, "top_fl": {"A320": int(top)}}
    )
    told(f"recorder flight, FL{top} to FL150", df.evaluate(df.fit(below), recorder, n=SAMPLES, seed=0))


def _bulk(values: pl.Series) -> str:
    low, high = (values.quantile(share) or 0.0 for share in (0.05, 0.95))
    return f"{low:.0f} to {high:.0f} (5 to 95 %)"


def simulated(flights: int, seed: int) -> Descents:
    """Prepared descents of a world with the fuel flow of the thrust that flew them."""
    world, model = df.simulate("A320", flights, seed=seed), df.aircraft("A320")
    truth = world.truth.sort("flight_id", "timestamp")
    columns = ("altitude_m", "tas_mps", "thrust_n")
    altitude, tas, thrust = (torch.from_numpy(truth[name].to_numpy().astype(np.float64)) for name in columns)
    idle = model.idle_fuel_flow_kg_s(altitude, tas)
    flow = torch.maximum(model.fuel_flow_kg_s(altitude, tas, thrust), idle).numpy()
    burnt = truth.select("flight_id", pl.col("timestamp").dt.cast_time_unit("us"), pl.Series("fuel_flow", flow))
    rows = world.rows.with_columns(pl.col("timestamp").dt.cast_time_unit("us")).sort("timestamp")
    nearest = {"strategy": "nearest", "check_sortedness": False}
    joined = rows.join_asof(burnt.sort("timestamp"), on="timestamp", by="flight_id", **nearest)
    return df.prepare(joined, typecode="A320")


def recorded(file: Path) -> Descents:
    """Prepared descent of the recorder, in standard air, with the fuel of both engines."""
    rows = descent_of(file)
    altitude = torch.from_numpy(rows["ALTI_STD_FT"].to_numpy() * FT_M)
    tas = torch.from_numpy(rows["TRUE_AIR_SPD_KT"].to_numpy() * KT_MPS)
    table = pl.DataFrame(
        {
            "timestamp": rows["PLOT_DATE"].str.to_datetime().dt.replace_time_zone("UTC"),
            "icao24": "recorder",
            "flight_id": "recorder",
            "typecode": "A320",
            "altitude": rows["ALTI_STD_FT"].cast(pl.Float64),
            "vertical_rate": rows["VERT_SPD_FTMN"].cast(pl.Float64),
            "IAS": (tas_to_cas_mps(tas, altitude) / KT_MPS).numpy(),
            "Mach": tas_to_mach(tas, altitude).numpy(),
            "fuel_flow": 2 * rows["FUEL_FLOW_KGH"] / 3600,
        }
    )
    return df.prepare(table, typecode="A320")


def told(name: str, found: Evaluation) -> None:
    """Print what `evaluate` has on fuel, and the means."""
    (burnt, known), (sampled, whole) = (FUEL.of(side) for side in (found.real, found.samples))
    kg, samples = burnt[known].numpy(), sampled[whole].numpy()
    print(f"{name}: {len(kg)} of {len(found.real)} whole, mean {kg.mean():.1f} kg; samples {samples.mean():.1f} kg,")
    print(f"  of which 5 to 95 % burn {np.quantile(samples, 0.05):.1f} to {np.quantile(samples, 0.95):.1f} kg")
    for line in str(found).splitlines():
        if line.startswith(("quantity", "fuel")):
            print(" ", line)


if __name__ == "__main__":
    main()
