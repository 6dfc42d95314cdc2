"""Time and memory of `descentflow simulate` over the number of flights."""

import argparse
import os
import tempfile
from pathlib import Path

from benchmarks.timing import measured, print_row


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("--flights", type=int, nargs="+", default=[1000, 10_000], help="default: %(default)s")
    parser.add_argument("--typecode", default="A320", help="default: %(default)s")


def run(args: argparse.Namespace) -> None:
    """Fly, observe and write rows and truth, in a process of its own for each number of flights."""
    print(f"descentflow simulate, {args.typecode}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print_row(["flights", "wall s", "CPU s", "flights/s", "peak MB"])
    for number in args.flights:
        with tempfile.TemporaryDirectory(prefix="descentflow-benchmark-") as folder:
            out = str(Path(folder) / "rows.parquet")
            wall, cpu, peak = measured("simulate", "--typecode", args.typecode, "--flights", str(number), "--out", out)
        print_row([f"{number:,}", f"{wall:.1f}", f"{cpu:.1f}", f"{number / wall:,.0f}", f"{peak / 1e6:,.0f}"])
