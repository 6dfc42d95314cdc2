"""`descentflow simulate`: fly aircraft of known truth and write what a radar would report of them."""

import argparse
import textwrap
from pathlib import Path

from descentflow.cli import plant_arguments
from descentflow.core.seeds import seed_word
from descentflow.simulation.plantable import PLANTABLE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = textwrap.fill(
        "Fly descents of one aircraft type by the full equation of motion, with operators of different schedules, "
        "spread of mass, thrust and drag, level-offs and constant-rate stretches, and write the rows that a Mode S "
        "radar would report of them. The truth behind the rows is written beside them: OUT_truth.parquet, a row per "
        "flight and time step, and OUT_flights.parquet, a row per flight with every parameter and what was planted.",
        100,
    )
    parser.add_argument("--typecode", default="A320", help="aircraft type (default: %(default)s)")
    parser.add_argument("--flights", type=int, default=2000, help="flights wanted (default: %(default)s)")
    parser.add_argument("--seed", type=seed_word, default=0, help="the same seed gives the same flights (default: 0)")
    parser.add_argument(
        "--scenario",
        default="plain",
        help="settings of the world by type: plain, london-fir-2019 (the traffic that the paper describes: operators "
        "of different speeds, slow first stretches, turboprops of two rates), gulf-summer and nordic-winter (other "
        "air, operators and habits, to judge models on), or a TOML file (default: %(default)s)",
    )
    parser.add_argument("--out", type=Path, required=True, help="output: surveillance rows, .parquet")
    parser.add_argument("--truth", type=Path, help="where to put the truth (default: OUT_truth.parquet)")
    parser.add_argument(
        "--bada-dir", type=Path, help="BADA 3 directory with the type's coefficients (default: the open aircraft)"
    )
    plant_arguments.add_arguments(parser, PLANTABLE)


def run(args: argparse.Namespace) -> None:
    """Fly, write, and say what there is."""
    from descentflow.core.progress import stage
    from descentflow.simulation.world import simulate
    from descentflow.simulation.world_files import WorldFiles

    plant = plant_arguments.planted(args.plant)
    with stage("flying", args.flights, "flights") as flown:
        world = simulate(
            args.typecode,
            args.flights,
            args.seed,
            args.scenario,
            bada_dir=args.bada_dir,
            plant=plant,
            out=args.out,
            truth_out=args.truth,
            progress=flown.advance,
        )
    print(world)
    files = WorldFiles.named(args.out, args.truth)
    print(f"wrote {files.rows}, {files.truth}, {files.flights}")
