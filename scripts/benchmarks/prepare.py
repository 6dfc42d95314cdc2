"""Rows a second, memory and the curve of `descentflow prepare`."""

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import polars as pl

from benchmarks.timing import measured

FLIGHTS = 1000
FILE_ROWS = 2_500_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("--rows", type=float, nargs="+", default=[1, 2, 5], help="sizes in millions of rows")
    parser.add_argument("--memory", default="2GB", help="bound given to prepare (default: %(default)s)")


def run(args: argparse.Namespace) -> None:
    """Print the curve."""
    prepare(args.rows, args.memory)


def prepare(millions: Sequence[float], memory: str) -> None:
    """Print the curve over sizes, in millions of rows."""
    print(
        f"descentflow prepare --memory {memory} on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start"
    )
    print("CPU seconds are user + system of the whole process; other work on the machine makes both grow")
    head = ("rows", "files MB", "wall s", "CPU s", "rows/s", "rows/s of CPU", "us CPU/row", "peak MB", "levels", "load")
    print("".join(f"{name:>14}" for name in head))
    with tempfile.TemporaryDirectory(prefix="descentflow-benchmark-") as folder:
        world = _world(Path(folder))
        for size in millions:
            _curve_row(world, Path(folder), round(size * 1e6), memory)


def _world(folder: Path) -> pl.DataFrame:
    path = folder / "world.parquet"
    measured("simulate", "--flights", str(FLIGHTS), "--out", str(path))
    return pl.read_parquet(path)


def make_rows(world: pl.DataFrame, folder: Path, number: int) -> int:
    """Write at least so many rows: copies of the world's flights with addresses and names of their own.

    Rows of a file stand in time order, so that those of a flight are far apart, as in a network's recordings.
    """
    folder.mkdir()
    addresses = world["icao24"].unique().sort()
    place = world["icao24"].replace_strict(addresses, range(len(addresses)), return_dtype=pl.Int64)
    written = copies = 0
    while written < number:
        frames: list[pl.DataFrame] = []
        while written < number and len(frames) * len(world) < FILE_ROWS:
            hexes = [f"{100_000 + copies * len(addresses) + n:06x}" for n in range(len(addresses))]
            frames.append(
                world.with_columns(
                    pl.Series("icao24", hexes).gather(place),
                    pl.col("timestamp") + pl.duration(seconds=7 * copies),
                    pl.col("flight_id") + f"-{copies}",
                ).head(number - written)
            )
            written += len(frames[-1])
            copies += 1
        pl.concat(frames).sort("timestamp").write_parquet(folder / f"rows-{copies:06d}.parquet")
    return sum(path.stat().st_size for path in folder.iterdir())


def _curve_row(world: pl.DataFrame, folder: Path, number: int, memory: str) -> None:
    rows, out = folder / f"rows-{number}", folder / f"descents-{number}.parquet"
    size = make_rows(world, rows, number)
    wall, cpu, peak = measured("prepare", str(rows), "--out", str(out), "--memory", memory)
    levels = pl.scan_parquet(out).select(pl.len()).collect().item()
    cells = (
        f"{number:,}",
        f"{size / 1e6:,.0f}",
        f"{wall:.1f}",
        f"{cpu:.1f}",
        f"{number / wall:,.0f}",
        f"{number / cpu:,.0f}",
        f"{cpu / number * 1e6:.2f}",
        f"{peak / 1e6:,.0f}",
        f"{levels:,}",
        f"{os.getloadavg()[0]:.1f}",
    )
    print("".join(f"{cell:>14}" for cell in cells), flush=True)
    for path in (*rows.iterdir(), out):
        path.unlink()
