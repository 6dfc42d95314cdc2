"""Compare the densities with and without context on simulated or prepared descents: NLL, energy score, CRPS.

    python scripts/compare_densities.py OUT.csv --context deviation_k operator wind_slope_per_s
    python scripts/compare_densities.py OUT.csv --descents a320.parquet --context entry_fl hour --context-table met.csv

Every seed simulates flights of its own (air that is warmer or colder, winds that grow with height, three operators) or
splits the given descents anew. `--context random` adds a column that has nothing to do with the flights: no model may
gain by it. The intervals are 90 % bootstrap intervals over the held-out flights of all seeds.
"""

import argparse
import logging
import tempfile
import warnings
from pathlib import Path

import numpy as np
import polars as pl
import torch

from descentflow.aircraft_types.registry import aircraft
from descentflow.cli.entry import main as command
from descentflow.core.errors import DescentflowError
from descentflow.core.files import check_output, whole_file
from descentflow.densities.density import Density
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.training.data_settings import ContextSettings
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit
from descentflow.training.splitting import SplitSettings
from descentflow.training.training_settings import training_settings
from studies.forecast_scores import Skill, forecast_scores, skill

SPREADS = {"deviation_spread_k": 10.0, "wind_slope_spread_per_s": 0.001}


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="table of all scores (.csv)")
    parser.add_argument("--descents", type=Path, help="prepared descents (default: simulated ones)")
    parser.add_argument("--context-table", type=Path, help="columns of context by flight_id, for --descents")
    parser.add_argument("--typecode", default="A320", help="type that is simulated (default: %(default)s)")
    parser.add_argument("--flights", type=int, default=1200, help="flights simulated for a seed (default: 1200)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--models", nargs="+", default=["gaussian", "gmm", "flow"], help="of configs/model/")
    parser.add_argument("--context", nargs="*", default=[], help="columns; none compares the densities alone")
    parser.add_argument("--draws", type=int, default=100, help="samples for each held-out flight (default: 100)")
    return parser.parse_args()


def world(args: argparse.Namespace, seed: int, folder: Path) -> tuple[Path, Path]:
    """Simulated and prepared descents, and the table of their flights."""
    flown = simulate(aircraft(args.typecode), args.flights, seed, WorldConfig(**SPREADS))
    rows, descents, flights = (folder / f"{name}_{seed}.parquet" for name in ("rows", "descents", "flights"))
    flown.rows.write_parquet(rows)
    flown.flights.write_parquet(flights)
    bottom = "150" if float(aircraft(args.typecode).altitude_maximum_ft) > 30_000 else "100"
    if command(["prepare", str(rows), "--out", str(descents), "--bottom-fl", bottom]):
        raise SystemExit(2)
    rows.unlink()
    return descents, flights


def with_random(table: Path | None, descents: Path, seed: int, folder: Path) -> Path:
    """The table of flights with a column of random numbers."""
    flights = pl.read_parquet(descents, columns=["flight_id"]).unique().sort("flight_id")
    if table is not None:
        known = pl.read_csv(table) if table.suffix == ".csv" else pl.read_parquet(table)
        flights = flights.join(known, on="flight_id", how="left")
    noise = pl.Series("random", np.random.default_rng(seed).normal(size=len(flights)))
    flights.with_columns(noise).write_parquet(folder / "with_random.parquet")
    return folder / "with_random.parquet"


def fitted(name: str, data: DescentDataModule, seed: int) -> Density:
    """A density as `descentflow fit --config configs/model/NAME.yaml` trains it."""
    for option, value in {"batch_size": 512, "fewest_batches": 1, **training_settings(name).data}.items():
        setattr(data, option, value)
    return fit(data, name, seed=seed, final=False).density


def scores_of_seed(args: argparse.Namespace, seed: int, folder: Path) -> list[pl.DataFrame]:
    """One row per model and held-out flight."""
    descents, table = (args.descents, args.context_table) if args.descents else world(args, seed, folder)
    if "random" in args.context:
        table = with_random(table, descents, seed, folder)
    frames = []
    for context in [None, args.context] if args.context else [None]:
        conditions = ContextSettings(context=context, context_table=table if context else None)
        data = DescentDataModule(descents, conditions=conditions, split=SplitSettings(seed=seed))
        data.setup()
        flights, weights, known = data.profiles("test"), data.weights("test"), data.contexts("test")
        for name in args.models:
            density = fitted(name, data, seed)
            scores = forecast_scores(density, flights, weights, known, args.draws, seed)
            named = {"model": name, "given": ", ".join(context or []), "seed": seed}
            columns = {key: value.numpy() for key, value in scores.items()}
            means = ", ".join(f"{key} {np.nanmean(value):.3f}" for key, value in columns.items())
            print(f"seed {seed}, {name}, given {named['given'] or 'nothing'}: {means}", flush=True)
            identified = pl.DataFrame({"flight_id": list(flights.flight_ids), **columns})
            frames.append(identified.with_columns(**{k: pl.lit(v) for k, v in named.items()}))
    return frames


def differences(table: pl.DataFrame, first: tuple[str, str], second: tuple[str, str], score: str) -> Skill:
    """Mean difference of a score between two models over the flights that both scored."""
    own, reference = (table.filter(model=model, given=given) for model, given in (first, second))
    both = own.join(reference, on=["flight_id", "seed"], suffix="_reference")
    both = both.filter(pl.col(score).is_finite() & pl.col(f"{score}_reference").is_finite())
    return skill(*(torch.from_numpy(both[c].to_numpy().copy()) for c in (score, f"{score}_reference")))


def report(table: pl.DataFrame, models_: list[str], context: list[str]) -> None:
    """Print means, and differences with intervals."""
    scores = [c for c in table.columns if c.startswith(("nll", "energy", "crps"))]
    means = table.group_by("model", "given", maintain_order=True).agg([pl.col(c).fill_nan(None).mean() for c in scores])
    with pl.Config(tbl_rows=-1, tbl_cols=-1, float_precision=3, tbl_hide_dataframe_shape=True):
        print(means)
    given = ", ".join(context)
    pairs = [
        ((m, g), ("gaussian", g), f"{m} against gaussian, given {g or 'nothing'}")
        for g in dict.fromkeys(["", given])
        for m in models_
        if m != "gaussian" and "gaussian" in models_
    ]
    pairs += [((m, given), (m, ""), f"{m}: given {given} against not given") for m in models_ if context]
    for first, second, title in pairs:
        print(title)
        for score in scores:
            print(f"  {score:<14}{differences(table, first, second, score)}")


def run() -> None:
    """Compare, print and write."""
    args = arguments()
    warnings.filterwarnings("ignore")
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    check_output(args.out)
    frames: list[pl.DataFrame] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in args.seeds:
            frames += scores_of_seed(args, seed, Path(folder))
    table = pl.concat(frames)
    with whole_file(args.out) as temporary:
        table.write_csv(temporary)
    report(table, args.models, args.context)


if __name__ == "__main__":
    try:
        run()
    except DescentflowError as error:
        raise SystemExit(f"compare_densities: {error}") from error
