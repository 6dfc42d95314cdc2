"""Fly descents of a JSBSim aircraft and write the rows that a radar would have of them, and the truth if asked."""

import argparse
from pathlib import Path

from tqdm import tqdm

from descentflow.core.errors import DescentflowError
from descentflow.simulation.jsbsim_world.airframes import AIRFRAMES
from descentflow.simulation.jsbsim_world.fly_models import fly
from descentflow.simulation.jsbsim_world.model_effects import EFFECTS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.epilog = "effects:\n" + "\n".join(
        f"  {one.name}: " + ", ".join(f"{value} [{unit}]" for value, unit in one.units.items())
        for one in EFFECTS.values()
    )
    parser.add_argument("--model", choices=list(AIRFRAMES), required=True)
    parser.add_argument("--flights", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--inject", action="append", default=[], type=effect, help="for instance temperature:mean_k=10,spread_k=4"
    )
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
                dict(args.inject),
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


def effect(text: str) -> tuple[str, dict[str, float]]:
    """``name:value=number,...``."""
    name, _, values = text.partition(":")
    pairs = [pair.partition("=") for pair in values.split(",") if pair]
    return name, {key.strip(): float(number) for key, _, number in pairs}


if __name__ == "__main__":
    main()
