"""Worth of knowing the air and the mass: flights of a year's weather forecast without, by columns, and by them.

Prints the mean CRPS of held-out simulated flights and the differences, each with two standard errors over flights.
``--flights`` and ``--seed`` choose another year.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import polars as pl
from torch import Tensor

from descentflow.densities.checkpoint import as_density
from descentflow.representation.encode_flights import encode_flights
from descentflow.simulation.world import World, simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.prepare import prepare
from descentflow.training.fit import fit
from studies.forecast_scores import forecast_scores

YEAR = WorldConfig(
    deviation_mean_k=3.0, deviation_spread_k=8.0, wind_slope_mean_per_s=0.001, wind_slope_spread_per_s=0.0015
)
"""Days of ISA + 3 K (spread 8 K), with tailwinds that grow by 0.6 kt for each 1,000 ft (spread 0.9 kt)."""
COLUMNS = ["deviation_k", "wind_slope_per_s"]
WAYS: dict[str, dict[str, object]] = {
    "without the air": {},
    "context columns": {"context": COLUMNS},
    "each flight's air": {"air": "measured"},
    "mass as a column": {"context": ["mass_kg"]},
    "each flight's air, mass as a column": {"air": "measured", "context": ["mass_kg"]},
}
SCORES = {"crps_time_s": "s", "crps_rate_fpm": "ft/min", "crps_cas_kt": "kt"}


def flights(n: int, seed: int) -> tuple[Descents, pl.DataFrame]:
    """Prepared descents, their true weather and their masses."""
    world: World = simulate("A320", n, seed, YEAR)
    return prepare(world.rows, typecode="A320"), world.flights.select("flight_id", "mass_kg", *COLUMNS)


def scores_of(train: tuple[Descents, pl.DataFrame], test: tuple[Descents, pl.DataFrame], **way: object) -> pl.DataFrame:
    """Scores of every held-out flight, by name."""
    with TemporaryDirectory() as folder:
        train[1].write_parquet(path := Path(folder, "context.parquet"))
        table = {"context_table": path} if "context" in way else {}
        density = as_density(fit(train[0], "mixture", final=False, **way, **table))
    known = density.representation
    found = encode_flights(test[0].frame, known, test[1] if "context" in way else None)["test"]
    scores: dict[str, Tensor] = forecast_scores(density, found.profiles, found.weights, found.context)
    columns = {name: scores[name].numpy() for name in SCORES}
    return pl.DataFrame({"flight_id": found.profiles.flight_ids, **columns}).fill_nan(None)


def main() -> None:
    """Fit, score, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=600)
    parser.add_argument("--seed", type=int, default=31)
    args = parser.parse_args()
    train, test = flights(args.flights, args.seed), flights(args.flights // 2, args.seed + 1)
    # Names are numbers of flights: those of another world are other flights.
    test = (
        Descents(test[0].frame.with_columns(flight_id="held-" + pl.col("flight_id")), test[0].metadata),
        test[1].with_columns(flight_id="held-" + pl.col("flight_id")),
    )
    found = {name: scores_of(train, test, **way) for name, way in WAYS.items()}
    both = set.intersection(*(set(one["flight_id"]) for one in found.values()))
    kept = {name: one.filter(pl.col("flight_id").is_in(list(both))).sort("flight_id") for name, one in found.items()}
    first = next(iter(kept.values()))
    print(f"{len(both)} held-out flights")
    for name, one in kept.items():
        told = []
        for score, unit in SCORES.items():
            more = ((one[score] - first[score]) / first[score].mean()).fill_nan(None).drop_nulls()
            error = 2 * float(more.std()) / len(more) ** 0.5
            told.append(f"{score} {one[score].mean():.2f} {unit} ({more.mean():+.1%} +- {error:.1%})")
        print(f"{name}: {', '.join(told)}", flush=True)


if __name__ == "__main__":
    main()
