"""`descentflow export`: samples, or the model itself, in the format of another program."""

import argparse
from pathlib import Path

from descentflow.cli import context_arguments, position_arguments
from descentflow.core.seeds import seed_word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from descentflow.exports.targets import TARGETS

    listed = "\n".join(f"  {name:<13}{target.purpose}" for name, target in TARGETS.items())
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.description = (
        f"Write samples of a checkpoint, or the model itself, for another program.\n\ntargets:\n{listed}"
    )
    parser.add_argument(
        "checkpoint",
        type=Path,
        nargs="+",
        help="checkpoint that `descentflow fit` wrote (.ckpt); for bluesky and bluebird several, of different types",
    )
    parser.add_argument("--to", required=True, choices=TARGETS, metavar="TARGET", help="one of the targets above")
    parser.add_argument("--out", type=Path, required=True, help="output; some targets write further files beside it")
    parser.add_argument(
        "-n", "--number", type=int, default=1000, help="samples of each checkpoint (default: %(default)s)"
    )
    parser.add_argument("--seed", type=seed_word, default=0, help="the same seed gives the same files (default: 0)")
    parser.add_argument(
        "--every",
        type=float,
        default=120.0,
        metavar="S",
        help="seconds from one flight's arrival to the next one's (default: 120)",
    )
    parser.add_argument(
        "--prefix",
        default="DF",
        metavar="LETTERS",
        help="of the callsigns: two exports that fly in one simulation need two (default: %(default)s)",
    )
    parser.add_argument(
        "--as",
        dest="fly_as",
        nargs="+",
        default=(),
        metavar="TYPES",
        help="types that fly the samples, A319,A320,A321; such a list for each checkpoint: bluesky, bluebird",
    )
    parser.add_argument(
        "--into",
        nargs=3,
        default=(),
        type=Path,
        metavar=("PROFILE", "UNCERTAINTY", "MAPPING"),
        help="tables of bluebird-dt, whose climbs, cruises and other types the written ones keep: bluebird",
    )
    parser.add_argument(
        "--precision",
        choices=("float64", "float32"),
        default="float64",
        help="of the inputs and outputs of a sampler (--to onnx; default: float64)",
    )
    parser.add_argument(
        "--step-s",
        type=float,
        metavar="S",
        help="a row every S seconds, on whole steps of the clock: parquet, cf, traffic (default: 1 for traffic, a row "
        "for each level for the others)",
    )
    parser.add_argument("--draw-budget", type=int, help="most draws before giving up (default: 100 for each sample)")
    context_arguments.add_arguments(parser)
    position_arguments.add_arguments(parser)


def run(args: argparse.Namespace) -> None:
    """Draw, write, and say what was written."""
    from descentflow.core.progress import stage
    from descentflow.exports.export import export

    drawing = ("drawing descents", args.number * len(args.checkpoint), "descents")
    what = ("exporting the model",) if args.to == "onnx" else drawing
    with stage(*what) as drawn:
        written = export(
            args.checkpoint,
            args.to,
            args.out,
            n=args.number,
            seed=args.seed,
            context=context_arguments.context_of(args),
            end=args.end,
            track=args.track,
            route=args.route,
            wind=args.wind,
            to_go_nm=args.to_go,
            end_time=args.time,
            every_s=args.every,
            draw_budget=args.draw_budget,
            progress=drawn.advance,
            precision=args.precision,
            step_s=args.step_s,
            prefix=args.prefix,
            fly_as=args.fly_as,
            into=args.into,
        )
    for path in written:
        print(f"wrote {path}")
