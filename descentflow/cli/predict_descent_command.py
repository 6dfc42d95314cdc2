"""`descentflow predict-descent`: the rest of observed descents, from their first part."""

import argparse
from pathlib import Path

from descentflow.cli import position_arguments
from descentflow.core.seeds import seed_word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Predict descents from the part at and above a flight level: intervals of the time and the distance to each "
        "level below, and on request every continuation, in the columns of `descentflow sample`, and the probability "
        "of being at each level over time. Where the descents go on below that level, the share of flights inside "
        "their intervals is printed too."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    parser.add_argument("descents", type=Path, help="prepared descents (descentflow prepare), or rows")
    parser.add_argument("--from-fl", type=float, required=True, help="last level that counts as observed")
    parser.add_argument(
        "--flight", action="append", help="flight_id; may be given again (default: every unseen flight)"
    )
    parser.add_argument(
        "-n", "--number", type=int, default=500, help="continuations of each, 50 at least (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=seed_word, default=0, help="the same seed gives the same predictions (default: 0)"
    )
    parser.add_argument(
        "--context-table", type=Path, help="CSV or Parquet with flight_id and the context, for a conditional model"
    )
    parser.add_argument("--out", type=Path, required=True, help="table of the intervals (.parquet, .csv)")
    parser.add_argument("--continuations", type=Path, help="also write every continuation (.parquet, .csv)")
    parser.add_argument("--occupancy", type=Path, help="also write the occupancy of levels (.parquet, .csv)")
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="FILE",
        help="also draw CAS (kt), vertical rate (ft/min) and time (min) against flight level, predicted and flown, of "
        "the first four flights: .png or .svg",
    )
    parser.add_argument("--step-s", type=_positive, default=10.0, help="step of the occupancy's time (default: 10)")
    position_arguments.add_arguments(parser)


def _positive(text: str) -> float:
    try:
        if (number := float(text)) > 0:
            return number
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"{text!r}; expected a number above 0")


def run(args: argparse.Namespace) -> None:
    """Predict, write, and compare with what was observed."""
    from dataclasses import replace

    from descentflow.core.files import check_output
    from descentflow.core.progress import stage
    from descentflow.core.tabular import write_table
    from descentflow.core.threads import one_thread_unless_told
    from descentflow.generation.prediction.predict import predict
    from descentflow.reporting.figure_file import check_figure_file, write_figure

    one_thread_unless_told()
    plan = position_arguments.plan_of(args)
    for output in (args.out, args.occupancy, args.continuations):
        if output is not None:
            check_output(output)
    if args.figure is not None:
        check_figure_file(args.figure)
    with stage("predicting", unit="flights") as predicted:
        ahead = predict(
            args.checkpoint,
            args.descents,
            args.from_fl,
            n=args.number,
            seed=args.seed,
            flights=args.flight,
            context_table=args.context_table,
            progress=predicted.advance,
            total=predicted.expect,
        )
    ahead = replace(ahead, plan=plan)
    with stage(f"writing {args.out}"):
        ahead.write(args.out)
        if args.continuations is not None:
            write_table(ahead.continuations(), args.continuations)
        if args.occupancy is not None:
            write_table(ahead.occupancy(args.step_s), args.occupancy)
    if args.figure is not None:
        with stage(f"drawing {args.figure}"):
            write_figure(ahead.figure(), args.figure)
    print(ahead)
    written = [args.out, args.continuations, args.occupancy, args.figure]
    print(f"wrote {', '.join(str(path) for path in written if path is not None)}")
