"""`descentflow simulate`: fly aircraft of known truth and write what a radar would report of them."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Fly descents of one aircraft type by the full equation of motion, with operators of different schedules, "
        "spread of mass, thrust and drag, level-offs and constant-rate stretches, and write the rows that a Mode S "
        "radar would report of them. The truth behind the rows is written beside them: OUT_truth.parquet, a row per "
        "flight and time step, and OUT_flights.parquet, a row per flight with every parameter."
    )
    parser.add_argument("--typecode", default="A320", help="aircraft type (default: %(default)s)")
    parser.add_argument("--flights", type=int, default=2000, help="flights wanted (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same flights (default: 0)")
    parser.add_argument(
        "--scenario",
        default="plain",
        help="settings of the world by type: plain, london-fir-2019 (the traffic that the paper describes: operators "
        "of different speeds, slow first stretches, turboprops of two rates), or a TOML file (default: %(default)s)",
    )
    parser.add_argument("--out", type=Path, required=True, help="output: surveillance rows, .parquet")
    parser.add_argument("--truth", type=Path, help="where to put the truth (default: OUT_truth.parquet)")
    parser.add_argument(
        "--bada-dir", type=Path, help="BADA 3 directory with the type's coefficients (default: the open aircraft)"
    )


def run(args: argparse.Namespace) -> None:
    """Fly, write, and say what there is."""
    from tqdm import tqdm

    from descentflow.aircraft_types.registry import aircraft
    from descentflow.core.errors import ConfigError
    from descentflow.core.files import whole_file
    from descentflow.simulation.scenarios import scenario
    from descentflow.simulation.world import simulate

    truth = args.truth or args.out.with_name(f"{args.out.stem}_truth.parquet")
    flights = args.out.with_name(f"{args.out.stem}_flights.parquet")
    outputs = (args.out, truth, flights)
    if any(path.suffix != ".parquet" for path in outputs) or len(set(outputs)) < len(outputs):
        raise ConfigError(
            f"outputs {', '.join(map(str, outputs))}",
            expected="three different names that end in .parquet",
            mend="choose other names for --out and --truth",
        )
    for path in outputs:  # a folder that does not exist is better said before the flight than after it
        if not path.parent.is_dir():
            raise ConfigError(
                f"output {path} in a folder that does not exist", expected="a folder", mend="create the folder"
            )
    kind = aircraft(args.typecode, args.bada_dir)
    with tqdm(total=args.flights, desc="flights", delay=2) as bar:
        world = simulate(kind, args.flights, args.seed, scenario(args.scenario, kind), progress=bar.update)
    for frame, path in zip((world.rows, world.truth, world.flights), outputs, strict=True):
        with whole_file(path) as temporary:
            frame.write_parquet(temporary)
    level_offs, managed = (int(world.flights[c].is_not_null().sum()) for c in ("level_off_fl", "managed_fl"))
    print(
        f"{len(world.flights)} flights of {args.typecode}, scenario {args.scenario}, seed {args.seed}: "
        f"{len(world.rows)} rows; level-offs planned for {level_offs}, constant-rate stretches for {managed} flights"
    )
    print(f"wrote {args.out}, {truth}, {flights}")
