"""Time and memory of one diagnosis over the number of flights."""

import argparse
import os
import tempfile
from pathlib import Path

import polars as pl

from benchmarks.timing import measured, print_row

LEARNT_FROM = 400


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("--flights", type=int, nargs="+", default=[250, 500, 1000, 2000], help="default: %(default)s")


def run(args: argparse.Namespace) -> None:
    """Fit a Gaussian to simulated flights, and diagnose others in warmer air with all effects."""
    print(f"descentflow diagnose, all effects and channels, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(prefix="descentflow-benchmark-") as name:
        folder = Path(name)
        descents = _descents(folder, LEARNT_FROM, seed=1, warmer=False)
        runs = ["--trainer.logger", "lightning.pytorch.loggers.CSVLogger"]
        runs += ["--trainer.logger.init_args.save_dir", str(folder / "runs")]
        measured("fit", "--model", "Gaussian", "--data.descents", str(descents), *runs)
        checkpoint = next(folder.rglob("best.ckpt"))
        print_row(["flights", "wall s", "CPU s", "ms a flight", "peak MB"])
        for number in args.flights:
            real = _descents(folder, number, seed=2, warmer=True)
            words = ("diagnose", "--real", str(real), "--simulator", str(checkpoint), "--out", str(folder / "gap"))
            wall, cpu, peak = measured(*words)
            flights = pl.read_parquet(real, columns=["flight_id"])["flight_id"].n_unique()
            print_row(
                [f"{flights:,}", f"{wall:.1f}", f"{cpu:.1f}", f"{1000 * wall / flights:.1f}", f"{peak / 1e6:,.0f}"]
            )


def _descents(folder: Path, number: int, seed: int, warmer: bool) -> Path:
    from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
    from descentflow.simulation.world import simulate
    from descentflow.simulation.world_config import WorldConfig

    config = WorldConfig(deviation_mean_k=10.0) if warmer else None
    rows, out = folder / f"rows-{number}-{seed}.parquet", folder / f"descents-{number}-{seed}.parquet"
    simulate(open_aircraft("A320"), number, seed, config).rows.write_parquet(rows)
    measured("prepare", str(rows), "--out", str(out))
    return out
