"""`descentflow sample`: draw plausible descents from a checkpoint."""

import argparse
from pathlib import Path

from descentflow.cli import air_arguments, context_arguments, position_arguments
from descentflow.core.seeds import seed_word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Draw plausible descents from a fitted model and write them as one long table: a row per sample and flight "
        "level, with time since entry, altitude, CAS, Mach, TAS, vertical rate, drag, distances and groundspeed. A "
        "model that was fitted with data.context needs a context, by --given or --given-table; the table then "
        "holds it too."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    parser.add_argument("-n", "--number", type=int, default=10_000, help="descents wanted (default: %(default)s)")
    parser.add_argument("--seed", type=seed_word, default=0, help="the same seed gives the same descents (default: 0)")
    parser.add_argument("--out", type=Path, required=True, help="output: .parquet, .csv or .nc (NetCDF)")
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="FILE",
        help="also draw CAS (kt), vertical rate (ft/min) and time (min) against flight level: .png or .svg",
    )
    context_arguments.add_arguments(parser)
    air_arguments.add_arguments(parser)
    position_arguments.add_arguments(parser)
    parser.add_argument(
        "--draw-budget", type=int, help="most draws before giving up (default: 100 for each descent wanted)"
    )


def run(args: argparse.Namespace) -> None:
    """Sample, write, and say what was rejected."""
    from descentflow.core.files import check_output
    from descentflow.core.progress import stage
    from descentflow.generation.sample import sample
    from descentflow.reporting.figure_file import check_figure_file, write_figure

    check_output(args.out)
    if args.figure is not None:
        check_figure_file(args.figure)
    plan = position_arguments.plan_of(args)
    with stage("drawing descents", args.number, "descents") as drawn:
        samples = sample(
            args.checkpoint,
            args.number,
            seed=args.seed,
            context=context_arguments.context_of(args),
            air=air_arguments.air_of(args),
            plan=plan,
            draw_budget=args.draw_budget,
            progress=drawn.advance,
        )
    with stage(f"writing {args.out}"):
        samples.write(args.out)
    if args.figure is not None:
        with stage(f"drawing {args.figure}"):
            write_figure(samples.figure(title=f"{args.checkpoint.name}: {len(samples):,} samples"), args.figure)
    print(samples.report)
    print(f"wrote {args.out}{f' and {args.figure}' if args.figure else ''}")
