"""Fly descents of a JSBSim aircraft and write the rows that a radar would have of them, and the truth if asked."""

import argparse
from pathlib import Path

from tqdm import tqdm

from descentflow.cli.simulate_command import listing, planted
from descentflow.core.errors import DescentflowError
from studies.jsbsim_world.airframes import AIRFRAMES
from studies.jsbsim_world.fly_models import fly
from studies.jsbsim_world.model_effects import EFFECTS


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=listing(EFFECTS), formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", choices=list(AIRFRAMES), required=True)
    parser.add_argument("--flights", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plant", nargs="+", action="extend", default=[], help="EFFECT:VALUE=NUMBER,... (see below)")
    parser.add_argument("--typecode", help="type that the rows name (default: the one to diagnose the model with)")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True, help="rows, a .parquet file")
    parser.add_argument("--truth", type=Path, help="truth, a .parquet file")
    args = parser.parse_args()
    typecode = args.typecode or AIRFRAMES[args.model].reference
    try:
        with tqdm(total=args.flights, delay=2, unit=" flights", leave=False) as bar:
            world = fly(
                args.model,
                args.flights,
                args.seed,
                planted(args.plant),
                typecode=typecode,
                workers=args.workers,
                progress=bar.update,
            )
    except DescentflowError as error:
        raise SystemExit(f"error: {error}") from error
    world.rows.write_parquet(args.out)
    if args.truth:
        world.truth.write_parquet(args.truth)
    print(f"{world}; wrote {args.out}")


if __name__ == "__main__":
    main()
