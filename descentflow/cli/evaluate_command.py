"""`descentflow evaluate`: scores of a checkpoint against the descents of any prepared file."""

import argparse
from pathlib import Path

from descentflow.cli import air_arguments
from descentflow.core.seeds import seed_word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Sample a checkpoint and score the samples against real descents: time to bottom, CAS and rate above and below "
        "transition, as Kolmogorov-Smirnov and Wasserstein distance and error of the mean, each beside the distance "
        "between as many real flights and beside nominal BADA. Flights that the checkpoint was trained or "
        "validated on are left out, by aircraft and time where they come under another flight_id."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    parser.add_argument(
        "--real",
        type=Path,
        required=True,
        help="prepared descents (descentflow prepare), or rows",
    )
    parser.add_argument(
        "--context-table", type=Path, help="CSV or Parquet with flight_id and the context, for a conditional model"
    )
    air_arguments.add_source(parser)
    parser.add_argument("--out", type=Path, required=True, help="folder for scores.csv, rejections.json and figures")
    parser.add_argument("-n", "--number", type=int, default=10_000, help="samples (default: %(default)s)")
    parser.add_argument("--seed", type=seed_word, default=0, help="of sampling and splits (default: 0)")
    parser.add_argument("--draw-budget", type=int, help="most draws before giving up (default: 100 for each sample)")
    parser.add_argument(
        "--resamples", type=int, help="also write intervals.csv: 90 %% bootstrap intervals of the scores over flights"
    )
    parser.add_argument("--no-figures", dest="figures", action="store_false", help="draw no figures")


def run(args: argparse.Namespace) -> None:
    """Evaluate, write and print."""
    from descentflow.core.files import check_folder, whole_file
    from descentflow.core.progress import stage
    from descentflow.evaluation.evaluate import N_SPLITS, evaluate
    from descentflow.evaluation.evaluation_report import FILES
    from descentflow.evaluation.metrics.scores import n_comparisons

    check_folder(args.out, *FILES, "intervals.csv")
    with stage("reading descents") as shown:
        found = evaluate(
            args.checkpoint,
            args.real,
            n=args.number,
            seed=args.seed,
            context_table=args.context_table,
            air=air_arguments.source_of(args),
            draw_budget=args.draw_budget,
            progress=shown.part("drawing descents", args.number, "descents"),
            score_progress=shown.part("scoring", n_comparisons(N_SPLITS), "comparisons"),
        )
    with stage("classifying, drawing figures and writing" if args.figures else "classifying and writing"):
        found.write(args.out, figures=args.figures)
    if args.resamples is not None:
        with stage("resampling flights"), whole_file(args.out / "intervals.csv") as temporary:
            found.intervals(args.resamples, args.seed).write_csv(temporary)
    print(found)
    print(f"wrote {args.out / 'scores.csv'}{' and figures' if args.figures else ''}")
